use std::sync::Arc;
use std::sync::atomic::AtomicBool;
#[cfg(feature = "gpu")]
use std::{ops::RangeInclusive, time::Duration};

use lazygrid_host::{Settings, Simd};
use lazygrid_kernels::{Algorithm, Backend, Interactions, Space};

#[cfg(feature = "gpu")]
use crate::gpu::costs::Calibration;
#[cfg(feature = "gpu")]
use crate::gpu::device::AdapterId;
use crate::{Order, Skin};

/// The configuration of a [`Detector`](crate::Detector). The default suits almost all programs.
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
    #[cfg(feature = "gpu")]
    /// τ and cell ratio as requested; else each backend has its own.
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
    /// The valid values of [`cell_ratio`](Self::cell_ratio).
    pub(crate) const RASTER_RATIOS: RangeInclusive<f32> = 0.5..=16.0;

    /// The backend to run on. Default: [`Backend::Auto`].
    pub fn backend(mut self, backend: Backend) -> Self {
        self.backend = backend;
        self
    }

    /// Selects one of several GPUs: by its index among [`gpu::adapters`](crate::gpu::adapters), or by a part of its
    /// name that no other adapter has. Naming an adapter implies [`Backend::Gpu`] and permits a software adapter.
    /// Default: the best adapter, discrete before integrated.
    ///
    /// ```
    /// # use lazygrid::Config;
    /// let config = Config::default().adapter("nvidia");
    /// ```
    #[cfg(feature = "gpu")]
    pub fn adapter(mut self, adapter: impl Into<AdapterId>) -> Self {
        self.adapter = Some(adapter.into());
        self
    }

    /// The algorithm. Default: [`Algorithm::Auto`], chosen per call.
    pub fn algorithm(mut self, algorithm: Algorithm) -> Self {
        self.settings.algorithm = algorithm;
        self
    }

    /// Measurements of GPUs, by which `Auto` chooses. Those of other adapters are ignored; of several of one adapter
    /// the last counts. Default: none, and crossover and costs are assumed.
    #[cfg(feature = "gpu")]
    pub fn calibration(mut self, measured: impl IntoIterator<Item = Calibration>) -> Self {
        self.calibrations.extend(measured);
        self
    }

    /// The order of results. Default: [`Order::Canonical`].
    pub fn order(mut self, order: Order) -> Self {
        self.settings.order = order;
        self
    }

    /// Threads of the CPU path, in a pool of its own. Default: the rayon pool of the caller.
    pub fn threads(mut self, threads: usize) -> Self {
        self.settings.threads = Some(threads);
        self
    }

    /// The widest vector code of the CPU path, if the processor has it. Default: the widest.
    pub fn simd(mut self, simd: Simd) -> Self {
        self.settings.simd = simd;
        self
    }

    /// τ: the number of smaller spheres above which a cell is refined (paper, section 3.2). Default: [`Settings::TAU`]
    /// on the CPU, [`GpuConfig::TAU`](crate::gpu::GpuConfig::TAU) on the GPU, from measured sweeps.
    pub fn tau(mut self, tau: u32) -> Self {
        #[cfg(feature = "gpu")]
        {
            self.tau = Some(tau);
        }
        self.settings.tau = tau;
        self
    }

    /// Cell size of the paper's grids as a multiple of the largest diameter, 0.5 to 16; the GPU raises values below 1.5
    /// to 1.5. Default: [`Settings::CELL_RATIO`] on the CPU,
    /// [`GpuConfig::CELL_RATIO`](crate::gpu::GpuConfig::CELL_RATIO) on the GPU, from measured sweeps.
    pub fn cell_ratio(mut self, ratio: f32) -> Self {
        #[cfg(feature = "gpu")]
        {
            self.cell_ratio = Some(ratio);
        }
        self.settings.cell_ratio = ratio;
        self
    }

    /// The most pairs a list may hold; more give an error with the exact number. Default: 2²⁹ (4 GiB).
    /// Counting and streaming have no limit.
    pub fn max_pairs(mut self, max_pairs: u64) -> Self {
        self.settings.max_pairs = max_pairs;
        self
    }

    /// Sets the table of interactions: the species that pair, and their distances. Spheres must then carry species ids.
    /// `None` removes a table. Default: none, and all spheres that touch pair.
    pub fn interactions(mut self, interactions: impl Into<Option<Interactions>>) -> Self {
        self.settings.interactions = interactions.into();
        self
    }

    /// Sets a flag that cancels searches on the CPU, such as for Ctrl-C. While it is true, searches return
    /// [`Error::Cancelled`](crate::Error::Cancelled) within milliseconds, except while spheres are sorted or pairs are
    /// put in order. A call on a GPU ends by itself or by its [`timeout`](Self::timeout). Default: none.
    pub fn cancel_flag(mut self, flag: Arc<AtomicBool>) -> Self {
        self.settings.stop = Some(flag);
        self
    }

    /// The time limit of a call on the GPU, after which it fails with
    /// [`Error::Timeout`](crate::Error::Timeout). Default: ten minutes.
    #[cfg(feature = "gpu")]
    pub fn timeout(mut self, timeout: Duration) -> Self {
        self.timeout = Some(timeout);
        self
    }

    /// Sets whether the detector keeps a candidate list from call to call, which pays if spheres move little and never
    /// changes an answer. Default: [`Skin::Auto`]. On the GPU the list stays there, and [`Skin::Auto`] uses the costs
    /// of the adapter; see [`calibration`](Self::calibration).
    ///
    /// ```
    /// # use lazygrid::{Config, Skin};
    /// let config = Config::default().skin(Skin::Off);
    /// ```
    pub fn skin(mut self, skin: Skin) -> Self {
        self.settings.skin = skin;
        self
    }

    /// Sets the space of the spheres. Default: [`Space::UNBOUNDED`]. The GPU decides pairs within 4 ulp of exact
    /// tangency either way, relative to the squared distance at which they pair, and within 5 ulp in a periodic space.
    /// In a triclinic space the host decides in `f64`, and a count reads all candidates back.
    pub fn space(mut self, space: Space) -> Self {
        self.settings.space = space;
        self
    }
}
