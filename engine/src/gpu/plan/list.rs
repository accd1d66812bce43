//! What a cell list takes.

use lazygrid_kernels::kernel as k;
use lazygrid_kernels::layout::{Lengths, List, Survey};

use super::buffers::{Slot, bytes_of};
use super::stages::{Phase, Stage, scan_stages};
use super::{DeviceLimits, Plan};

/// Cells per sphere: with more of them a sphere has fewer candidates, and the table takes longer. At 3 a sphere among
/// equal ones at 5 % density has 8.5 candidates, at 2 it has 10.8, at 4 it has 6.4.
const CELLS_PER_SPHERE: u64 = 3;
/// The fewest cells: every level needs some.
const FEWEST_CELLS: u64 = 1 << 12;
/// Most counters for the crowds of level 0: so many stay in the caches of today's devices.
const MAX_DENSITY_SLOTS: u32 = 1 << 22;
/// Spheres that a thread of the survey looks at, where they are not more than its workgroups can share.
const SPHERES_PER_THREAD: u32 = 8;
/// Workgroups of the survey: enough for today's devices, and so few that they do not queue at its counters.
const SURVEY_GROUPS: u32 = 1024;

/// Cells that the table has room for.
pub(super) fn cells(spheres: u32, limits: &DeviceLimits) -> u32 {
    let wanted = (u64::from(spheres) * CELLS_PER_SPHERE).max(FEWEST_CELLS);
    // The two counters behind the cells need room too. Below 2³² by the limits of bindings.
    wanted.min(limits.bytes() / 4 - 2).min(1 << 30) as u32
}

/// Counters of the crowds of level 0, a power of two.
pub(super) fn density_slots(spheres: u32) -> u32 {
    spheres.max(256).next_power_of_two().min(MAX_DENSITY_SLOTS)
}

pub(super) fn buffers(plan: &Plan, species: bool) -> Vec<(Slot, u64)> {
    let sums = plan.counters.div_ceil(k::SCAN_TILE);
    let mut buffers = vec![
        (Slot::Survey, size_of::<Survey>() as u64),
        (Slot::List, size_of::<List>() as u64),
        (Slot::Lengths, size_of::<Lengths>() as u64),
        (Slot::Starts, bytes_of(plan.counters, 4)),
        (Slot::Density, bytes_of(plan.density_slots, 4)),
        (Slot::Homes, bytes_of(plan.spheres, 8)),
        (Slot::Sorted, bytes_of(plan.spheres, 16)),
        (Slot::SortedCells, bytes_of(plan.spheres, 4)),
        (Slot::Order, bytes_of(plan.spheres, 4)),
        (Slot::Sums, bytes_of(sums, 8)),
        (Slot::Total, 16),
        (Slot::Crowded, bytes_of(plan.spheres.div_ceil(k::GROUP), 4)),
        (Slot::Dispatch, 16),
    ];
    if species {
        buffers.push((Slot::SortedSpecies, bytes_of(plan.spheres, 4)));
    }
    buffers
}

pub(super) fn stages(plan: &Plan) -> Vec<Stage> {
    let per_sphere = plan.spheres.div_ceil(k::GROUP);
    let stage = |kernel, groups, phase| Stage { kernel, groups, indirect: false, phase, pass: 0 };
    let survey = plan.spheres.div_ceil(k::GROUP * SPHERES_PER_THREAD).clamp(1, SURVEY_GROUPS);
    let mut stages = vec![
        stage(&k::SPHERES_SURVEY, survey, Phase::Survey),
        stage(&k::LIST_CONFIGURE, 1, Phase::Survey),
        stage(&k::DENSITY_COUNT, per_sphere, Phase::Entries),
        stage(&k::HOMES_COUNT, per_sphere, Phase::Entries),
    ];
    stages.extend(scan_stages(plan.counters, 0));
    stages.extend([
        stage(&k::SPHERES_PLACE, per_sphere, Phase::Sort),
        stage(&k::LIST_SEARCH, per_sphere, Phase::Search),
        stage(&k::SHARES_OPEN, 1, Phase::Search),
        Stage { indirect: true, ..stage(&k::SHARES_SEARCH, 1, Phase::Search) },
    ]);
    stages
}
