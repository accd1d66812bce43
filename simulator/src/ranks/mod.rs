//! A run over ranks: processes that each own a part of the particles.
//!
//! Every rank does with its own particles what [`Simulation`](crate::Simulation) does with all, and moves all
//! receivers: pure functions of id, seed and step. Ranks communicate for
//!
//! - *receptors*: all ranks select from all requests;
//! - *pairs*: particles migrate to the owner of their part of space, and ghosts to ranks with particles within reach
//!   ([`lazygrid_ranks`]);
//! - *reactions* ([`matching`](crate::reaction::matching)): in rounds, a particle's owner receives each rank's best
//!   key and replies with the best of all;
//! - *ids* of second products of dissociations: all ranks know the parents of the step;
//! - *counts*: sums.
//!
//! A run equals that of one process, row by row and frame by frame; either resumes the other's checkpoints.

mod gathered;
mod matching;
mod rows;
mod run;
mod simulation;

pub use gathered::Gathered;
pub use simulation::{GatherFields, RankSimulation};

use crate::model::Contact;
use crate::{Error, Model};

/// Refuses models that need an order across ranks.
///
/// # Errors
/// [`Error::NotOverRanks`].
pub fn check(model: &Model) -> Result<(), Error> {
    let refused = |what: &str| Err(Error::NotOverRanks { what: what.to_owned() });
    match model.contact {
        Contact::Separate => {
            refused("contact = \"separate\": ranks do not exchange collisions within a step")
        }
        Contact::Elastic => refused("contact = \"elastic\": ranks do not exchange collisions within a step"),
        Contact::Count | Contact::Ignore => Ok(()),
    }
}
