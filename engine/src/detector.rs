use std::ops::ControlFlow;

use lazygrid_host::{HostDetector, Neighbors};
use lazygrid_kernels::{Algorithm, Pair, Spheres};

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
    host: HostDetector,
    backend_reason: String,
}

impl Detector {
    /// A detector with these settings. The backend is decided here, once, and logged.
    ///
    /// # Errors
    /// [`Error::GpuUnavailable`] where the GPU is asked for by name and cannot be used;
    /// [`Error::NotOnBackend`] where the algorithm does not run on the backend; [`Error::Host`] for a setting
    /// outside its range.
    pub fn new(config: Config) -> Result<Self, Error> {
        const NO_GPU: &str = "this version has no GPU engine";
        let algorithm = config.settings.algorithm;
        let gpu_only = matches!(algorithm, Algorithm::EagerGrid | Algorithm::LazyGrid);
        let backend_reason = match config.backend {
            Backend::Cpu if gpu_only => {
                return Err(Error::NotOnBackend { algorithm, backend: Backend::Cpu });
            }
            Backend::Auto if !gpu_only => format!("CPU: {NO_GPU}"),
            Backend::Cpu => "CPU: asked for".to_owned(),
            _ => return Err(Error::GpuUnavailable { reason: NO_GPU.to_owned() }),
        };
        log::info!("{backend_reason}");
        Ok(Self { host: HostDetector::new(config.settings)?, backend_reason })
    }

    /// The overlapping pairs, each once, in the order that was asked for. The slice lives until the next call.
    ///
    /// # Errors
    /// [`Error::Input`] for spheres that are not finite, negative radii or unknown species, naming the first;
    /// [`Error::Host`] for more pairs than [`Config::max_pairs`], with the exact number, or no memory.
    pub fn pairs<'a>(&mut self, spheres: impl Into<Spheres<'a>>) -> Result<&[Pair], Error> {
        Ok(self.host.pairs(spheres.into())?)
    }

    /// The pairs as neighbour lists: for every sphere all it overlaps, ascending, each pair in both lists.
    ///
    /// # Errors
    /// As [`pairs`](Self::pairs).
    pub fn neighbors<'a>(&mut self, spheres: impl Into<Spheres<'a>>) -> Result<Neighbors<'_>, Error> {
        Ok(self.host.neighbors(spheres.into())?)
    }

    /// How many pairs there are. Needs no memory for them, so any number can be counted.
    ///
    /// # Errors
    /// [`Error::Input`] as for [`pairs`](Self::pairs); [`Error::Host`] for no memory.
    pub fn count<'a>(&mut self, spheres: impl Into<Spheres<'a>>) -> Result<u64, Error> {
        Ok(self.host.count(spheres.into())?)
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
        Ok(self.host.stream(spheres.into(), chunk, consume)?)
    }

    /// What the last call did and why; before the first call, what is known by then.
    pub fn report(&self) -> Report {
        let host = self.host.report();
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
        self.host.memory_for(spheres)
    }

    /// The pairs of the last call of [`pairs`](Self::pairs), without a copy.
    pub fn into_pairs(self) -> Vec<Pair> {
        self.host.into_pairs()
    }
}
