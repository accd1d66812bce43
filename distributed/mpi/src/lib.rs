//! Overlapping spheres over many ranks, through MPI.
//!
//! A simulator hands over its communicator and the spheres of each rank, and gets the pairs across ranks, each once:
//!
//! ```no_run
//! use lazygrid::Sphere;
//! use lazygrid_mpi::{Config, Distributed, Local};
//! use mpi::traits::Communicator;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let universe = mpi::initialize().ok_or("MPI is running already")?;
//! let world = universe.world();
//! lazygrid_mpi::abort_on_panic();
//!
//! let rank = world.rank() as f32;
//! let spheres = [Sphere::new([rank, 0.0, 0.0], 0.6)];           // those of this rank
//! let ids = [world.rank() as u64];                              // unique among all ranks
//! let mut distributed = Distributed::new(&world, Config::default())?;
//! for pair in distributed.pairs(Local::new(&spheres, &ids))? {  // on all ranks together
//!     log::info!("{} of rank {} overlaps {} of rank {}", pair.a.id, pair.a.rank, pair.b.id, pair.b.rank);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! Every method of [`Distributed`] is collective: all ranks of the communicator call it, in the same order. An error on
//! one rank is the same error on all of them, and names the rank.
//!
//! How it works is said in `lazygrid-ranks`, whose functions decide; this crate carries the data.

mod abort;
mod agree;
mod config;
mod distributed;
mod error;
mod identity;
mod local;
mod node;
mod pair;
mod parts;
mod report;
mod settle;
#[cfg(feature = "simulator")]
mod simulate;
mod wire;

pub use abort::abort_on_panic;
pub use agree::{agree, agree_on};
pub use config::{Config, Delivery, Ownership};
pub use distributed::Distributed;
pub use error::Error;
pub use lazygrid_ranks::{Migration, Settings};
pub use local::{Local, Particles};
pub use mpi;
pub use node::threads;
pub use pair::{End, GlobalPair};
pub use report::Report;
pub use settle::Settled;
#[cfg(feature = "simulator")]
pub use simulate::{Simulated, simulate};
