//! A run over ranks: processes that each own a part of the particles.
//!
//! Every rank does with its own particles what [`Simulation`](crate::Simulation) does with all, and moves all
//! receivers. `docs/design/ranks.md` has the exchanges between the parts of a step.

mod contacts;
mod gathered;
mod halo;
mod matching;
mod pair_search;
mod rows;
mod run;
mod simulation;

pub use gathered::Gathered;
pub use simulation::{GatherFields, RankSimulation};
