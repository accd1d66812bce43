//! Checks of single kernels, each against a plain sequential function.

mod assignment;
mod axes;
mod call;
mod cell_list;
mod cells;
mod division;
mod grid;
mod grid_levels;
mod overflow;
pub mod primitives;
mod runs;
mod skin;
mod support;

use lazygrid::gpu::GpuDevice;

use crate::Effort;

pub use support::KernelError;
pub(crate) use support::same;

/// A check of one or more kernels.
#[derive(Clone, Copy, Debug)]
pub struct KernelCheck {
    /// The name of the check.
    pub name: &'static str,
    /// The names of the checked kernels.
    pub kernels: &'static [&'static str],
    /// The function that runs the check.
    pub run: Run,
}

const fn one(name: &'static str, kernels: &'static [&'static str], run: Run) -> KernelCheck {
    KernelCheck { name, kernels, run }
}

/// A check function.
pub type Run = fn(&GpuDevice, Effort) -> Result<(), KernelError>;

/// All checks, in the order in which a call runs the kernels.
pub const CHECKS: [KernelCheck; 34] = [
    one("start of a call", &["call_begin"], |own, _| call::call_begin(own)),
    one("wrapped coordinates", &["spheres_wrap"], |own, _| call::spheres_wrap(own)),
    one("bounds", &["bounds_reduce"], |own, _| call::bounds_reduce(own)),
    one("grid", &["grid_configure"], |own, _| grid::grid_configure(own)),
    one("occupancy table", &["density_clear"], |own, _| grid_levels::density_clear(own)),
    one("cells", &["cells_find"], |own, _| grid_levels::cells_find(own)),
    one("deeper levels", &["levels_refine"], |own, _| grid_levels::levels_refine(own)),
    one("keys of levels", &["levels_settle"], |own, _| grid_levels::levels_settle(own)),
    one("entries", &["entries_emit"], |own, _| grid_levels::entries_emit(own)),
    one("number of entries", &["entries_close"], |own, _| call::entries_close(own)),
    one("prefix scan", &["scan_reduce", "scan_spine", "scan_spread"], |own, effort| {
        sizes(effort).try_for_each(|size| primitives::scan(own, size))
    }),
    one("prefix scan of few values", &["scan_once"], |own, _| primitives::scan_once(own)),
    one("radix sort", &["radix_count", "radix_scan", "radix_scatter"], |own, effort| {
        sizes(effort).try_for_each(|size| primitives::sort(own, size))
    }),
    one("size classes and bounds", &["spheres_survey"], |own, _| cell_list::spheres_survey(own)),
    one("cells of a cell list", &["list_configure"], |own, effort| {
        assignment::list_configure(own)?;
        axes::cells_along_axes(own, effort)
    }),
    one("cells of few spheres", &["list_begin"], |own, _| cell_list::list_begin(own)),
    one("occupancy of the first cells", &["density_count"], |own, _| assignment::density_count(own)),
    one("cells and ranks", &["homes_count"], |own, _| assignment::homes_count(own)),
    one("cells as sort keys", &["homes_key"], |own, _| assignment::homes_key(own)),
    one("starts of cells", &["cells_index"], |own, _| cell_list::cells_index(own)),
    one("spheres in cell order", &["spheres_place", "spheres_gather"], |own, _| {
        cell_list::spheres_place(own)
    }),
    one("first candidates", &["list_search"], |own, _| overflow::list_search(own)),
    one("dispatch of the search of further candidates", &["shares_open"], |own, _| {
        overflow::shares_open(own)
    }),
    one("further candidates", &["shares_search"], |own, _| overflow::shares_search(own)),
    one("near pairs in runs", &["runs_search"], |own, _| runs::runs_search(own)),
    one("dispatch of the search of far pairs in runs", &["crowded_open"], |own, _| call::crowded_open(own)),
    one("far pairs in runs", &["crowded_search"], |own, _| runs::crowded_search(own)),
    one("displacements", &["skin_measure"], |own, _| skin::skin_measure(own)),
    one("rebuild of the candidate list", &["skin_decide"], |own, _| skin::skin_decide(own)),
    one("reference positions", &["skin_keep"], |own, _| skin::skin_keep(own)),
    one("dispatch of the candidate test", &["candidates_open"], |own, _| skin::candidates_open(own)),
    one("pairs among candidates", &["candidates_test"], |own, _| skin::candidates_test(own)),
    one("all pairs", &["naive_search"], |own, _| call::naive_search(own)),
    one("outcome", &["outcome_finish"], |own, _| call::outcome_finish(own)),
];

fn sizes(effort: Effort) -> impl Iterator<Item = usize> {
    let most = if effort == Effort::Quick { 5000 } else { usize::MAX };
    let large = (effort == Effort::Full).then_some(1 << 24);
    primitives::SIZES.into_iter().filter(move |size| *size < most).chain(large)
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::kernel::KERNELS;

    use super::*;

    #[test]
    fn each_kernel_has_one_check() {
        let mut checked: Vec<&str> = CHECKS.iter().flat_map(|check| check.kernels).copied().collect();
        let mut all: Vec<&str> = KERNELS.iter().map(|kernel| kernel.name).collect();
        checked.sort_unstable();
        all.sort_unstable();
        assert_eq!(checked, all);
    }
}
