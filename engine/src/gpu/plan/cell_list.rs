use encase::ShaderType;
use lazygrid_kernels::kernel::{self as k, Kernel};
use lazygrid_kernels::layout::{CellListLayout, InputStats, SortCounts};

use super::buffers::{BufferId, bytes_of, sort_buffers};
use super::dispatches::{Dispatch, GpuPhase, deferred, scan_dispatches, sort_dispatches};
use super::limits::DeviceLimits;
use super::{Plan, Request};

/// Cells per sphere, times two, for a counting sort. At 2, 3 and 4 cells per sphere, equal spheres at 5 % density have
/// 10.8, 8.5 and 6.4 candidates; more cells enlarge the table.
const COUNTED_HALF_CELLS: u64 = 6;
/// Cells per sphere, times two, for a radix sort, whose table exceeds caches: 12.4 candidates per sphere.
const SORTED_HALF_CELLS: u64 = 3;
/// Minimum number of cells, because every level needs some of them.
const MIN_CELLS: u64 = 1 << 12;
/// Keeps the number of counters below 2³¹.
const MAX_CELLS: u64 = 1 << 30;
/// Rounding adds at most one cell in this many: the device computes cell counts as products of floats, which round
/// three times by 2⁻²⁴.
const ROUNDED: u64 = 1 << 22;
/// Counters of level 0 that fit the caches of current devices.
const MAX_OCCUPANCY_SLOTS: u32 = 1 << 22;
/// Maximum workgroups of the statistics kernel: enough for current devices, with little contention at its counters.
const STATS_GROUPS: u32 = 1024;
/// Maximum workgroups of the occupancy kernel, whose threads stride over the spheres.
const OCCUPANCY_GROUPS: u32 = 1024;
/// Spheres per thread of the statistics kernel, in calls of few and of many spheres.
const SPHERES_PER_THREAD: [u32; 2] = [2, 8];
/// Largest call with as few dispatches as possible, because each costs more than its work: all smaller spheres leave
/// overfull cells, and the search has a workgroup for each chunk of candidates of every block.
const MAX_SMALL_CALL: u32 = 1 << 15;
/// Largest call that one workgroup surveys and sets up, in ten rounds of four loads.
const MAX_ONE_GROUP_SETUP: u32 = 40 * k::WORKGROUP_SIZE;
/// Counters per workgroup of `cell_starts_find`.
const CELL_STARTS_BLOCK: u32 = 2048;

pub(super) fn size(plan: &mut Plan, request: &Request, limits: &DeviceLimits) {
    let is_counted = request.spheres < request.radix_sort_from;
    let half_cells = if is_counted { COUNTED_HALF_CELLS } else { SORTED_HALF_CELLS };
    let wanted = (u64::from(request.spheres) * half_cells / 2).clamp(MIN_CELLS, MAX_CELLS);
    let most = limits.bytes() / 4 - 6;
    plan.cells = wanted.min(most - most / ROUNDED) as u32;
    // Two more counters and the largest one follow the cells. `scan_once` reads four at once.
    plan.counters = (plan.cells + plan.cells / ROUNDED as u32 + 3).next_multiple_of(4);
    plan.occupancy_slots = request.spheres.clamp(256, MAX_OCCUPANCY_SLOTS).next_power_of_two();
    if is_counted {
        plan.tile = 0;
        if request.spheres <= MAX_SMALL_CALL {
            plan.occupancy_slots = 0;
            plan.chunks_per_block = request.spheres.div_ceil(plan.candidates_per_invocation).max(1);
        }
    } else {
        plan.key_bits = u32::BITS - (plan.counters - 1).leading_zeros();
    }
}

impl Plan {
    /// Lets the device check an earlier call's cells instead of choosing cells. The caller clears
    /// [`Self::cleared_bytes`] of the counters.
    pub(crate) fn reuse_layout(&mut self) {
        let choosing =
            [&k::CELL_LIST_SETUP_SMALL, &k::STATS_REDUCE, &k::CELL_LIST_CONFIGURE, &k::OCCUPANCY_COUNT];
        self.dispatches.retain(|dispatch| !choosing.contains(&dispatch.kernel));
        self.reuses_layout = true;
    }

    /// Returns the bytes of [`BufferId::Starts`] to clear before the first dispatch.
    pub(crate) fn cleared_bytes(&self) -> u64 {
        if self.reuses_layout && self.tile == 0 { 4 * u64::from(self.counters) } else { 0 }
    }
}

pub(super) fn buffers(plan: &Plan, species: bool) -> Vec<(BufferId, u64)> {
    let mut buffers = vec![
        (BufferId::InputStats, size_of::<InputStats>() as u64),
        (BufferId::List, CellListLayout::min_size().get()),
        (BufferId::SortCounts, size_of::<SortCounts>() as u64),
        (BufferId::Starts, bytes_of(plan.counters, 4)),
        (BufferId::Density, bytes_of(plan.occupancy_slots, 4)),
        (BufferId::Sorted, bytes_of(plan.spheres, 16)),
        (BufferId::Crowded, bytes_of(plan.spheres.div_ceil(k::WORKGROUP_SIZE), 4)),
        (BufferId::DispatchArgs, 16),
    ];
    if plan.tile == 0 {
        buffers.extend([
            (BufferId::Homes, bytes_of(plan.spheres, 8)),
            (BufferId::Keys(false), bytes_of(plan.spheres, 4)),
            (BufferId::Objects(false), bytes_of(plan.spheres, 4)),
            (BufferId::Sums, bytes_of(plan.counters.div_ceil(k::SCAN_TILE), 8)),
            (BufferId::Total, 16),
        ]);
    } else {
        buffers.extend(sort_buffers(plan.spheres));
    }
    if species {
        buffers.push((BufferId::SortedSpecies, bytes_of(plan.spheres, 4)));
    }
    buffers
}

pub(super) fn is_search(kernel: &Kernel) -> bool {
    [&k::CELL_LIST_SEARCH, &k::CELL_LIST_SEARCH_OVERFLOW].contains(&kernel)
}

pub(super) fn dispatches(plan: &Plan) -> Vec<Dispatch> {
    let per_sphere = plan.spheres.div_ceil(k::WORKGROUP_SIZE);
    let dispatch = Dispatch::new;
    let per_thread = SPHERES_PER_THREAD[usize::from(plan.chunks_per_block == 0)];
    let survey = plan.spheres.div_ceil(k::WORKGROUP_SIZE * per_thread).clamp(1, STATS_GROUPS);
    let mut dispatches = match plan.spheres <= MAX_ONE_GROUP_SETUP && plan.tile == 0 {
        true => vec![dispatch(&k::CELL_LIST_SETUP_SMALL, 1, GpuPhase::Survey)],
        false => vec![
            dispatch(&k::STATS_REDUCE, survey, GpuPhase::Survey),
            dispatch(&k::CELL_LIST_CONFIGURE, 1, GpuPhase::Survey),
        ],
    };
    if plan.occupancy_slots > 0 {
        dispatches.push(dispatch(&k::OCCUPANCY_COUNT, per_sphere.min(OCCUPANCY_GROUPS), GpuPhase::Entries));
    }
    if plan.tile == 0 {
        dispatches.push(dispatch(&k::CELLS_COUNT, per_sphere, GpuPhase::Entries));
        if plan.counters <= k::SCANNED_AT_ONCE {
            dispatches.push(dispatch(&k::SCAN_ONCE, 1, GpuPhase::Sort));
        } else {
            dispatches.extend(scan_dispatches(plan.counters, 0));
        }
        dispatches.push(dispatch(&k::SPHERES_SCATTER, per_sphere, GpuPhase::Sort));
    } else {
        dispatches.push(dispatch(&k::CELLS_KEY, plan.spheres.div_ceil(plan.tile), GpuPhase::Entries));
        // The digits of the first pass are counted already.
        dispatches.extend(sort_dispatches(plan.spheres, plan.passes()).skip(1));
        let sorted = |kernel, groups| Dispatch::in_sort(kernel, groups, plan.passes());
        dispatches.push(sorted(&k::CELL_STARTS_FIND, plan.counters.div_ceil(CELL_STARTS_BLOCK)));
        dispatches.push(sorted(&k::SPHERES_GATHER, per_sphere));
    }
    let tests_per_group = u64::from(k::WORKGROUP_SIZE * plan.candidates_per_invocation.min(plan.spheres));
    let groups = per_sphere * plan.chunks_per_block.max(1);
    let search = dispatch(&k::CELL_LIST_SEARCH, groups, GpuPhase::Search);
    dispatches.extend(plan.budget.divide(search, tests_per_group));
    if plan.chunks_per_block == 0 {
        let args = &k::CELL_LIST_SEARCH_OVERFLOW_DISPATCH_ARGS;
        dispatches.extend(deferred(plan, args, &k::CELL_LIST_SEARCH_OVERFLOW));
    }
    dispatches
}
