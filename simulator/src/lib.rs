//! A reference simulator of molecular communication: particles (carriers) that diffuse, react and collide. It shows how
//! to build a reaction–diffusion simulator on [`lazygrid`] and uses only its public API.
//!
//! A [`Model`] describes the system and a [`Simulation`] advances it step by step. Particles are stored in columns. The
//! outcome for each particle or pair is a pure function of the columns, the seed and the step. Random numbers come from
//! a counter-based generator ([`philox`]). A run therefore depends on its seed alone, not on the number of threads, the
//! order of particles or the detection algorithm.
//!
//! `gpu` runs the simulation on a GPU, where all data stay between steps. A [`Simulator`] runs on either backend.
//! [`ranks`] distributes a run over several processes.
//!
//! Lengths are in µm and times in s throughout.
//!
//! ```
//! use lazygrid::Algorithm;
//! use lazygrid_sim::{Model, Shape, Simulation, Species, Transmitter};
//!
//! let species = Species { name: "acid".into(), diffusion: 100.0, mass: 1.0, ..Species::default() };
//! let burst = Transmitter {
//!     name: "burst".into(),
//!     center: [0.0; 3],
//!     shape: Shape::Point,
//!     release: vec![(0, 1000)],
//!     ..Transmitter::default()
//! };
//! let model = Model { time_step: 0.001, species: vec![species], transmitters: vec![burst], ..Model::default() };
//! let mut simulation = Simulation::new(model, 42, Algorithm::Auto)?;
//! for _ in 0..10 {
//!     simulation.step()?;
//! }
//! assert_eq!(simulation.state().particles.len(), 1000);
//! # Ok::<(), lazygrid_sim::Error>(())
//! ```

pub mod animation;
pub mod arrivals;
pub mod binding;
pub mod bodies;
pub mod boundary;
pub mod checkpoint;
pub mod contact;
pub mod crossing;
pub mod decay;
pub mod dissociation;
#[cfg(feature = "gpu")]
pub mod gpu;
mod instant;
pub mod matching;
pub mod message;
pub mod model;
pub mod motion;
pub mod normal;
#[cfg(feature = "clap")]
pub mod options;
pub mod particles;
pub mod philox;
pub mod ranks;
pub mod rate;
pub mod reactions;
pub mod receiver;
pub mod release;
pub mod replicas;
pub mod results;
pub mod run;
pub mod scenario;
pub mod transmitter;
pub mod vessel;

mod adsorption;
mod chances;
mod check;
mod checksum;
mod error;
mod output;
mod pace;
mod reception;
mod sealed;
mod simulation;
mod simulator;
mod standing;
mod state;
mod stream;
mod turning;
mod vicinity;

pub use arrivals::{Arrival, Origin};
pub use boundary::{Axis, Boundary};
pub use error::{Damage, Error};
pub use model::{Chance, Contact, Decay, Flow, Model, Reaction, Species, Unbinding};
pub use output::series;
pub use particles::{Particle, Particles};
pub use receiver::{Kind, Receiver, Receptors, Sticking};
pub use simulation::Simulation;
pub use simulator::Simulator;
pub use standing::Standing;
pub use state::{State, Totals};
pub use transmitter::{Numbers, Schedule, Shape, Transmitter};
pub use vessel::Vessel;
