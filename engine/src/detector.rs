use std::ops::ControlFlow;

use lazygrid_host::{HostDetector, Neighbors, Settings};
use lazygrid_kernels::{Algorithm, Pair, Spheres};

use crate::gpu::{self, DeviceDetector, GpuDevice};
use crate::{Backend, Config, Error, Report};

/// All pairs of overlapping spheres, in canonical order, with default settings.
///
/// For more than one call keep a [`Detector`].
///
/// # Errors
/// As [`Detector::pairs`].
pub fn detect<'a>(spheres: impl Into<Spheres<'a>>) -> Result<Vec<Pair>, Error> {
    let mut detector = Detector::new(Config::default())?;
    detector.pairs(spheres)?;
    Ok(detector.into_pairs())
}

/// Finds overlapping pairs, call after call, reusing its buffers: after the first call of a size nothing of
/// the size of the input is allocated.
#[derive(Debug)]
pub struct Detector {
    engine: Engine,
    backend_reason: String,
}

#[derive(Debug)]
enum Engine {
    Host(Box<HostDetector>),
    Device(Box<DeviceDetector>),
}

impl Detector {
    /// A detector with these settings. The backend is decided here, once, and logged.
    ///
    /// # Errors
    /// [`Error::GpuUnavailable`] where the GPU is asked for by name and cannot be used;
    /// [`Error::NotOnBackend`] where the algorithm does not run on the backend; [`Error::PeriodicOnGpu`] where the GPU
    /// is asked for by name in a periodic space; [`Error::Host`] and
    /// [`Error::Gpu`] for a setting outside its range.
    pub fn new(config: Config) -> Result<Self, Error> {
        let settings = config.settings;
        let (own, backend_reason) = choose(config.backend, &settings)?;
        log::info!("{backend_reason}");
        let engine = match own {
            Some(own) => {
                let device = DeviceDetector::new(own, settings, backend_reason.clone())?;
                Engine::Device(Box::new(device))
            }
            None => Engine::Host(Box::new(HostDetector::new(settings)?)),
        };
        Ok(Self { engine, backend_reason })
    }

    /// The overlapping pairs, each once, in the order that was asked for. The slice lives until the next call.
    ///
    /// # Errors
    /// [`Error::Input`] for spheres that are not finite, negative radii or unknown species, naming the first;
    /// [`Error::Host`] for more pairs than [`Config::max_pairs`], with the exact number, or no memory.
    pub fn pairs<'a>(&mut self, spheres: impl Into<Spheres<'a>>) -> Result<&[Pair], Error> {
        match &mut self.engine {
            Engine::Host(host) => Ok(host.pairs(spheres.into())?),
            Engine::Device(device) => device.pairs(spheres.into()),
        }
    }

    /// The pairs as neighbour lists: for every sphere all it overlaps, ascending, each pair in both lists.
    ///
    /// # Errors
    /// As [`pairs`](Self::pairs).
    pub fn neighbors<'a>(&mut self, spheres: impl Into<Spheres<'a>>) -> Result<Neighbors<'_>, Error> {
        match &mut self.engine {
            Engine::Host(host) => Ok(host.neighbors(spheres.into())?),
            Engine::Device(device) => device.neighbors(spheres.into()),
        }
    }

    /// How many pairs there are. Needs no memory for them, so any number can be counted.
    ///
    /// # Errors
    /// [`Error::Input`] as for [`pairs`](Self::pairs); [`Error::Host`] for no memory.
    pub fn count<'a>(&mut self, spheres: impl Into<Spheres<'a>>) -> Result<u64, Error> {
        match &mut self.engine {
            Engine::Host(host) => Ok(host.count(spheres.into())?),
            Engine::Device(device) => device.count(spheres.into()),
        }
    }

    /// Hands the pairs to `consume` in chunks of at most `chunk` pairs, and returns how many were handed over.
    /// Memory stays bounded whatever their number. `consume` may stop the search with `ControlFlow::Break`.
    ///
    /// In canonical order the stream is canonical as a whole; a result of more than [`Config::max_pairs`] pairs
    /// then costs one further search per that many pairs. Unordered chunks come as they are found, from
    /// whichever thread, one at a time.
    ///
    /// # Errors
    /// As [`count`](Self::count).
    pub fn stream<'a, F>(
        &mut self,
        spheres: impl Into<Spheres<'a>>,
        chunk: usize,
        consume: F,
    ) -> Result<u64, Error>
    where
        F: FnMut(&[Pair]) -> ControlFlow<()> + Send,
    {
        match &mut self.engine {
            Engine::Host(host) => Ok(host.stream(spheres.into(), chunk, consume)?),
            Engine::Device(device) => device.stream(spheres.into(), chunk, consume),
        }
    }

    /// What the last call did and why; before the first call, what is known by then.
    pub fn report(&self) -> Report {
        let host = match &self.engine {
            Engine::Host(host) => host.report(),
            Engine::Device(device) => return device.report().clone(),
        };
        let reason = match host.reason.as_str() {
            "" => self.backend_reason.clone(),
            reason => format!("{}; {reason}", self.backend_reason),
        };
        Report {
            spheres: host.spheres,
            pairs: host.pairs,
            backend: Backend::Cpu,
            adapter: None,
            algorithm: host.algorithm,
            reason,
            phases: host.phases.clone(),
        }
    }

    /// An upper estimate of the bytes this detector holds for `spheres` spheres, besides the result.
    pub fn memory_for(&self, spheres: u64) -> u64 {
        match &self.engine {
            Engine::Host(host) => host.memory_for(spheres),
            Engine::Device(device) => device.memory_for(spheres),
        }
    }

    /// The pairs of the last call of [`pairs`](Self::pairs), without a copy.
    pub fn into_pairs(self) -> Vec<Pair> {
        match self.engine {
            Engine::Host(host) => host.into_pairs(),
            Engine::Device(device) => device.into_pairs(),
        }
    }
}

/// The device to run on, or none for the CPU, and why.
fn choose(backend: Backend, settings: &Settings) -> Result<(Option<GpuDevice>, String), Error> {
    let (algorithm, periodic) = (settings.algorithm, settings.space.is_periodic());
    let needs_gpu = matches!(algorithm, Algorithm::EagerGrid | Algorithm::LazyGrid);
    let on_gpu = matches!(algorithm, Algorithm::Auto | Algorithm::Naive | Algorithm::ArrayGrid);
    let unavailable = |error: gpu::GpuError| Error::GpuUnavailable { reason: error.to_string() };
    match backend {
        Backend::Cpu if needs_gpu => Err(Error::NotOnBackend { algorithm, backend }),
        Backend::Cpu => Ok((None, "CPU: asked for".to_owned())),
        _ if needs_gpu => {
            Err(Error::GpuUnavailable { reason: format!("this version has no kernels for {algorithm}") })
        }
        Backend::Gpu if !on_gpu => Err(Error::NotOnBackend { algorithm, backend }),
        Backend::Gpu if periodic => Err(Error::PeriodicOnGpu),
        Backend::Gpu => {
            let own = GpuDevice::shared(true).map_err(unavailable)?;
            let reason = format!("GPU {}: asked for", own.adapter.name);
            Ok((Some(own), reason))
        }
        Backend::Auto if !on_gpu => Ok((None, format!("CPU: {algorithm} runs there only"))),
        Backend::Auto if periodic => Ok((None, "CPU: periodic spaces run there only".to_owned())),
        Backend::Auto => Ok(match GpuDevice::shared(false) {
            Ok(own) => {
                let reason = format!("GPU {}: a real GPU", own.adapter.name);
                (Some(own), reason)
            }
            Err(error) => (None, format!("CPU: {error}")),
        }),
    }
}
