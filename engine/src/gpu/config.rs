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
    /// The species of most spheres, if it is known.
    pub(crate) most_frequent: Option<u32>,
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
    /// `Auto` or one of [`Algorithm::GPU`]. Default: `Auto`, by the largest number of spheres of a call.
    pub fn algorithm(self, algorithm: Algorithm) -> Self {
        Self { algorithm, ..self }
    }

    /// Number of spheres below which `Auto` tests all pairs, for one size class, because radii in GPU buffers are
    /// unknown; [`calibrate`](super::calibrate) measures it. Default: [`Crossover::HARDWARE`].
    pub fn crossover(self, crossover: Crossover) -> Self {
        Self { crossover, ..self }
    }

    /// Capacity of the output; further pairs are counted but not written. Default: 2²⁰ (8 MiB).
    pub fn pair_capacity(self, pair_capacity: u32) -> Self {
        Self { pair_capacity, ..self }
    }

    /// Cell size as a multiple of the largest diameter, 1.5 to 16. Default: [`GpuConfig::CELL_RATIO`].
    pub fn cell_ratio(self, cell_ratio: f32) -> Self {
        Self { cell_ratio, ..self }
    }

    /// τ: LazyGrid refines cells with more than τ smaller spheres (Stroobant et al., section 3.2). Default:
    /// [`GpuConfig::TAU`].
    pub fn tau(self, tau: u32) -> Self {
        Self { tau, ..self }
    }

    /// Number of spheres at or above which a cell list is sorted by radix instead of by counting;
    /// [`calibrate`](super::calibrate) measures it. Default: [`Calibration::RADIX_SORT_FROM`].
    pub fn radix_sort_from(self, radix_sort_from: u32) -> Self {
        Self { radix_sort_from, ..self }
    }

    /// Species that pair, and their distances, rounded to `f32`. Default: all touching spheres pair.
    pub fn interactions(self, interactions: impl Into<Option<Interactions>>) -> Self {
        Self { interactions: interactions.into(), ..self }
    }

    /// Space of the spheres, not [triclinic](Space::triclinic), with lengths rounded to `f32`. Default:
    /// [`Space::UNBOUNDED`]. For the paper's grids and all pairs, a periodic space costs a copy, 16 bytes per sphere.
    /// Pairs within 5 ulp of tangency (4 in unbounded space), relative to the squared cutoff, may fall either way.
    pub fn space(self, space: Space) -> Self {
        Self { space, ..self }
    }

    /// Layout of spheres in four `f32` arrays ([`GpuSpheres::from_columns`]). A further dispatch copies them to rows,
    /// 16 bytes per sphere. A [`GpuSession`](super::GpuSession) ignores it. Default: rows `x, y, z, r`.
    pub fn columns(self, columns: impl Into<Option<ColumnLayout>>) -> Self {
        Self { columns: columns.into(), ..self }
    }

    /// Threads per workgroup of the consumer that [`Outcome::DISPATCH_OFFSET`] dispatches. Default: 256.
    pub fn consumer_workgroup_size(self, consumer_workgroup_size: u32) -> Self {
        Self { consumer_workgroup_size, ..self }
    }

    /// Lets pairs of the cell list hold positions in its cell order ([`CellOrder`](super::CellOrder)); then
    /// [`Outcome::pairs_in_cell_order`] is 1. Other algorithms, windows and a [`GpuSession`](super::GpuSession) always
    /// use input indices. Default: no.
    pub fn pairs_in_cell_order(self, pairs_in_cell_order: bool) -> Self {
        Self { pairs_in_cell_order, ..self }
    }

    /// Permits subgroup operations. Default: yes.
    pub fn subgroups(self, subgroups: bool) -> Self {
        Self { subgroups, ..self }
    }

    /// Times phases on a device with timestamp queries. Without timestamps inside passes
    /// ([`optional_features`](super::optional_features)) each phase has its own pass, which costs some microseconds.
    /// Default: no.
    pub fn timestamps(self, timestamps: bool) -> Self {
        Self { timestamps, ..self }
    }

    /// Sets the most distance tests of one dispatch, so that no driver's watchdog ends it. Longer searches have several
    /// dispatches ([`CallCost::parts`](super::CallCost::parts)). A dispatch searches at least 256 spheres; among 20
    /// million spheres in one cell, these exceed the default. Default: the tests of 200 ms, at 2.5·10¹⁰ tests/s for a
    /// discrete GPU, 2.5·10⁹ for an integrated one and 5·10⁸ for a software adapter; an H100 and an H200 reach 3.1·10¹¹.
    /// A [`Detector`](crate::Detector) uses the rate of its [`Calibration`].
    pub fn max_tests_per_dispatch(self, tests: u64) -> Self {
        Self { max_tests_per_dispatch: Some(tests), ..self }
    }

    /// Sets the number of recorded parts of the search of crowded cells, whose work only the device knows. If a part
    /// exceeds [`max_tests_per_dispatch`](Self::max_tests_per_dispatch), the outcome has [`Outcome::OVERFLOW_WORK`].
    /// Parts without work cost some microseconds. Default: 1, to which a [`GpuSession`](super::GpuSession) adds.
    pub fn deferred_parts(self, parts: u32) -> Self {
        Self { deferred_parts: parts, ..self }
    }
}

impl GpuConfig {
    /// Default of τ. On Mesa's llvmpipe, 100 000 spheres of five sizes take the same time at any τ of 32 or more; a
    /// burst of ten sizes is fastest near 128 (`cargo bench -p lazygrid-bench --bench parameter_sweep -- --backend gpu
    /// --what tau`).
    pub const TAU: u32 = 64;
    /// Default cell ratio: on llvmpipe the best for five sizes; for equal spheres 3 is a tenth better.
    pub const CELL_RATIO: f32 = 2.0;
    /// Smallest cell ratio with which no sphere overlaps more than two cells per axis.
    pub const MIN_CELL_RATIO: f32 = 1.5;
    /// Largest cell ratio.
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
            most_frequent: None,
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

pub(crate) fn check(settings: &GpuConfig) -> Result<(), Error> {
    if settings.space.triclinic_cell().is_some() {
        let range = "choose cell vectors along the axes, or `Detector`, which also accepts triclinic cells";
        return Err(Error::InvalidSetting { name: "space", value: "triclinic".into(), range });
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

pub(crate) fn check_algorithm(algorithm: Algorithm) -> Result<(), Error> {
    match algorithm {
        Algorithm::Auto => Ok(()),
        named if Algorithm::GPU.contains(&named) => Ok(()),
        other => Err(Error::NotOnBackend { algorithm: other, backend: crate::Backend::Gpu }),
    }
}
