use std::ops::ControlFlow;

use lazygrid_sim::ranks::GatherFields;
use lazygrid_sim::run::{Run, RunEnd};
use mpi::traits::Communicator;

use crate::communicator::MpiCommunicator;
use crate::node_rank::NodeRank;
use crate::{Config, Error};

/// Equal on all ranks.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Simulated {
    pub end: RunEnd,
    pub steps: u32,
    pub summary: String,
}

/// Runs the simulator on all ranks, which need the same run, except [`Run::backend`], and see its directory. `watch`
/// gets the completed steps on every rank; a break on one stops all. Ranks compute in the caller's rayon pool, and send
/// from the calling thread.
///
/// Particles move on GPUs if all ranks use GPUs and the model has no reactions and contacts. Otherwise GPUs find pairs.
///
/// # Errors
/// [`Error::Input`] with the simulator's message.
pub fn simulate(
    communicator: &impl Communicator,
    run: &Run,
    watch: impl FnMut(u32) -> ControlFlow<()>,
) -> Result<Simulated, Error> {
    let comm = MpiCommunicator::new(communicator.duplicate(), Config::default().message_limit);
    let detector =
        NodeRank::new(comm.comm()).device(run.backend).apply_to(lazygrid::Config::default(), run.backend);
    let (end, mut simulation) = run.run_distributed(comm, detector, watch)?;
    let standing = simulation.gather(GatherFields { received: true, particles: false })?;
    let summary = run.summary(&standing);
    Ok(Simulated { end, steps: simulation.step_count(), summary })
}
