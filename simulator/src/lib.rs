//! A reference simulator of carriers that diffuse, react and collide: what a nanonetwork or any other
//! reaction–diffusion simulator looks like on top of [`lazygrid`], of which it uses only what everybody can.
//!
//! A [`Model`] says what is simulated and a [`Simulation`] does it, step by step. Particles are columns; what happens
//! to each of them, or to each pair, is a pure function of the columns, the seed and the step. Random numbers come by
//! counter ([`philox`]). So a run depends on its seed alone: not on the number of threads, the order of particles or
//! the algorithm that finds pairs.
//!
//! `gpu` does the same on a GPU, where everything stays; a [`Simulator`] is a run on either. [`ranks`] spreads a run over many
//! processes.
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
