//! A run on either back end, as those who write files about it need it.

use std::borrow::Cow;

use lazygrid::gpu::GpuDevice;
use lazygrid::{Algorithm, Backend};

use crate::gpu::{GpuOptions, GpuSimulation};
use crate::{Arrival, Error, Model, Simulation, State, Totals};

/// A run on the CPU or on a GPU.
#[derive(Debug)]
pub enum Simulator {
    /// On the CPU.
    Cpu(Box<Simulation>),
    /// On a GPU.
    Gpu(Box<GpuSimulation>),
}

/// Steps after which a run on a GPU comes back, so that it can be watched and stopped.
const GPU_STEPS: u32 = 64;

impl Simulator {
    /// A run from `state` on, or from the beginning. [`Backend::Auto`] is the CPU, since back ends round differently
    /// and a run is to depend on its seed alone; `algorithm` is how the CPU finds pairs.
    ///
    /// # Errors
    /// As [`Simulation::resume`] or [`GpuSimulation::resume`], and [`Error::Detection`] where there is no GPU.
    pub fn begin(
        model: &Model,
        seed: u64,
        backend: Backend,
        algorithm: Algorithm,
        state: Option<State>,
    ) -> Result<Self, Error> {
        let state = state.map_or_else(|| State::new(model, seed), Ok)?;
        let model = model.clone();
        if backend == Backend::Gpu {
            let device = GpuDevice::shared(true).map_err(|error| {
                Error::Detection(lazygrid::Error::GpuUnavailable { reason: error.to_string() })
            })?;
            let run = GpuSimulation::resume(model, seed, device, GpuOptions::default(), &state)?;
            return Ok(Self::Gpu(Box::new(run)));
        }
        Ok(Self::Cpu(Box::new(Simulation::resume(model, seed, algorithm, state)?)))
    }

    /// Does the next steps: one on the CPU and several on a GPU, but no more than `most`.
    ///
    /// # Errors
    /// As [`Simulation::step`] or [`GpuSimulation::run`].
    pub fn advance(&mut self, most: u32) -> Result<(), Error> {
        match self {
            Self::Cpu(run) => run.step(),
            Self::Gpu(run) => run.run(most.min(GPU_STEPS)),
        }
    }

    /// Where it runs.
    pub fn backend(&self) -> Backend {
        match self {
            Self::Cpu(_) => Backend::Cpu,
            Self::Gpu(_) => Backend::Gpu,
        }
    }

    /// What is simulated.
    pub fn model(&self) -> &Model {
        match self {
            Self::Cpu(run) => run.model(),
            Self::Gpu(run) => run.model(),
        }
    }

    /// How many steps are done.
    pub fn step_count(&self) -> u32 {
        match self {
            Self::Cpu(run) => run.state().step,
            Self::Gpu(run) => run.step_count(),
        }
    }

    /// The time that has passed, in s.
    pub fn time(&self) -> f64 {
        f64::from(self.step_count()) * self.model().time_step
    }

    /// What was counted.
    pub fn totals(&self) -> &Totals {
        match self {
            Self::Cpu(run) => &run.state().totals,
            Self::Gpu(run) => run.totals(),
        }
    }

    /// What each receiver has to say, by species.
    pub fn received(&self) -> Vec<Vec<u64>> {
        match self {
            Self::Cpu(run) => run.received(),
            Self::Gpu(run) => run.received(),
        }
    }

    /// Who arrived in the last step; see [`Simulation::arrivals`]. A GPU refuses a model that logs arrivals.
    pub fn arrivals(&self) -> &[Arrival] {
        match self {
            Self::Cpu(run) => run.arrivals(),
            Self::Gpu(_) => &[],
        }
    }

    /// Where the run stands, brought here where it is on a GPU.
    ///
    /// # Errors
    /// [`Error::Detection`] where the device fails.
    pub fn state(&self) -> Result<Cow<'_, State>, Error> {
        match self {
            Self::Cpu(run) => Ok(Cow::Borrowed(run.state())),
            Self::Gpu(run) => run.state().map(Cow::Owned),
        }
    }
}
