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
    one("subgroup probe", &["subgroup_probe"], |gpu, _| probe::subgroup_probe(gpu)),
    one("start of a call", &["call_begin"], |gpu, _| call::call_begin(gpu)),
    one("rows from columns", &["spheres_interleave"], |gpu, _| call::spheres_interleave(gpu)),
    one("wrapped coordinates", &["spheres_wrap"], |gpu, _| call::spheres_wrap(gpu)),
    one("bounds", &["bounds_reduce"], |gpu, _| call::bounds_reduce(gpu)),
    one("grid", &["grid_configure"], |gpu, _| grid::grid_configure(gpu)),
    one("occupancy table", &["occupancy_clear"], |gpu, _| grid_levels::occupancy_clear(gpu)),
    one("cells", &["cells_find"], |gpu, _| grid_levels::cells_find(gpu)),
    one("deeper levels", &["levels_count"], |gpu, _| grid_levels::levels_count(gpu)),
    one("keys of levels", &["levels_assign_keys"], |gpu, _| grid_levels::levels_assign_keys(gpu)),
    one("entries", &["entries_emit"], |gpu, _| grid_levels::entries_emit(gpu)),
    one("number of entries", &["entries_finish"], |gpu, _| call::entries_finish(gpu)),
    one("prefix scan", &["scan_reduce", "scan_spine", "scan_spread"], |gpu, effort| {
        sizes(effort).try_for_each(|size| primitives::scan(gpu, size))
    }),
    one("prefix scan of few values", &["scan_once"], |gpu, _| primitives::scan_once(gpu)),
    one("radix sort", &["radix_count", "radix_scan", "radix_scatter"], |gpu, effort| {
        sizes(effort).try_for_each(|size| primitives::sort(gpu, size))
    }),
    one("size classes and bounds", &["stats_reduce"], |gpu, _| cell_list::stats_reduce(gpu)),
    one("cells of a cell list", &["cell_list_configure"], |gpu, effort| {
        assignment::cell_list_configure(gpu)?;
        axes::cells_along_axes(gpu, effort)
    }),
    one("cells of few spheres", &["cell_list_setup_small"], |gpu, _| cell_list::cell_list_setup_small(gpu)),
    one("occupancy of the first cells", &["occupancy_count"], |gpu, _| assignment::occupancy_count(gpu)),
    one("cells and ranks", &["cells_count"], |gpu, _| {
        assignment::cells_count(gpu)?;
        reuse::reused_cells(gpu)
    }),
    one("cells as sort keys", &["cells_key"], |gpu, _| assignment::cells_key(gpu)),
    one("starts of cells", &["cell_starts_find"], |gpu, _| cell_list::cell_starts_find(gpu)),
    one("spheres in cell order", &["spheres_scatter", "spheres_gather"], |gpu, _| {
        cell_list::spheres_scatter(gpu)
    }),
    one("first candidates", &["cell_list_search"], |gpu, _| overflow::cell_list_search(gpu)),
    one(
        "dispatch of the search of further candidates",
        &["cell_list_search_overflow_dispatch_args"],
        |gpu, _| overflow::cell_list_search_overflow_dispatch_args(gpu),
    ),
    one("further candidates", &["cell_list_search_overflow"], |gpu, _| {
        overflow::cell_list_search_overflow(gpu)
    }),
    one("near pairs in runs", &["runs_search_near"], |gpu, _| runs::runs_search_near(gpu)),
    one("dispatch of the search of far pairs in runs", &["runs_search_far_dispatch_args"], |gpu, _| {
        call::runs_search_far_dispatch_args(gpu)
    }),
    one("far pairs in runs", &["runs_search_far"], |gpu, _| runs::runs_search_far(gpu)),
    one("displacements", &["skin_displacement"], |gpu, _| skin::skin_displacement(gpu)),
    one("rebuild of the candidate list", &["skin_check"], |gpu, _| skin::skin_check(gpu)),
    one("reference positions", &["skin_store_reference"], |gpu, _| skin::skin_store_reference(gpu)),
    one("dispatch of the candidate test", &["candidates_test_dispatch_args"], |gpu, _| {
        skin::candidates_test_dispatch_args(gpu)
    }),
    one("pairs among candidates", &["candidates_test"], |gpu, _| skin::candidates_test(gpu)),
    one("all pairs", &["naive_search"], |gpu, _| call::naive_search(gpu)),
    one("outcome", &["outcome_finish"], |gpu, _| call::outcome_finish(gpu)),
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
