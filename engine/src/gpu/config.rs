//! The configuration of GPU detectors.

use lazygrid_kernels::kernel::WORKGROUP_SIZE;
use lazygrid_kernels::layout::ColumnLayout;
use lazygrid_kernels::{Algorithm, Interactions, Space};

use super::costs::{Calibration, Crossover};
#[cfg(doc)]
use super::{GpuDetector, GpuSpheres, Outcome};
use crate::Error;

/// The configuration of a [`GpuDetector`].
#[derive(Clone, Debug)]
pub struct GpuConfig {
    pub(crate) algorithm: Algorithm,
    pub(crate) crossover: Crossover,
    pub(crate) pair_capacity: u32,
    pub(crate) cell_ratio: f32,
    pub(crate) tau: u32,
    pub(crate) radix_sort_from: u32,
    pub(crate) interactions: Option<Interactions>,
    pub(crate) space: Space,
    pub(crate) columns: Option<ColumnLayout>,
    pub(crate) consumer_workgroup_size: u32,
    pub(crate) pairs_in_cell_order: bool,
    pub(crate) subgroups: bool,
    pub(crate) timestamps: bool,
    pub(crate) max_tests_per_dispatch: Option<u64>,
    pub(crate) deferred_parts: u32,
}

impl GpuConfig {
    /// `Auto` or one of [`Algorithm::GPU`]. Default: `Auto`, decided by the number of spheres that a call may have.
    pub fn algorithm(self, algorithm: Algorithm) -> Self {
        Self { algorithm, ..self }
    }

    /// The number of spheres below which `Auto` tests all pairs; see [`calibrate`](super::calibrate). Radii that are on the
    /// GPU count as one size class. Default: [`Crossover::HARDWARE`].
    pub fn crossover(self, crossover: Crossover) -> Self {
        Self { crossover, ..self }
    }

    /// Pairs that the output buffer holds. Default: 2²⁰ (8 MiB). More are counted but not written.
    pub fn pair_capacity(self, pair_capacity: u32) -> Self {
        Self { pair_capacity, ..self }
    }

    /// Cell size as a multiple of the largest diameter, 1.5 to 16. Default: [`GpuConfig::CELL_RATIO`].
    pub fn cell_ratio(self, cell_ratio: f32) -> Self {
        Self { cell_ratio, ..self }
    }

    /// τ: in LazyGrid the smaller spheres of a cell go to a finer level only if they are more than this (Stroobant
    /// et al., section 3.2). Default: [`GpuConfig::TAU`].
    pub fn tau(self, tau: u32) -> Self {
        Self { tau, ..self }
    }

    /// The number of spheres at or above which a cell list is sorted by radix instead of by counting. Default:
    /// [`Calibration::RADIX_SORT_FROM`]; [`calibrate`](super::calibrate) measures it.
    pub fn radix_sort_from(self, radix_sort_from: u32) -> Self {
        Self { radix_sort_from, ..self }
    }

    /// The species that pair, with their distances, which are rounded to `f32` as all numbers on the GPU. Default: none, all
    /// spheres that touch are pairs.
    pub fn interactions(self, interactions: impl Into<Option<Interactions>>) -> Self {
        Self { interactions: interactions.into(), ..self }
    }

    /// The space of the spheres, not [triclinic](Space::triclinic). Its lengths are rounded to `f32`. Default:
    /// [`Space::UNBOUNDED`]. In a periodic space spheres are first wrapped into a copy, 16 bytes each; pairs within 5
    /// ulp of exact tangency, relative to the squared cutoff, may fall either way. In unbounded space it is 4 ulp.
    pub fn space(self, space: Space) -> Self {
        Self { space, ..self }
    }

    /// The layout of spheres in four arrays of `f32`, which calls then pass as [`GpuSpheres::from_columns`]. They are first
    /// copied to rows, in one more dispatch and 16 bytes per sphere. A [`GpuSession`](super::GpuSession) does without.
    /// Default: `None`, rows of `x, y, z, r`.
    pub fn columns(self, columns: impl Into<Option<ColumnLayout>>) -> Self {
        Self { columns: columns.into(), ..self }
    }

    /// Threads per workgroup of the consumer that is dispatched indirectly. Default: 256.
    pub fn consumer_workgroup_size(self, consumer_workgroup_size: u32) -> Self {
        Self { consumer_workgroup_size, ..self }
    }

    /// Sets whether pairs of the cell list hold positions in the order of its cells ([`CellOrder`](super::CellOrder))
    /// instead of input indices, for consumers of the sorted spheres. [`Outcome::pairs_in_cell_order`] reports which,
    /// as other algorithms have no such order. Windows always use input indices, and so does a
    /// [`GpuSession`](super::GpuSession). Default: no.
    pub fn pairs_in_cell_order(self, pairs_in_cell_order: bool) -> Self {
        Self { pairs_in_cell_order, ..self }
    }

    /// Sets whether subgroup operations are used if the device was made with them. Default: yes.
    pub fn subgroups(self, subgroups: bool) -> Self {
        Self { subgroups, ..self }
    }

    /// Sets whether phases are timed if the device was made with timestamp queries. A call is one pass if the device writes
    /// timestamps inside passes ([`optional_features`](super::optional_features)); otherwise each phase has a pass of its
    /// own, which costs some microseconds. Default: no.
    pub fn timestamps(self, timestamps: bool) -> Self {
        Self { timestamps, ..self }
    }

    /// Sets the largest number of distance tests of one dispatch, so that no driver's watchdog ends it. A longer search
    /// is divided into several dispatches ([`CallCost::parts`](super::CallCost::parts)). Default: the tests of 200 ms, at
    /// 2.5·10¹⁰ tests/s for a GPU with memory of its own, 2.5·10⁹ for one without and 5·10⁸ for a software adapter; no
    /// GPU has confirmed these rates. A [`Detector`](crate::Detector) uses the measured rate if it has a
    /// [`Calibration`].
    pub fn max_tests_per_dispatch(self, tests: u64) -> Self {
        Self { max_tests_per_dispatch: Some(tests), ..self }
    }

    /// Sets the number of recorded parts of the search of crowded cells. The size of this search is known to the device
    /// only. If it exceeds [`max_tests_per_dispatch`](Self::max_tests_per_dispatch) in each recorded part, the outcome
    /// has [`Outcome::OVERFLOW_WORK`]. Parts without work cost some microseconds each. Default: 1. A
    /// [`GpuSession`](super::GpuSession) records further parts by itself.
    pub fn deferred_parts(self, parts: u32) -> Self {
        Self { deferred_parts: parts, ..self }
    }
}

impl GpuConfig {
    /// The default of τ. On Mesa's llvmpipe, 100 000 spheres of five sizes take the same time at any τ of 32 or more,
    /// and a burst of ten sizes is fastest near 128 (`cargo bench -p lazygrid-bench --bench parameter_sweep --
    /// --backend gpu --what tau`). Other devices may differ.
    pub const TAU: u32 = 64;
    /// The default cell ratio: on llvmpipe the best for five sizes; for equal ones, 3 is better by a tenth.
    pub const CELL_RATIO: f32 = 2.0;
    /// The smallest cell ratio with which no sphere overlaps more than two cells per axis.
    pub const MIN_CELL_RATIO: f32 = 1.5;
    /// The largest cell ratio.
    pub const MAX_CELL_RATIO: f32 = 16.0;
}

impl Default for GpuConfig {
    fn default() -> Self {
        Self {
            algorithm: Algorithm::Auto,
            crossover: Crossover::HARDWARE,
            pair_capacity: 1 << 20,
            cell_ratio: Self::CELL_RATIO,
            tau: Self::TAU,
            radix_sort_from: Calibration::RADIX_SORT_FROM,
            interactions: None,
            space: Space::UNBOUNDED,
            columns: None,
            consumer_workgroup_size: WORKGROUP_SIZE,
            pairs_in_cell_order: false,
            subgroups: true,
            timestamps: false,
            max_tests_per_dispatch: None,
            deferred_parts: 1,
        }
    }
}

pub(in crate::gpu) fn check(settings: &GpuConfig) -> Result<(), Error> {
    if settings.space.triclinic_cell().is_some() {
        let range =
            "what stays on the GPU has edges along the axes only: choose `Detector`, which takes any edges";
        return Err(Error::InvalidSetting { name: "space", value: "sheared".into(), range });
    }
    if !(GpuConfig::MIN_CELL_RATIO..=GpuConfig::MAX_CELL_RATIO).contains(&settings.cell_ratio) {
        let value = settings.cell_ratio.to_string();
        let range = "on the GPU choose between 1.5 and 16";
        return Err(Error::InvalidSetting { name: "cell_ratio", value, range });
    }
    if settings.consumer_workgroup_size == 0 {
        let range = "choose the consumer's workgroup size";
        return Err(Error::InvalidSetting { name: "consumer_workgroup_size", value: "0".into(), range });
    }
    check_algorithm(settings.algorithm)
}

/// Rejects algorithms without kernels.
pub(in crate::gpu) fn check_algorithm(algorithm: Algorithm) -> Result<(), Error> {
    match algorithm {
        Algorithm::Auto => Ok(()),
        named if Algorithm::GPU.contains(&named) => Ok(()),
        other => Err(Error::NotOnBackend { algorithm: other, backend: crate::Backend::Gpu }),
    }
}
