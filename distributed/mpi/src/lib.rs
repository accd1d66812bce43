//! Overlapping spheres over many ranks, through MPI.
//!
//! A simulator passes its communicator and each rank's spheres:
//!
//! ```no_run
//! use lazygrid::Sphere;
//! use lazygrid_mpi::{Config, Distributed, LocalSpheres};
//! use mpi::traits::Communicator;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let universe = mpi::initialize().ok_or("MPI is running already")?;
//! let world = universe.world();
//! lazygrid_mpi::abort_on_panic();
//!
//! let rank = world.rank() as f32;
//! let spheres = [Sphere::new([rank, 0.0, 0.0], 0.6)];
//! let ids = [world.rank() as u64];                              // unique among all ranks
//! let mut distributed = Distributed::new(&world, Config::default())?;
//! for pair in distributed.pairs(LocalSpheres::new(&spheres, &ids))? {  // on all ranks together
//!     log::info!("{} of rank {} overlaps {} of rank {}", pair.a.id, pair.a.rank, pair.b.id, pair.b.rank);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! Errors are the same on all ranks. `lazygrid-ranks` has the algorithm.

#![allow(missing_docs, reason = "most names and types are clear")]

mod abort;
mod agree;
mod agree_on;
mod communicator;
mod config;
mod distributed;
mod error;
mod id_check;
mod local;
mod node_rank;
mod pair;
mod rank_segments;
mod rebalance;
mod report;
#[cfg(feature = "simulator")]
mod simulate;

pub use abort::abort_on_panic;
pub use agree::agree;
pub use agree_on::agree_on;
pub use communicator::try_reserved;
pub use config::{Config, Delivery, Ownership};
pub use distributed::Distributed;
pub use error::Error;
pub use lazygrid_ranks::{Migration, Settings};
pub use local::{LocalSpheres, OwnedSpheres};
pub use mpi;
pub use node_rank::threads;
pub use pair::{GlobalPair, SphereRef};
pub use rebalance::RebalanceReport;
pub use report::Report;
#[cfg(feature = "simulator")]
pub use simulate::{Simulated, simulate};
