//! Checks of single kernels, each against a plain sequential function.

mod assignment;
mod axes;
mod call;
mod cell_list;
mod cells;
mod division;
mod grid;
mod grid_levels;
mod kernel_call;
mod overflow;
pub mod primitives;
mod probe;
mod reuse;
mod runs;
mod skin;
mod support;

use lazygrid::gpu::GpuDevice;

use crate::Effort;

pub use support::KernelError;
pub(crate) use support::same;

#[derive(Clone, Copy, Debug)]
pub struct KernelCheck {
    pub name: &'static str,
    pub kernels: &'static [&'static str],
    pub run: Run,
}

const fn one(name: &'static str, kernels: &'static [&'static str], run: Run) -> KernelCheck {
    KernelCheck { name, kernels, run }
}

pub type Run = fn(&GpuDevice, Effort) -> Result<(), KernelError>;

pub const CHECKS: [KernelCheck; 36] = [
    one("subgroup probe", &["subgroup_probe"], |own, _| probe::subgroup_probe(own)),
    one("start of a call", &["call_begin"], |own, _| call::call_begin(own)),
    one("rows from columns", &["spheres_interleave"], |own, _| call::spheres_interleave(own)),
    one("wrapped coordinates", &["spheres_wrap"], |own, _| call::spheres_wrap(own)),
    one("bounds", &["bounds_reduce"], |own, _| call::bounds_reduce(own)),
    one("grid", &["grid_configure"], |own, _| grid::grid_configure(own)),
    one("occupancy table", &["occupancy_clear"], |own, _| grid_levels::occupancy_clear(own)),
    one("cells", &["cells_find"], |own, _| grid_levels::cells_find(own)),
    one("deeper levels", &["levels_count"], |own, _| grid_levels::levels_count(own)),
    one("keys of levels", &["levels_assign_keys"], |own, _| grid_levels::levels_assign_keys(own)),
    one("entries", &["entries_emit"], |own, _| grid_levels::entries_emit(own)),
    one("number of entries", &["entries_finish"], |own, _| call::entries_finish(own)),
    one("prefix scan", &["scan_reduce", "scan_spine", "scan_spread"], |own, effort| {
        sizes(effort).try_for_each(|size| primitives::scan(own, size))
    }),
    one("prefix scan of few values", &["scan_once"], |own, _| primitives::scan_once(own)),
    one("radix sort", &["radix_count", "radix_scan", "radix_scatter"], |own, effort| {
        sizes(effort).try_for_each(|size| primitives::sort(own, size))
    }),
    one("size classes and bounds", &["stats_reduce"], |own, _| cell_list::stats_reduce(own)),
    one("cells of a cell list", &["cell_list_configure"], |own, effort| {
        assignment::cell_list_configure(own)?;
        axes::cells_along_axes(own, effort)
    }),
    one("cells of few spheres", &["cell_list_setup_small"], |own, _| cell_list::cell_list_setup_small(own)),
    one("occupancy of the first cells", &["occupancy_count"], |own, _| assignment::occupancy_count(own)),
    one("cells and ranks", &["cells_count"], |own, _| {
        assignment::cells_count(own)?;
        reuse::reused_cells(own)
    }),
    one("cells as sort keys", &["cells_key"], |own, _| assignment::cells_key(own)),
    one("starts of cells", &["cell_starts_find"], |own, _| cell_list::cell_starts_find(own)),
    one("spheres in cell order", &["spheres_scatter", "spheres_gather"], |own, _| {
        cell_list::spheres_scatter(own)
    }),
    one("first candidates", &["cell_list_search"], |own, _| overflow::cell_list_search(own)),
    one(
        "dispatch of the search of further candidates",
        &["cell_list_search_overflow_dispatch_args"],
        |own, _| overflow::cell_list_search_overflow_dispatch_args(own),
    ),
    one("further candidates", &["cell_list_search_overflow"], |own, _| {
        overflow::cell_list_search_overflow(own)
    }),
    one("near pairs in runs", &["runs_search_near"], |own, _| runs::runs_search_near(own)),
    one("dispatch of the search of far pairs in runs", &["runs_search_far_dispatch_args"], |own, _| {
        call::runs_search_far_dispatch_args(own)
    }),
    one("far pairs in runs", &["runs_search_far"], |own, _| runs::runs_search_far(own)),
    one("displacements", &["skin_displacement"], |own, _| skin::skin_displacement(own)),
    one("rebuild of the candidate list", &["skin_check"], |own, _| skin::skin_check(own)),
    one("reference positions", &["skin_store_reference"], |own, _| skin::skin_store_reference(own)),
    one("dispatch of the candidate test", &["candidates_test_dispatch_args"], |own, _| {
        skin::candidates_test_dispatch_args(own)
    }),
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
