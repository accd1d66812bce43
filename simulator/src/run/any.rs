use std::borrow::Cow;
#[cfg(feature = "gpu")]
use std::sync::{Mutex, PoisonError};

#[cfg(feature = "gpu")]
use lazygrid::gpu::{GpuDevice, SoftwareAdapter};
use lazygrid::{Algorithm, Backend};

#[cfg(feature = "gpu")]
use crate::gpu::{GpuOptions, GpuSimulation};
#[cfg(feature = "gpu")]
use crate::run::memory_estimate::check_memory_on_gpu;
use crate::run::memory_estimate::{Sharing, check_largest_release};
use crate::state::view::RunView;
use crate::{Arrival, Error, Model, Simulation, State, Totals};

#[derive(Debug)]
pub enum AnySimulation {
    Cpu(Box<Simulation>),
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuSimulation>),
}

/// Steps after which a run can be watched and stopped.
#[cfg(feature = "gpu")]
pub(crate) const GPU_STEPS: u32 = 64;

/// Opens the shared device, or refuses a run that leaves too little memory to the driver. `processes` such runs begin
/// on this machine.
#[cfg(feature = "gpu")]
pub(crate) fn open_device(
    particles: u64,
    processes: u32,
    open: impl FnOnce() -> Result<GpuDevice, lazygrid::Error>,
) -> Result<GpuDevice, Error> {
    static IS_OPEN: Mutex<bool> = Mutex::new(false);
    let mut is_open = IS_OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    check_memory_on_gpu(particles, processes, *is_open)?;
    let device = open()
        .map_err(|error| Error::Detection(lazygrid::Error::GpuUnavailable { reason: error.to_string() }))?;
    *is_open = true;
    Ok(device)
}

impl AnySimulation {
    /// Begins a run, or resumes it from `state`. [`Backend::Auto`] is the CPU, because backends round differently.
    /// `algorithm` is for the CPU.
    ///
    /// # Errors
    /// See [`Simulation::resume`] or `GpuSimulation::resume`, [`Error::Detection`] without a GPU,
    /// [`Error::AlgorithmOnGpu`] for a named algorithm on a GPU, and [`Error::TooLittleMemory`] for the first release.
    pub fn begin(
        model: &Model,
        seed: u64,
        backend: Backend,
        algorithm: Algorithm,
        state: Option<State>,
    ) -> Result<Self, Error> {
        if backend == Backend::Gpu && algorithm != Algorithm::Auto {
            return Err(Error::AlgorithmOnGpu { algorithm });
        }
        if state.is_none() {
            check_largest_release(model, 0, Sharing::NONE)?;
        }
        let state = state.map_or_else(|| State::new(model, seed), Ok)?;
        let model = model.clone();
        if backend == Backend::Gpu {
            return Self::on_gpu(model, seed, &state);
        }
        Ok(Self::Cpu(Box::new(Simulation::resume(model, seed, algorithm, state)?)))
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(model: Model, seed: u64, state: &State) -> Result<Self, Error> {
        let shared = || GpuDevice::shared(SoftwareAdapter::Allow);
        let device = open_device(state.particles.len() as u64, 1, shared)?;
        let run = GpuSimulation::resume(model, seed, device, GpuOptions::default(), state)?;
        Ok(Self::Gpu(Box::new(run)))
    }

    #[cfg(not(feature = "gpu"))]
    fn on_gpu(_: Model, _: u64, _: &State) -> Result<Self, Error> {
        Err(lazygrid::Error::WithoutGpu.into())
    }

    /// Returns `true` if `backend` can log arrivals. A GPU limits the pairs of a receiver and a species.
    #[cfg_attr(not(feature = "gpu"), expect(unused_variables, reason = "only a GPU has a limit"))]
    pub fn can_log_arrivals(model: &Model, backend: Backend) -> bool {
        #[cfg(feature = "gpu")]
        if backend == Backend::Gpu {
            return crate::gpu::can_log_arrivals(model);
        }
        true
    }

    pub(crate) fn steps_at_once(&self) -> u32 {
        match self {
            Self::Cpu(_) => 1,
            #[cfg(feature = "gpu")]
            Self::Gpu(_) => GPU_STEPS,
        }
    }

    /// Does up to `max_steps` steps: one on the CPU, several on a GPU.
    ///
    /// # Errors
    /// See [`Simulation::step`] or `GpuSimulation::run`.
    #[cfg_attr(not(feature = "gpu"), expect(unused_variables, reason = "only a GPU does several"))]
    pub fn advance(&mut self, max_steps: u32) -> Result<(), Error> {
        match self {
            Self::Cpu(run) => run.step(),
            #[cfg(feature = "gpu")]
            Self::Gpu(run) => run.run(max_steps.min(GPU_STEPS)),
        }
    }

    pub(crate) fn request_warnings(&self) -> Vec<String> {
        match self {
            Self::Cpu(run) => run.requests.warnings(&run.model),
            #[cfg(feature = "gpu")]
            Self::Gpu(run) => run.requests().warnings(run.model()),
        }
    }

    pub fn seed(&self) -> u64 {
        match self {
            Self::Cpu(run) => run.key.seed(),
            #[cfg(feature = "gpu")]
            Self::Gpu(run) => run.seed(),
        }
    }

    pub fn backend(&self) -> Backend {
        match self {
            Self::Cpu(_) => Backend::Cpu,
            #[cfg(feature = "gpu")]
            Self::Gpu(_) => Backend::Gpu,
        }
    }

    fn view(&self) -> &dyn RunView {
        match self {
            Self::Cpu(run) => &**run,
            #[cfg(feature = "gpu")]
            Self::Gpu(run) => &**run,
        }
    }
}

impl RunView for AnySimulation {
    fn model(&self) -> &Model {
        self.view().model()
    }

    fn step_count(&self) -> u32 {
        self.view().step_count()
    }

    fn totals(&self) -> &Totals {
        self.view().totals()
    }

    fn received(&self) -> Vec<Vec<u64>> {
        self.view().received()
    }

    fn arrivals(&self) -> &[Arrival] {
        self.view().arrivals()
    }

    fn state(&self) -> Result<Cow<'_, State>, Error> {
        self.view().state()
    }
}

impl RunView for Simulation {
    fn model(&self) -> &Model {
        &self.model
    }

    fn step_count(&self) -> u32 {
        self.state.step
    }

    fn totals(&self) -> &Totals {
        &self.state.totals
    }

    fn received(&self) -> Vec<Vec<u64>> {
        self.received()
    }

    fn arrivals(&self) -> &[Arrival] {
        self.arrivals()
    }

    fn state(&self) -> Result<Cow<'_, State>, Error> {
        Ok(Cow::Borrowed(&self.state))
    }
}

#[cfg(feature = "gpu")]
impl RunView for GpuSimulation {
    fn model(&self) -> &Model {
        self.model()
    }

    fn step_count(&self) -> u32 {
        self.step_count()
    }

    fn totals(&self) -> &Totals {
        self.totals()
    }

    fn received(&self) -> Vec<Vec<u64>> {
        self.received()
    }

    fn arrivals(&self) -> &[Arrival] {
        self.arrivals()
    }

    fn state(&self) -> Result<Cow<'_, State>, Error> {
        self.state().map(Cow::Owned)
    }
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use super::*;
    use crate::{Receiver, Species};

    #[test]
    fn gpu_logs_arrivals_of_pairs_that_it_can_name() {
        let model = |count: usize| Model {
            species: vec![Species::default(); count],
            receivers: vec![Receiver::default(); count],
            ..Model::default()
        };
        let can_log = |count: usize| {
            [Backend::Cpu, Backend::Gpu]
                .map(|backend| AnySimulation::can_log_arrivals(&model(count), backend))
        };
        // The squares are 8,386,816 and 8,392,609.
        assert_eq!([can_log(2896), can_log(2897)], [[true, true], [true, false]]);
    }
}
