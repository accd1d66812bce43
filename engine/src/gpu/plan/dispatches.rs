use lazygrid_kernels::Algorithm;
use lazygrid_kernels::kernel::{self as k, Kernel};

use super::limits::DeviceLimits;
use super::{Plan, SplitPolicy, cell_list};

/// The timed phases of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum GpuPhase {
    /// Statistics and choice of the grid.
    Survey,
    /// Cells: all that a sphere overlaps, or one each in a cell list.
    Entries,
    /// Sort of the entries, or of a cell list's spheres.
    Sort,
    /// Distance tests.
    Search,
}

impl GpuPhase {
    /// Every phase in execution order.
    pub const ALL: &'static [Self] = &[Self::Survey, Self::Entries, Self::Sort, Self::Search];

    /// Name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Survey => "survey",
            Self::Entries => "entries",
            Self::Sort => "sort",
            Self::Search => "search",
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Dispatch {
    pub(crate) kernel: &'static Kernel,
    pub(crate) groups: u32,
    pub(crate) indirect: bool,
    pub(crate) first_group: u32,
    pub(crate) args_index: u32,
    pub(crate) phase: GpuPhase,
    pub(crate) pass: u32,
    pub(crate) ignores_species: bool,
}

impl Dispatch {
    pub(crate) const fn new(kernel: &'static Kernel, groups: u32, phase: GpuPhase) -> Self {
        Self {
            kernel,
            groups,
            indirect: false,
            first_group: 0,
            args_index: 0,
            phase,
            pass: 0,
            ignores_species: false,
        }
    }

    pub(super) const fn in_sort(kernel: &'static Kernel, groups: u32, pass: u32) -> Self {
        Self { pass, ..Self::new(kernel, groups, GpuPhase::Sort) }
    }

    pub(crate) const fn indirect(kernel: &'static Kernel, phase: GpuPhase) -> Self {
        Self { indirect: true, ..Self::new(kernel, 1, phase) }
    }
}

pub(super) fn dispatches(plan: &Plan) -> Vec<Dispatch> {
    let per_sphere = plan.spheres.div_ceil(k::WORKGROUP_SIZE);
    let dispatch = Dispatch::new;
    let mut dispatches = vec![
        dispatch(&k::CALL_BEGIN, 1, GpuPhase::Survey),
        dispatch(&k::SPHERES_WRAP, if plan.periodic { per_sphere } else { 0 }, GpuPhase::Survey),
        dispatch(&k::BOUNDS_REDUCE, plan.spheres.div_ceil(k::BOUNDS_TILE), GpuPhase::Survey),
        dispatch(&k::GRID_CONFIGURE, 1, GpuPhase::Survey),
    ];
    if plan.algorithm == Algorithm::Naive {
        let search = dispatch(&k::NAIVE_SEARCH, plan.search_groups, GpuPhase::Search);
        dispatches.extend(plan.budget.divide(search, plan.naive_tests_per_group()));
    } else if plan.algorithm == Algorithm::CellList {
        dispatches = cell_list::dispatches(plan);
    } else {
        if plan.split_policy == SplitPolicy::Dense {
            let groups = (2 * plan.occupancy_slots).div_ceil(k::OCCUPANCY_TILE);
            dispatches.push(dispatch(&k::OCCUPANCY_CLEAR, groups, GpuPhase::Entries));
        }
        dispatches.push(dispatch(&k::CELLS_FIND, per_sphere, GpuPhase::Entries));
        if plan.split_policy == SplitPolicy::Dense {
            dispatches.push(dispatch(&k::LEVELS_COUNT, per_sphere, GpuPhase::Entries));
        }
        if plan.split_policy != SplitPolicy::None {
            dispatches.push(dispatch(&k::LEVELS_ASSIGN_KEYS, 1, GpuPhase::Entries));
        }
        dispatches.push(dispatch(&k::ENTRIES_EMIT, per_sphere, GpuPhase::Entries));
        dispatches.push(dispatch(&k::ENTRIES_FINISH, 1, GpuPhase::Entries));
        dispatches.extend(sort_dispatches(plan.entries, plan.passes()));
        let blocks = plan.entries.div_ceil(k::WORKGROUP_SIZE);
        let near = dispatch(&k::RUNS_SEARCH_NEAR, blocks, GpuPhase::Search);
        dispatches.extend(plan.budget.divide(near, u64::from(k::WORKGROUP_SIZE * k::NEAR)));
        dispatches.extend(deferred(plan, &k::RUNS_SEARCH_FAR_DISPATCH_ARGS, &k::RUNS_SEARCH_FAR));
    }
    if plan.columns.is_some() {
        dispatches.insert(0, interleave(plan.spheres));
    }
    // The search of few spheres finishes the outcome.
    if plan.chunks_per_block == 0 {
        dispatches.push(dispatch(&k::OUTCOME_FINISH, 1, GpuPhase::Search));
    }
    dispatches.retain(|dispatch| dispatch.groups > 0);
    dispatches
}

pub(super) fn interleave(spheres: u32) -> Dispatch {
    Dispatch::new(&k::SPHERES_INTERLEAVE, spheres.div_ceil(k::WORKGROUP_SIZE), GpuPhase::Survey)
}

pub(super) fn deferred(
    plan: &Plan,
    args: &'static Kernel,
    search: &'static Kernel,
) -> impl Iterator<Item = Dispatch> {
    (0..plan.deferred_parts).flat_map(move |_| {
        [Dispatch::new(args, 1, GpuPhase::Search), Dispatch::indirect(search, GpuPhase::Search)]
    })
}

/// Returns the dispatch size in rows within the limit; excess workgroups end early.
pub(crate) fn flattened(groups: u32, limits: &DeviceLimits) -> [u32; 2] {
    let rows = groups.div_ceil(limits.groups_per_dimension).max(1);
    [groups.div_ceil(rows), rows]
}

pub(crate) fn sort_dispatches(items: u32, passes: u32) -> impl Iterator<Item = Dispatch> {
    let tiles = items.div_ceil(k::RADIX_TILE);
    let digits = if tiles == 0 { 0 } else { 1 << k::DIGIT_BITS };
    (0..passes).flat_map(move |pass| {
        let dispatch = move |kernel, groups| Dispatch::in_sort(kernel, groups, pass);
        [
            dispatch(&k::RADIX_COUNT, tiles),
            dispatch(&k::RADIX_SCAN, digits),
            dispatch(&k::RADIX_SCATTER, tiles),
        ]
    })
}

pub(crate) fn scan_dispatches(values: u32, pass: u32) -> [Dispatch; 3] {
    let tiles = values.div_ceil(k::SCAN_TILE);
    let dispatch = |kernel, groups| Dispatch::in_sort(kernel, groups, pass);
    [dispatch(&k::SCAN_REDUCE, tiles), dispatch(&k::SCAN_SPINE, 1), dispatch(&k::SCAN_SPREAD, tiles)]
}
