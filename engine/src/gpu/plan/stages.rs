//! The dispatches of a plan.

use lazygrid_kernels::Algorithm;
use lazygrid_kernels::kernel::{self as k, Kernel};

use super::{DeviceLimits, Plan, Refinement, list};

/// The parts of a call that are timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Phase {
    /// Bounds and grid.
    Survey,
    /// Entries of overlapped cells.
    Entries,
    /// Radix sort of the entries.
    Sort,
    /// Distance tests.
    Search,
}

impl Phase {
    /// Every phase in the order they run.
    pub const ALL: [Self; 4] = [Self::Survey, Self::Entries, Self::Sort, Self::Search];

    /// The name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Survey => "survey",
            Self::Entries => "entries",
            Self::Sort => "sort",
            Self::Search => "search",
        }
    }
}

/// One dispatch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Stage {
    /// The kernel.
    pub(crate) kernel: &'static Kernel,
    /// The number of workgroups, before they are laid out in two dimensions.
    pub(crate) groups: u32,
    /// `true` if their number is instead found on the device, in [`Slot::Dispatch`](super::Slot::Dispatch).
    pub(crate) indirect: bool,
    /// Which part of the call it belongs to.
    pub(crate) phase: Phase,
    /// Which radix pass it belongs to; 0 outside the sort.
    pub(crate) pass: u32,
}

impl Stage {
    /// A fixed number of workgroups, outside the sort.
    pub(crate) const fn new(kernel: &'static Kernel, groups: u32, phase: Phase) -> Self {
        Self { kernel, groups, indirect: false, phase, pass: 0 }
    }

    /// The same in a radix pass of the sort.
    pub(super) const fn of_sort(kernel: &'static Kernel, groups: u32, pass: u32) -> Self {
        Self { pass, ..Self::new(kernel, groups, Phase::Sort) }
    }

    /// As many workgroups as the device finds.
    pub(crate) const fn indirect(kernel: &'static Kernel, phase: Phase) -> Self {
        Self { indirect: true, ..Self::new(kernel, 1, phase) }
    }
}

/// The dispatches of a call.
pub(super) fn stages(plan: &Plan) -> Vec<Stage> {
    let per_sphere = plan.spheres.div_ceil(k::GROUP);
    let stage = Stage::new;
    let mut stages = vec![
        stage(&k::CALL_BEGIN, 1, Phase::Survey),
        stage(&k::SPHERES_WRAP, if plan.periodic { per_sphere } else { 0 }, Phase::Survey),
        stage(&k::BOUNDS_REDUCE, plan.spheres.div_ceil(k::BOUNDS_TILE), Phase::Survey),
        stage(&k::GRID_CONFIGURE, 1, Phase::Survey),
    ];
    if plan.algorithm == Algorithm::Naive {
        stages.push(stage(&k::NAIVE_SEARCH, plan.search_groups, Phase::Search));
    } else if plan.algorithm == Algorithm::CellList {
        stages = list::stages(plan);
    } else {
        if plan.refinement == Refinement::Dense {
            let groups = (2 * plan.density_slots).div_ceil(k::DENSITY_TILE);
            stages.push(stage(&k::DENSITY_CLEAR, groups, Phase::Entries));
        }
        stages.push(stage(&k::CELLS_FIND, per_sphere, Phase::Entries));
        if plan.refinement == Refinement::Dense {
            stages.push(stage(&k::LEVELS_REFINE, per_sphere, Phase::Entries));
        }
        if plan.refinement != Refinement::None {
            stages.push(stage(&k::LEVELS_SETTLE, 1, Phase::Entries));
        }
        stages.push(stage(&k::ENTRIES_EMIT, per_sphere, Phase::Entries));
        stages.push(stage(&k::ENTRIES_CLOSE, 1, Phase::Entries));
        stages.extend(sort_stages(plan.entries, plan.tile, plan.passes()));
        stages.push(stage(&k::RUNS_SEARCH, plan.entries.div_ceil(k::GROUP), Phase::Search));
        stages.push(stage(&k::CROWDED_OPEN, 1, Phase::Search));
        stages.push(Stage::indirect(&k::CROWDED_SEARCH, Phase::Search));
    }
    stages.push(stage(&k::OUTCOME_FINISH, 1, Phase::Search));
    stages.retain(|stage| stage.groups > 0);
    stages
}

/// Workgroups laid out over two dimensions. The last row may be longer than needed; kernels end early there.
pub(in crate::gpu) fn flattened(groups: u32, limits: &DeviceLimits) -> [u32; 2] {
    let rows = groups.div_ceil(limits.groups_per_dimension).max(1);
    [groups.div_ceil(rows), rows]
}

/// The stages of a stable radix sort of at most `items` keys by `passes` digits.
pub(in crate::gpu) fn sort_stages(items: u32, tile: u32, passes: u32) -> impl Iterator<Item = Stage> {
    let tiles = items.div_ceil(tile);
    let digits = if tiles == 0 { 0 } else { 1 << k::DIGIT_BITS };
    (0..passes).flat_map(move |pass| {
        let stage = move |kernel, groups| Stage::of_sort(kernel, groups, pass);
        [stage(&k::RADIX_COUNT, tiles), stage(&k::RADIX_SCAN, digits), stage(&k::RADIX_SCATTER, tiles)]
    })
}

/// The stages of an exclusive scan of at most `values` values.
pub(in crate::gpu) fn scan_stages(values: u32, pass: u32) -> [Stage; 3] {
    let tiles = values.div_ceil(k::SCAN_TILE);
    let stage = |kernel, groups| Stage::of_sort(kernel, groups, pass);
    [stage(&k::SCAN_REDUCE, tiles), stage(&k::SCAN_SPINE, 1), stage(&k::SCAN_SPREAD, tiles)]
}
