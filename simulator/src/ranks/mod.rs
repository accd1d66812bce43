//! A run over several ranks: processes that each own a part of the particles.
//!
//! Every rank does with its own particles what [`Simulation`](crate::Simulation) does with all, and moves all
//! receivers: these are pure functions of a particle's id, the seed and the step. Ranks communicate for
//!
//! - *receptors*: all ranks select from the requests of all ranks;
//! - *pairs*: particles migrate to the rank that owns their part of space, and ghosts go to ranks with particles within
//!   reach ([`lazygrid_ranks`]);
//! - *reactions* ([`matching`](crate::reaction::matching)): in rounds, the owner of a particle receives the best key of
//!   each rank and replies with the best of all;
//! - *ids* of second products of dissociations: all ranks know the parents of the step;
//! - *counts*, which are sums.
//!
//! A run therefore equals that of one process, row by row and frame by frame. Each resumes checkpoints of the other.

mod gathered;
mod matching;
mod rank_slice;
mod rows;
mod run;
mod simulation;

pub use gathered::Gathered;
pub use simulation::{GatherFields, RankSimulation};

pub(crate) use rank_slice::RankSlice;

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
