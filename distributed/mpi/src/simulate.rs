use std::ops::ControlFlow;

use lazygrid_sim::ranks::GatherFields;
use lazygrid_sim::run::{Run, RunEnd};
use mpi::traits::Communicator;

use crate::communicator::MpiCommunicator;
use crate::{Config, Error};

/// The result of a run over ranks, the same on all of them.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Simulated {
    /// The way in which it ended.
    pub end: RunEnd,
    /// The number of steps done.
    pub steps: u32,
    /// A line for each thing that was counted.
    pub summary: String,
}

/// Does a run of the simulator on all ranks of a communicator, with the files of `lazygrid simulate`. All ranks need to
/// see its directory, and have the same run. `watch` is called on every rank with the steps that are done, and stops
/// all if it breaks on one.
///
/// Ranks compute on the CPU, in the caller's rayon pool, and send from the calling thread.
///
/// # Errors
/// [`Error::Input`] with the simulator's message, such as that the model needs an order across ranks.
pub fn simulate(
    communicator: &impl Communicator,
    run: &Run,
    watch: impl FnMut(u32) -> ControlFlow<()>,
) -> Result<Simulated, Error> {
    let comm = MpiCommunicator::new(communicator.duplicate(), Config::default().message_limit);
    let (end, mut simulation) = run.run_distributed(comm, watch)?;
    let standing = simulation.gather(GatherFields { received: true, particles: false })?;
    let summary = run.summary(&standing);
    Ok(Simulated { end, steps: simulation.step_count(), summary })
}
