//! A reference simulator of molecular communication, and an example of a reaction–diffusion simulator on [`lazygrid`]'s
//! public API.
//!
//! A [`Model`] describes the system and a [`Simulation`] advances it. A run depends on its seed alone, not on threads,
//! the order of particles or the detection algorithm.
//!
//! `gpu` runs on a GPU, an [`AnySimulation`] on either backend, and [`ranks`] over several processes. Lengths are in
//! µm, times in s.
//!
//! ```
//! use lazygrid::Algorithm;
//! use lazygrid_sim::{Model, Shape, Simulation, Species, Transmitter};
//!
//! let species = Species { name: "acid".into(), diffusion: 100.0, ..Species::default() };
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

#![allow(missing_docs, reason = "most names and types are clear")]

#[cfg(feature = "gpu")]
pub mod gpu;
pub mod model;
pub mod motion;
pub mod random;
pub mod ranks;
pub mod reaction;
pub mod release;
/// Runs from a scenario to their files.
pub mod run;
pub mod scenario;
pub mod state;

mod checksum;
mod error;
mod memory;
mod output;
mod special;

pub use error::{Damage, Error};
pub use memory::check_available;
pub use model::boundary::{Axis, Boundary};
pub use model::chemotaxis::{Attractant, AttractantProfile, Chemotaxis};
pub use model::flow_field::FlowField;
pub use model::membrane::{Membrane, MembraneSurface};
pub use model::particles::{Particle, Particles};
pub use model::receiver::{Adsorption, Receiver, ReceiverKind};
pub use model::receptors::{Ligand, ReceptorType};
pub use model::transmitter::{CountDistribution, Schedule, Shape, Transmitter};
pub use model::vessel::Vessel;
pub use model::{Contact, Decay, Flow, Model, Reaction, ReactionRate, Species, Unbinding};
pub use output::{Report, TableWriter, animation, series, table, write_atomically, write_report};
pub use release::origins::{Arrival, Origin};
pub use run::any::AnySimulation;
pub use run::simulation::Simulation;
pub use state::view::RunView;
pub use state::{State, Totals};
