//! A run over ranks: processes that each own a part of the particles.
//!
//! Every rank does with its own particles what [`Simulation`](crate::Simulation) does with all, and moves all
//! receivers. Ranks communicate for
//!
//! - *collisions* (`motion/collisions/`) and *reactions* (`matching.rs`), in rounds;
//! - *receptors*: all ranks select from all requests;
//! - *pairs*: particles migrate to the owner of their part of space, and ghosts to ranks with particles within reach
//!   ([`lazygrid_ranks`]);
//! - *separation* of overlaps: owners sum displacements, and send positions before each pass;
//! - *ids* of second products of dissociations: all ranks know the parents of the step.
//!
//! A run equals that of one process, row by row and frame by frame; either resumes the other's checkpoints.

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
