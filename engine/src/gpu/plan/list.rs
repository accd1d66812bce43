//! The buffers and dispatches of a cell list.

use encase::ShaderType;
use lazygrid_kernels::kernel as k;
use lazygrid_kernels::layout::{Lengths, List, Survey};

use super::buffers::{Slot, bytes_of, sort_buffers};
use super::stages::{Phase, Stage, scan_stages, sort_stages};
use super::{DeviceLimits, Plan, Request};

/// Halves of cells per sphere where the list is sorted by counting: with more of them a sphere has fewer candidates, and
/// the table takes longer. At 3 cells a sphere among equal ones at 5 % density has 8.5 candidates, at 2 it has 10.8, at
/// 4 it has 6.4.
const COUNTED_HALF_CELLS: u64 = 6;
/// The same where it is sorted by radix, where the table is too large for caches: 12.4 candidates.
const SORTED_HALF_CELLS: u64 = 3;
/// The fewest cells: every level needs some.
const FEWEST_CELLS: u64 = 1 << 12;
/// The most cells, with which numbers of counters stay below 2³¹.
const MOST_CELLS: u64 = 1 << 30;
/// The device chooses cells by products of floats, which three roundings of 2⁻²⁴ make look smaller: for so many cells that
/// there is room for it may take one more.
const ROUNDED: u64 = 1 << 22;
/// Most counters for the crowds of level 0: so many stay in the caches of today's devices.
const MAX_DENSITY_SLOTS: u32 = 1 << 22;
/// Workgroups of the survey: enough for today's devices, and so few that they do not queue at its counters.
const SURVEY_GROUPS: u32 = 1024;
/// Spheres that a thread of the survey looks at, where they are not more than its workgroups can share.
const SPHERES_PER_THREAD: u32 = 8;
/// Up to so many spheres each dispatch takes longer than what it has to do, and calls have as few of them as can be: all
/// smaller spheres leave crowded cells, and further shares are dispatched for every block.
const FEW: u32 = 1 << 15;
/// Up to so many a single workgroup surveys them and chooses the cells.
const VERY_FEW: u32 = 1 << 11;
/// Cells of which one workgroup finds the beginnings.
const INDEX_BLOCK: u32 = 2048;

/// Chooses the way to sort and the sizes of all tables.
pub(super) fn size(plan: &mut Plan, request: &Request, limits: &DeviceLimits) {
    let is_counted = request.spheres < request.radix_from;
    let half_cells = if is_counted { COUNTED_HALF_CELLS } else { SORTED_HALF_CELLS };
    let wanted = (u64::from(request.spheres) * half_cells / 2).clamp(FEWEST_CELLS, MOST_CELLS);
    let most = limits.bytes() / 4 - 2;
    // Below 2³¹ with all counters.
    plan.cells = wanted.min(most - most / ROUNDED) as u32;
    // Two more are behind the cells.
    plan.counters = plan.cells + plan.cells / ROUNDED as u32 + 2;
    plan.density_slots = request.spheres.max(256).next_power_of_two().min(MAX_DENSITY_SLOTS);
    if is_counted {
        plan.tile = 0;
        if request.spheres <= FEW {
            plan.density_slots = 0;
            plan.further_shares = request.spheres / plan.share;
        }
    } else {
        plan.key_bits = u32::BITS - (plan.counters - 1).leading_zeros();
    }
}

pub(super) fn buffers(plan: &Plan, species: bool) -> Vec<(Slot, u64)> {
    let mut buffers = vec![
        (Slot::Survey, size_of::<Survey>() as u64),
        (Slot::List, List::min_size().get()),
        (Slot::Lengths, size_of::<Lengths>() as u64),
        (Slot::Starts, bytes_of(plan.counters, 4)),
        (Slot::Density, bytes_of(plan.density_slots, 4)),
        (Slot::Sorted, bytes_of(plan.spheres, 16)),
        (Slot::Crowded, bytes_of(plan.spheres.div_ceil(k::GROUP), 4)),
        (Slot::Dispatch, 16),
    ];
    if plan.tile == 0 {
        buffers.extend([
            (Slot::Homes, bytes_of(plan.spheres, 8)),
            (Slot::Keys(false), bytes_of(plan.spheres, 4)),
            (Slot::Objects(false), bytes_of(plan.spheres, 4)),
            (Slot::Sums, bytes_of(plan.counters.div_ceil(k::SCAN_TILE), 8)),
            (Slot::Total, 16),
        ]);
    } else {
        buffers.extend(sort_buffers(plan.spheres, plan.tile));
    }
    if species {
        buffers.push((Slot::SortedSpecies, bytes_of(plan.spheres, 4)));
    }
    buffers
}

pub(super) fn stages(plan: &Plan) -> Vec<Stage> {
    let per_sphere = plan.spheres.div_ceil(k::GROUP);
    let stage = Stage::new;
    let survey = plan.spheres.div_ceil(k::GROUP * SPHERES_PER_THREAD).clamp(1, SURVEY_GROUPS);
    let mut stages = match plan.spheres <= VERY_FEW && plan.tile == 0 {
        true => vec![stage(&k::LIST_BEGIN, 1, Phase::Survey)],
        false => vec![
            stage(&k::SPHERES_SURVEY, survey, Phase::Survey),
            stage(&k::LIST_CONFIGURE, 1, Phase::Survey),
        ],
    };
    if plan.density_slots > 0 {
        stages.push(stage(&k::DENSITY_COUNT, per_sphere, Phase::Entries));
    }
    if plan.tile == 0 {
        stages.push(stage(&k::HOMES_COUNT, per_sphere, Phase::Entries));
        if plan.counters <= k::SCANNED_AT_ONCE {
            stages.push(stage(&k::SCAN_ONCE, 1, Phase::Sort));
        } else {
            stages.extend(scan_stages(plan.counters, 0));
        }
        stages.push(stage(&k::SPHERES_PLACE, per_sphere, Phase::Sort));
    } else {
        stages.push(stage(&k::HOMES_KEY, plan.spheres.div_ceil(plan.tile), Phase::Entries));
        // The digits of the first pass are counted already.
        stages.extend(sort_stages(plan.spheres, plan.tile, plan.passes()).skip(1));
        let sorted = |kernel, groups| Stage::of_sort(kernel, groups, plan.passes());
        stages.push(sorted(&k::CELLS_INDEX, plan.counters.div_ceil(INDEX_BLOCK)));
        stages.push(sorted(&k::SPHERES_GATHER, per_sphere));
    }
    stages.push(stage(&k::LIST_SEARCH, per_sphere, Phase::Search));
    // One share holds all candidates of very few spheres.
    if plan.further_shares > 0 {
        stages.push(stage(&k::SHARES_SEARCH, per_sphere * plan.further_shares, Phase::Search));
    } else if plan.spheres > plan.share {
        stages.push(stage(&k::SHARES_OPEN, 1, Phase::Search));
        stages.push(Stage::indirect(&k::SHARES_SEARCH, Phase::Search));
    }
    stages
}
