//! A run over many ranks: processes that each have a part of the particles and tell each other what they need.
//!
//! Every rank does with its own particles what [`Simulation`](crate::Simulation) does with all: motion, walls, receivers,
//! receptors, decays and releases are pure functions of a particle's id, the seed and the step. Receivers are moved by every
//! rank alike. What takes several ranks is
//!
//! - *receptors*: who finds a free one is decided by all ranks from the bids of all;
//! - *pairs*: particles go to the rank in whose part of space they are, and ghosts to where they may meet somebody
//!   ([`lazygrid_ranks`]);
//! - *who reacts* ([`matching`](crate::reaction::matching)): in rounds, in which the owner of a particle hears the best
//!   candidate of each rank and answers which is the best of all, until no rank has a candidate left;
//! - *ids* of what comes apart into two: all ranks know the parents of the step;
//! - *counts*, which are sums.
//!
//! So a run is that of one process, for any number of ranks: row by row, frame by frame, and checkpoints of either
//! are continued by the other.

mod gathered;
mod matching;
mod rows;
mod run;
mod share;
mod simulation;

pub use gathered::Gathered;
pub use simulation::{RankSimulation, Wanted};

pub(crate) use share::Share;

use crate::model::Contact;
use crate::{Error, Model};

/// Refuses what needs an order across ranks.
///
/// # Errors
/// [`Error::NotOverRanks`], naming the first such thing.
pub fn check(model: &Model) -> Result<(), Error> {
    let refused = |what: &str| Err(Error::NotOverRanks { what: what.to_owned() });
    match model.contact {
        Contact::Separate => refused("contact = \"separate\", which settles overlaps one after the other"),
        Contact::Elastic => refused("contact = \"elastic\", which settles collisions one after the other"),
        Contact::Count | Contact::Ignore => Ok(()),
    }
}
