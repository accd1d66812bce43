//! A run over ranks: processes that each own disjoint particles.
//!
//! Every rank does the work of [`Simulation`](crate::Simulation) for its own particles, and moves all receivers. See
//! `docs/design/ranks.md` for the exchanges.

mod contacts;
mod cpu_run;
mod gathered;
#[cfg(feature = "gpu")]
mod gpu_run;
mod halo;
mod matching;
mod pair_search;
mod rank_run;
mod rows;
mod run;
mod simulation;

pub use gathered::Gathered;
use lazygrid_ranks::Communicator;
pub use simulation::{GatherFields, RankSimulation};

/// Returns `result` if no rank failed. Collective.
fn agree<T, C: Communicator>(communicator: &C, result: Result<T, crate::Error>) -> Result<T, C::Error> {
    communicator.agree(result.map_err(|error| communicator.failure(error.to_string())))
}
