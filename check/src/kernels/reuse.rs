//! Calls with the cells of an earlier call for other spheres.

use bytemuck::Zeroable;
use lazygrid::Sphere;
use lazygrid::gpu::{GpuDevice, Outcome};
use lazygrid_kernels::kernel::{self as k, Variant};
use lazygrid_kernels::layout::{RadixPass, SearchParams, SortCounts};

use super::cells::{CellListCase, ConfiguredCellList, LEVEL_WITHOUT_CELLS, level_of, numbers};
use super::division::Division;
use super::kernel_call::KernelCall;
use super::support::{KernelError, changed, same};
use crate::{Random, TestInput};

const SPHERES: u32 = 2000;
/// Maximum numbers of spheres in a cell and of listed spheres.
const LIMITS: [u32; 2] = [64, 8];

type Change = (&'static str, fn(&mut [Sphere]));

const CHANGES: [Change; 19] = [
    ("no change", |_| ()),
    ("a step", |spheres| shift(spheres, 0.3)),
    ("positions a little below the bounds", |spheres| shift(spheres, -4.0)),
    ("positions below the bounds", |spheres| shift(spheres, -1000.0)),
    ("positions above the bounds", |spheres| shift(spheres, 1000.0)),
    ("a sphere far below the bounds", |spheres| spheres[7].center.x = -1e12),
    ("positions that share cells", |spheres| shift(spheres, 1e9)),
    ("a larger radius", |spheres| spheres[0].radius = 0.51),
    ("a radius above its level's", |spheres| spheres[0].radius = 0.9),
    ("a smaller radius", |spheres| spheres[0].radius = 0.015),
    ("a radius below the ordinary range", |spheres| spheres[0].radius = 0.0),
    ("a position beyond the ordinary range", |spheres| spheres[0].center.y = 1e18),
    ("eight listed spheres", |spheres| spheres[..8].iter_mut().for_each(|sphere| sphere.radius = 5.0)),
    ("nine listed spheres", |spheres| spheres[..9].iter_mut().for_each(|sphere| sphere.radius = 5.0)),
    ("a NaN", |spheres| spheres[9].center.z = f32::NAN),
    ("an infinite radius", |spheres| spheres[9].radius = f32::INFINITY),
    ("a negative radius", |spheres| spheres[9].radius = -1.0),
    ("64 spheres at one point", |spheres| gather(&mut spheres[..64])),
    ("all spheres at one point", gather),
];

fn shift(spheres: &mut [Sphere], by: f32) {
    spheres.iter_mut().for_each(|sphere| sphere.center += by);
}

fn gather(spheres: &mut [Sphere]) {
    // No cell begins there, and no other sphere is near.
    spheres.iter_mut().for_each(|sphere| sphere.center = [40.01; 3].into());
}

fn cases() -> impl Iterator<Item = CellListCase> {
    let spaces = [[None; 3], [Some(120.0), None, Some(130.5)]];
    let divisions = [Division::OneSet, Division::TwoSets, Division::Species { meets_itself: true }];
    divisions.into_iter().flat_map(move |division| {
        let case =
            move |lengths, is_overfull| CellListCase { spheres: SPHERES, lengths, is_overfull, division };
        spaces
            .into_iter()
            .flat_map(move |lengths| [false, true].map(|is_overfull| case(lengths, is_overfull)))
    })
}

fn sparse() -> Vec<Sphere> {
    let mut random = Random(5);
    let radius = |k: u32| [0.5, 0.2, 0.06, 0.025, 0.013][k as usize % 5];
    (0..SPHERES).map(|k| Sphere::new([(); 3].map(|()| (random.unit() - 0.5) * 30.0), radius(k))).collect()
}

/// Returns `true` if the cells suit the spheres, apart from occupancies.
fn suits(chosen: &ConfiguredCellList, count: u32, spheres: &[Sphere]) -> bool {
    let ConfiguredCellList { list, division, call, scenario, .. } = chosen;
    let suits_one = |id: usize| {
        let Sphere { center, radius } = spheres[id];
        if !chosen.may_pair(id) || !spheres[id].is_valid() {
            return spheres[id].is_valid();
        }
        let is_ordinary =
            radius > 1e-12 && radius < 2e17 && center.to_array().into_iter().all(|x| x.abs() < 2e17);
        let level = level_of(list, radius);
        if level == LEVEL_WITHOUT_CELLS {
            return is_ordinary;
        }
        let is_overfull = list.has_overfull_cells != 0;
        let first = division.levels_per_side() * division.side(id, spheres.len());
        let level = first + if is_overfull { level } else { 0 };
        let has_cells = list.levels >> level & 1 == 1 && radius <= list.level[level].max_radius;
        let lengths = scenario.space.lengths();
        let is_above = || {
            let at = numbers(list, scenario.space, chosen.wrapped_center(&spheres[id]), level, true);
            (0..3).all(|axis| lengths[axis].is_some() || at[axis] as i32 >= 8)
        };
        is_ordinary && has_cells && !(is_overfull && call.occupancy_slots != 0) && is_above()
    };
    count == list.spheres && (0..spheres.len()).all(suits_one)
}

fn are_within_capacity(chosen: &ConfiguredCellList, cells: &[u32]) -> bool {
    let mut counts = vec![0; chosen.list.cells as usize + 2];
    cells.iter().for_each(|&cell| counts[cell as usize] += 1);
    let [most, most_listed] = LIMITS;
    let (most, in_cells) = (most.min(chosen.call.tau), chosen.list.cells as usize);
    counts[..in_cells].iter().all(|&count| count <= most) && counts[in_cells] <= most_listed
}

pub(crate) fn reused_cells(gpu: &GpuDevice) -> Result<(), KernelError> {
    let mut refused = [0; 2];
    for (case, (what, change)) in cases().flat_map(|case| CHANGES.map(|change| (case, change))) {
        for (occupancy_slots, count) in [(0, SPHERES), (512, SPHERES), (0, SPHERES - 1)] {
            let chosen = case.choose_for(gpu, sparse())?;
            let mut spheres = chosen.scenario.spheres.clone();
            change(&mut spheres);
            let call = SearchParams { occupancy_slots, ..chosen.call };
            let variant = Variant { reuse: true, ..chosen.variant };
            let scenario = TestInput { spheres, ..chosen.scenario.clone() };
            let after = ConfiguredCellList { call, scenario, variant, ..chosen };
            let text = || format!("{what}, {count} spheres, {occupancy_slots} counters, {case:?}");
            let suits = suits(&after, count, &after.scenario.spheres);
            let reused = ReuseCase { gpu, chosen: &after, count };
            let cells = reused.counted(suits, text)?;
            reused.sorted(suits, &cells, text)?;
            refused[usize::from(suits && are_within_capacity(&after, &cells))] += 1;
        }
    }
    same(|| format!("{refused:?} calls refused and not"), &refused.iter().all(|&calls| calls > 30), &true)
}

struct ReuseCase<'a> {
    gpu: &'a GpuDevice,
    chosen: &'a ConfiguredCellList,
    count: u32,
}

impl ReuseCase<'_> {
    fn refusal(&self, suits: bool, cells: &[u32]) -> u32 {
        if suits && are_within_capacity(self.chosen, cells) { 0 } else { Outcome::OVERFLOW_LAYOUT }
    }

    fn counted(&self, suits: bool, what: impl Fn() -> String) -> Result<Vec<u32>, KernelError> {
        let Self { gpu, chosen, count } = *self;
        let ConfiguredCellList { call, scenario, list, variant, division, .. } = chosen;
        let call = KernelCall::new(gpu)
            .with("params", &[*call])?
            .with_layout("cell_list", list)?
            .with("count_source", &[count])?
            .with("spheres", &scenario.spheres)?
            .with("occupancy", &[0_u32; 512])?
            .with("outcome", &[Outcome::zeroed()])?
            .with_zeros::<u32>("starts", list.cells as usize + 2)?
            .with_zeros::<[u32; 2]>("cell_ranks", SPHERES as usize)?;
        let call = division.bind(call, scenario.spheres.len())?;
        call.run(&k::CELLS_COUNT, *variant, SPHERES.div_ceil(k::WORKGROUP_SIZE))?;
        let found = call.read::<[u32; 2]>("cell_ranks", SPHERES as usize)?;
        let cells: Vec<u32> = found.into_iter().map(|[cell, _]| cell).collect();
        if suits {
            let of_each = |fused| chosen.assigned_cells(&[u32::MAX], fused).0;
            ConfiguredCellList::agrees(|| format!("cells: {}", what()), &cells, of_each)?;
        }
        let overflow = call.read_one::<Outcome>("outcome")?.overflow;
        same(|| format!("ranks: {}", what()), &overflow, &self.refusal(suits, &cells))?;
        Ok(cells)
    }

    fn sorted(&self, suits: bool, cells: &[u32], what: impl Fn() -> String) -> Result<(), KernelError> {
        let Self { gpu, chosen, count } = *self;
        let ConfiguredCellList { call, scenario, list, variant, division, .. } = chosen;
        let tiles = SPHERES.div_ceil(k::RADIX_TILE);
        let before = changed(Outcome::zeroed(), |new| {
            new.found_lo = 9;
            new.quarantined = 2;
            new.deferred_blocks = 4;
            new.dispatch_z = 1;
        });
        let call = KernelCall::new(gpu)
            .with("params", &[*call])?
            .with("digit_pass", &[RadixPass { shift: 0, mask: 255, is_first: 1 }])?
            .with_layout("cell_list", list)?
            .with("sort_counts", &[SortCounts { items: SPHERES, counters: 256 * tiles }])?
            .with("count_source", &[count])?
            .with("spheres", &scenario.spheres)?
            .with("occupancy", &[0_u32; 512])?
            .with("outcome", &[before])?
            .with_zeros::<u32>("keys", SPHERES as usize)?
            .with_zeros::<u32>("counts", 256 * tiles as usize)?;
        let call = division.bind(call, scenario.spheres.len())?;
        call.run(&k::CELLS_KEY, *variant, tiles)?;
        same(&what, &call.read::<u32>("keys", SPHERES as usize)?, &cells.to_vec())?;
        let overflow = call.read_one::<Outcome>("outcome")?.overflow;
        same(|| format!("keys: {}", what()), &overflow, &if suits { 0 } else { Outcome::OVERFLOW_LAYOUT })?;

        let mut order: Vec<u32> = (0..SPHERES).collect();
        order.sort_by_key(|&id| cells[id as usize]);
        let sorted_cells: Vec<u32> = order.iter().map(|&id| cells[id as usize]).collect();
        let call = call
            .with("cells", &sorted_cells)?
            .with("order", &order)?
            .with_zeros::<[u32; 4]>("sorted", SPHERES as usize)?
            .with_zeros::<u32>("sorted_species", SPHERES as usize)?;
        call.run(&k::SPHERES_GATHER, *variant, SPHERES.div_ceil(k::WORKGROUP_SIZE))?;
        let expected = initial_outcome(self.refusal(suits, cells));
        same(|| format!("gathered: {}", what()), &call.read_one::<Outcome>("outcome")?, &expected)
    }
}

pub(crate) fn initial_outcome(overflow: u32) -> Outcome {
    changed(Outcome::zeroed(), |new| {
        new.overflow = overflow;
        new.entries_lo = SPHERES;
        new.spheres = SPHERES;
        new.dispatch_y = 1;
        new.dispatch_z = 1;
    })
}
