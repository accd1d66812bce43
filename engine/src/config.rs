use std::sync::Arc;
use std::sync::atomic::AtomicBool;
#[cfg(feature = "gpu")]
use std::{ops::RangeInclusive, time::Duration};

use lazygrid_host::{Settings, Simd};
use lazygrid_kernels::{Algorithm, Backend, Interactions, Space};

#[cfg(feature = "gpu")]
use crate::gpu::costs::Calibration;
#[cfg(feature = "gpu")]
use crate::gpu::device::{AdapterId, GpuDevice, SoftwareAdapter};
#[cfg(feature = "gpu")]
use crate::{Error, choice};
use crate::{Order, Skin};

/// The configuration of a [`Detector`](crate::Detector). The defaults suit almost all programs.
///
/// ```
/// # use lazygrid::{Algorithm, Config, Order};
/// let config = Config::default().algorithm(Algorithm::RecursiveGrid).tau(64).order(Order::Unordered);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Config {
    pub(crate) backend: Backend,
    #[cfg(feature = "gpu")]
    pub(crate) adapter: Option<AdapterId>,
    pub(crate) settings: Settings,
    /// `None` selects the backend's default, as for `cell_ratio`.
    #[cfg(feature = "gpu")]
    pub(crate) tau: Option<u32>,
    #[cfg(feature = "gpu")]
    pub(crate) cell_ratio: Option<f32>,
    #[cfg(feature = "gpu")]
    pub(crate) calibrations: Vec<Calibration>,
    #[cfg(feature = "gpu")]
    pub(crate) timeout: Option<Duration>,
}

impl Config {
    #[cfg(feature = "gpu")]
    pub(crate) const CELL_RATIOS: RangeInclusive<f32> = 0.5..=16.0;

    /// Backend to run on. Default: [`Backend::Auto`].
    pub fn backend(mut self, backend: Backend) -> Self {
        self.backend = backend;
        self
    }

    /// Selects a GPU, also a software adapter, by [index or name](AdapterId). [`Backend::Auto`] then means
    /// [`Backend::Gpu`]; [`Backend::Cpu`] is an error. Default: the best adapter, discrete before integrated.
    #[cfg(feature = "gpu")]
    pub fn adapter(mut self, adapter: impl Into<AdapterId>) -> Self {
        self.adapter = Some(adapter.into());
        self
    }

    /// Returns `true` if a detector runs on a GPU or not at all: with [`Backend::Gpu`] or a named
    /// [adapter](AdapterId).
    pub fn requires_gpu(&self) -> bool {
        #[cfg(feature = "gpu")]
        let resolved = choice::resolve_backend(self.backend, self.adapter.as_ref());
        #[cfg(not(feature = "gpu"))]
        let resolved = Ok::<_, crate::Error>(self.backend);
        resolved == Ok(Backend::Gpu)
    }

    /// Returns the process's shared device for the named adapter, else for the best adapter that `software` permits.
    ///
    /// # Errors
    /// See [`GpuDevice::open`] and [`GpuDevice::open_adapter`].
    #[cfg(feature = "gpu")]
    pub fn shared_device(&self, software: SoftwareAdapter) -> Result<GpuDevice, Error> {
        self.adapter.as_ref().map_or_else(|| GpuDevice::shared(software), GpuDevice::shared_adapter)
    }

    /// Algorithm. Default: [`Algorithm::Auto`], chosen per call.
    pub fn algorithm(mut self, algorithm: Algorithm) -> Self {
        self.settings.algorithm = algorithm;
        self
    }

    /// Adds GPU measurements, by which `Auto` chooses; the last one of an adapter applies. Default: none; crossover and
    /// costs are assumed.
    #[cfg(feature = "gpu")]
    pub fn calibration(mut self, measured: impl IntoIterator<Item = Calibration>) -> Self {
        self.calibrations.extend(measured);
        self
    }

    /// Order of results. Default: [`Order::Canonical`].
    pub fn order(mut self, order: Order) -> Self {
        self.settings.order = order;
        self
    }

    /// Number of CPU threads, in the detector's own pool. Default: the rayon pool of the caller.
    pub fn threads(mut self, threads: usize) -> Self {
        self.settings.threads = Some(threads);
        self
    }

    /// The widest vector instructions of CPU searches. Default: the widest available.
    pub fn simd(mut self, simd: Simd) -> Self {
        self.settings.simd = simd;
        self
    }

    /// τ: [`RecursiveGrid`](Algorithm::RecursiveGrid) and [`LazyGrid`](Algorithm::LazyGrid) refine cells with more than
    /// τ smaller spheres (paper, section 3.2). Default: [`Settings::TAU`] on the CPU,
    /// [`GpuConfig::TAU`](crate::gpu::GpuConfig::TAU) on the GPU.
    pub fn tau(mut self, tau: u32) -> Self {
        #[cfg(feature = "gpu")]
        {
            self.tau = Some(tau);
        }
        self.settings.tau = tau;
        self
    }

    /// Cell size as a multiple of the largest diameter, 0.5 to 16; the GPU raises values below 1.5 to 1.5. Only the
    /// paper's grids use it, not [`Naive`](Algorithm::Naive), [`CellList`](Algorithm::CellList) and
    /// [`Auto`](Algorithm::Auto). Default: [`Settings::CELL_RATIO`] on the CPU,
    /// [`GpuConfig::CELL_RATIO`](crate::gpu::GpuConfig::CELL_RATIO) on the GPU.
    pub fn cell_ratio(mut self, ratio: f32) -> Self {
        #[cfg(feature = "gpu")]
        {
            self.cell_ratio = Some(ratio);
        }
        self.settings.cell_ratio = ratio;
        self
    }

    /// Maximum number of pairs in a list; [`Error::TooManyPairs`](crate::Error::TooManyPairs) has the exact number.
    /// Default: 2²⁹ (4 GiB).
    pub fn max_pairs(mut self, max_pairs: u64) -> Self {
        self.settings.max_pairs = max_pairs;
        self
    }

    /// Sets the species that pair, and their distances. Spheres then need species ids. Default: all touching spheres
    /// pair.
    pub fn interactions(mut self, interactions: impl Into<Option<Interactions>>) -> Self {
        self.settings.interactions = interactions.into();
        self
    }

    /// Sets a flag, for example for Ctrl-C. While it is `true`, CPU searches and neighbor lists with geometry return
    /// [`Error::Cancelled`](crate::Error::Cancelled) within milliseconds, except during sorting. GPU searches have a
    /// [`timeout`](Self::timeout). Default: none.
    pub fn cancel_flag(mut self, flag: Arc<AtomicBool>) -> Self {
        self.settings.stop = Some(flag);
        self
    }

    /// Time limit of each submission to the GPU, after which the call returns
    /// [`Error::Timeout`](crate::Error::Timeout). A call that is split or repeated has several submissions. The CPU
    /// has a [`cancel_flag`](Self::cancel_flag) instead: [`Backend::Cpu`] with a timeout is an error, and if
    /// [`Backend::Auto`] finds no GPU, the reason in the report says so. Default: ten minutes.
    #[cfg(feature = "gpu")]
    pub fn timeout(mut self, timeout: Duration) -> Self {
        self.timeout = Some(timeout);
        self
    }

    /// Sets the skin of the candidate list (Verlet list) kept between calls. Results do not change. Default:
    /// [`Skin::Auto`], on the GPU by the costs of the [`calibration`](Self::calibration).
    pub fn skin(mut self, skin: Skin) -> Self {
        self.settings.skin = skin;
        self
    }

    /// Sets the space of the spheres. Default: [`Space::UNBOUNDED`]. On the GPU, pairs within 4 ulp of tangency
    /// (relative to the squared cutoff; 5 ulp in a periodic space) may fall either way, except in a triclinic
    /// space, where the host decides and a count reads back all candidates.
    pub fn space(mut self, space: Space) -> Self {
        self.settings.space = space;
        self
    }
}
