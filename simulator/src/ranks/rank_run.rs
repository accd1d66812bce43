//! A rank's particles on the CPU or on its GPU, and the choice between the two.

use lazygrid::{Backend, Config};
use lazygrid_ranks::Communicator;

use super::cpu_run::CpuRun;
#[cfg(feature = "gpu")]
use super::gpu_run::GpuRun;
use crate::release::rank_slice::RankSlice;
use crate::{Contact, Error, Model, RunView, State, Totals};

#[derive(Debug)]
pub(super) enum RankRun {
    Cpu(Box<CpuRun>),
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuRun>),
}

impl RankRun {
    /// `share` has this rank's slice of the releases, and the number of ranks on its machine.
    #[cfg(feature = "gpu")]
    pub(super) fn on_gpu(
        model: Model,
        seed: u64,
        detector: &Config,
        state: &State,
        share: (RankSlice, u32),
    ) -> Result<Self, Error> {
        GpuRun::new(model, seed, detector, state, share).map(Box::new).map(Self::Gpu)
    }

    #[cfg(not(feature = "gpu"))]
    pub(super) fn on_gpu(
        _: Model,
        _: u64,
        _: &Config,
        _: &State,
        _: (RankSlice, u32),
    ) -> Result<Self, Error> {
        Err(lazygrid::Error::WithoutGpu.into())
    }

    pub(super) fn view(&self) -> &dyn RunView {
        match self {
            Self::Cpu(run) => &run.simulation,
            #[cfg(feature = "gpu")]
            Self::Gpu(run) => &run.simulation,
        }
    }

    pub(super) fn backend(&self) -> Backend {
        match self {
            Self::Cpu(_) => Backend::Cpu,
            #[cfg(feature = "gpu")]
            Self::Gpu(_) => Backend::Gpu,
        }
    }

    /// Returns the largest number of steps of one call.
    pub(super) fn steps_at_once(&self) -> u32 {
        match self {
            Self::Cpu(_) => 1,
            #[cfg(feature = "gpu")]
            Self::Gpu(run) => run.steps_at_once(),
        }
    }

    /// Returns the state without particles, which is common to all ranks except for the counts.
    pub(super) fn without_particles(&self, totals: Totals) -> State {
        match self {
            Self::Cpu(run) => run.simulation.state.without_particles(totals),
            #[cfg(feature = "gpu")]
            Self::Gpu(run) => State { totals, ..run.simulation.without_particles() },
        }
    }

    pub(super) fn request_warnings(&self) -> Vec<String> {
        match self {
            Self::Cpu(run) => run.simulation.requests.warnings(&run.simulation.model),
            #[cfg(feature = "gpu")]
            Self::Gpu(run) => run.requests.warnings(run.simulation.model()),
        }
    }
}

/// Returns `true` if the particles of all ranks move on GPUs. Collective.
///
/// Ranks with and without a GPU do not mix, because a checkpoint names one backend and backends round differently.
pub(super) fn moves_on_gpus<C: Communicator>(communicator: &mut C, model: &Model, detector: &Config) -> bool {
    let ranks = u64::from(communicator.ranks());
    let asking = communicator.all_reduce_sum(&[detector.requires_gpu().into()])[0];
    let obstacle = match asking {
        0 => return false,
        asking if asking < ranks => Some(format!("{} of {ranks} ranks use no GPU", ranks - asking)),
        _ => obstacle(model),
    };
    if let Some(obstacle) = &obstacle
        && communicator.rank() == 0
    {
        log::info!("particles move on the CPU, and GPUs find their pairs at the most: {obstacle}");
    }
    obstacle.is_none()
}

/// Returns the reason why particles of this model do not move on the GPUs of ranks.
fn obstacle(model: &Model) -> Option<String> {
    let common = [(!model.reactions.is_empty(), "reactions"), (model.contact != Contact::Ignore, "contacts")];
    let found = common.into_iter().find(|&(has, _)| has);
    let found = found.map(|(_, what)| format!("ranks decide on {what} together in each step"));
    found.or_else(|| without_kernels(model))
}

#[cfg(feature = "gpu")]
fn without_kernels(model: &Model) -> Option<String> {
    crate::gpu::check(model).err().map(|error| error.to_string())
}

#[cfg(not(feature = "gpu"))]
fn without_kernels(_: &Model) -> Option<String> {
    None
}
