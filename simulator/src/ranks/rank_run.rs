use lazygrid::{Backend, Config};
use lazygrid_ranks::Communicator;

use super::agree;
use super::cpu_run::CpuRun;
#[cfg(feature = "gpu")]
use super::gpu_run::GpuRun;
use crate::state::RankStart;
use crate::{Contact, Error, Model, RunView, State, Totals};

#[derive(Debug)]
pub(super) enum RankRun {
    Cpu(Box<CpuRun>),
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuRun>),
}

impl RankRun {
    #[cfg(feature = "gpu")]
    pub(super) fn on_gpu(
        model: Model,
        detector: &Config,
        start: RankStart<'_>,
        ranks_on_machine: u32,
    ) -> Result<Self, Error> {
        GpuRun::new(model, detector, start, ranks_on_machine).map(Box::new).map(Self::Gpu)
    }

    #[cfg(not(feature = "gpu"))]
    pub(super) fn on_gpu(_: Model, _: &Config, _: RankStart<'_>, _: u32) -> Result<Self, Error> {
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

    pub(super) fn steps_at_once(&self) -> u32 {
        match self {
            Self::Cpu(_) => 1,
            #[cfg(feature = "gpu")]
            Self::Gpu(run) => run.steps_at_once(),
        }
    }

    /// Returns the state, of which only the counts differ between ranks.
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

/// Returns `true` if the particles of all ranks move on GPUs. Backends do not mix: they round differently, and a
/// checkpoint names one. Collective.
pub(super) fn moves_on_gpus<C: Communicator>(communicator: &mut C, model: &Model, detector: &Config) -> bool {
    let ranks = u64::from(communicator.ranks());
    let asking = communicator.all_reduce_sum(&[detector.requires_gpu().into()])[0];
    let obstacle = match asking {
        0 => return false,
        asking if asking < ranks => Some(format!("{} of {ranks} ranks use no GPU", ranks - asking)),
        _ => obstacle(model),
    };
    if let Some(obstacle) = &obstacle {
        log_obstacle(communicator, log::Level::Info, obstacle);
    }
    obstacle.is_none()
}

fn log_obstacle<C: Communicator>(communicator: &C, level: log::Level, obstacle: &str) {
    if communicator.rank() == 0 {
        log::log!(level, "particles move on the CPU, and GPUs find their pairs at the most: {obstacle}");
    }
}

/// Returns `None` on all ranks if the model exceeds the device of one. Collective.
///
/// # Errors
/// Every rank returns any other error of one.
pub(super) fn agree_on_gpus<C: Communicator>(
    communicator: &mut C,
    run: Result<RankRun, Error>,
) -> Result<Option<RankRun>, C::Error> {
    let mut obstacle = String::new();
    let run = match run {
        Err(error) if is_beyond_device(&error) => {
            obstacle = error.to_string();
            Ok(None)
        }
        run => run.map(Some),
    };
    let run = agree(communicator, run)?;
    let (obstacles, lengths) = communicator.all_gather("limits of GPUs", obstacle.as_bytes())?;
    let Some(rank) = lengths.iter().position(|&length| length > 0) else { return Ok(run) };
    let obstacle = String::from_utf8_lossy(&obstacles[..lengths[rank]]);
    log_obstacle(communicator, log::Level::Warn, &format!("rank {rank}: {obstacle}"));
    Ok(None)
}

fn is_beyond_device(error: &Error) -> bool {
    matches!(error, Error::NotOnGpu { .. } | Error::Detection(lazygrid::Error::LimitExceeded { .. }))
}

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

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use lazygrid::gpu::{GpuDevice, wgpu};
    use lazygrid_ranks::threads;

    use super::*;
    use crate::gpu::{GpuOptions, GpuSimulation, device, limited};
    use crate::motion::request_counts::RequestCounts;
    use crate::release::rank_slice::RankSlice;
    use crate::{Receiver, ReceiverKind, Species, Transmitter};

    fn model() -> Model {
        let mirror =
            Receiver { radius: 1.0, kind: ReceiverKind::Reflecting, sees: vec![true], ..Receiver::default() };
        Model {
            time_step: 0.01,
            species: vec![Species { diffusion: 1.0, ..Species::default() }],
            transmitters: vec![Transmitter {
                center: [2.0; 3],
                release: vec![(0, 100)],
                ..Transmitter::default()
            }],
            receivers: vec![mirror],
            ..Model::default()
        }
    }

    fn run_on(device: GpuDevice, slice: RankSlice) -> Result<RankRun, Error> {
        let (model, options) = (model(), GpuOptions::default());
        let state = State::new_slice(&model, 1, slice)?;
        let simulation =
            GpuSimulation::resume_slice(model, device, options, RankStart { seed: 1, state: &state, slice })?;
        Ok(RankRun::Gpu(Box::new(GpuRun { simulation, requests: RequestCounts::default() })))
    }

    #[test]
    fn ranks_use_no_gpu_if_the_model_exceeds_the_device_of_one() {
        let Some(gpu) = device() else { return };
        let few_buffers = |limits| wgpu::Limits { max_storage_buffers_per_shader_stage: 8, ..limits };
        let small_bindings = |limits| wgpu::Limits { max_storage_buffer_binding_size: 1 << 12, ..limits };
        let few = [limited(&gpu, few_buffers), limited(&gpu, small_bindings)];
        let backends = |devices: [&GpuDevice; 3]| {
            threads::on(3, |mut thread| {
                let slice = RankSlice::new(thread.rank(), 3);
                let run = run_on(devices[thread.rank() as usize].clone(), slice);
                agree_on_gpus(&mut thread, run).map(|run| run.map(|run| run.backend()))
            })
        };
        assert_eq!(backends([&gpu; 3]), vec![Ok(Some(Backend::Gpu)); 3]);
        for few in &few {
            assert_eq!(backends([&gpu, few, few]), vec![Ok(None); 3]);
        }
    }

    #[test]
    fn other_failure_of_one_gpu_is_returned_on_all_ranks() {
        let failed = threads::on(2, |mut thread| {
            let run = match thread.rank() {
                0 => Err(Error::NotOnGpu { what: "a model".to_owned() }),
                _ => Err(Error::Model("another failure".to_owned())),
            };
            agree_on_gpus(&mut thread, run).map(|run| run.is_some())
        });
        assert_eq!(failed, vec![Err("rank 1: another failure".to_owned()); 2]);
    }
}
