use bytemuck::Zeroable;
use lazygrid::Sphere;
use lazygrid::gpu::{GpuDevice, Outcome};
use lazygrid_kernels::kernel as k;
use lazygrid_kernels::layout::{CellListLayout, InputStats, RadixPass, SearchParams, SortCounts};

use super::cells::{
    CELL_CAPACITY, CellListCase, ConfiguredCellList, LEVEL_WITHOUT_CELLS, TAU, cases, level_of, numbers,
};
use super::division::Division;
use super::kernel_call::KernelCall;
use super::support::{KernelError, changed, same};

pub(crate) fn cell_list_configure(gpu: &GpuDevice) -> Result<(), KernelError> {
    for case in cases() {
        let chosen = case.choose(gpu)?;
        let ConfiguredCellList { list, scenario, outcome, .. } = &chosen;
        let what = |what: &str| format!("{what}, {case:?}");
        let bad = scenario.spheres.iter().filter(|sphere| !sphere.is_valid()).count() as u32;
        let initial_outcome = changed(Outcome::zeroed(), |new| {
            new.quarantined = bad;
            new.entries_lo = case.spheres;
            new.spheres = case.spheres;
            new.dispatch_y = 1;
            new.dispatch_z = 1;
        });
        same(|| what("outcome"), outcome, &initial_outcome)?;
        same(|| what("statistics are cleared"), &(chosen.stats == InputStats::zeroed()), &true)?;
        same(|| what("spheres"), &list.spheres, &case.spheres)?;
        let ordinary = bad < case.spheres;
        same(|| what("ordinary"), &(list.ordinary != 0), &ordinary)?;
        let is_overfull = case.is_overfull && case.spheres > 1;
        same(|| what("spheres leave cells"), &(list.has_overfull_cells != 0), &is_overfull)?;
        let lengths = SortCounts { items: case.spheres, counters: list.cells + 2 };
        same(|| what("lengths"), &chosen.lengths, &lengths)?;
        levels_are_sound(&chosen, case)?;
        levels_look_once(&chosen, case)?;
        touching_spheres_are_in_adjacent_cells(&chosen, case)?;
    }
    first_calls_miss_no_crowd(gpu)
}

/// One sphere of each crowd is sampled: a first call looks again, a later one uses the last occupancy.
fn first_calls_miss_no_crowd(gpu: &GpuDevice) -> Result<(), KernelError> {
    const SPHERES: u32 = 20_000;
    let sphere = |k: u32| {
        let crowd = (256 * k + SPHERES / 2) / SPHERES;
        let [x, y] = [crowd % 16, crowd / 16].map(|number| 9.0 * number as f32);
        Sphere::new([x, y, 0.0], if k.is_multiple_of(2) { 1.0 } else { 0.1 })
    };
    for (before, expected) in [
        (Outcome::zeroed(), true),
        (changed(Outcome::zeroed(), |new| new.dispatch_z = 1), false),
        (
            changed(Outcome::zeroed(), |new| {
                new.dispatch_z = 1;
                new.max_occupancy = 9;
            }),
            true,
        ),
    ] {
        let division = Division::OneSet;
        let case = CellListCase { spheres: SPHERES, lengths: [None; 3], is_overfull: false, division };
        let chosen = case.choose_after(gpu, (0..SPHERES).map(sphere).collect(), 0, before)?;
        same(
            || format!("crowds of {case:?} after {before:?}"),
            &(chosen.list.has_overfull_cells != 0),
            &expected,
        )?;
    }
    Ok(())
}

fn levels_are_sound(chosen: &ConfiguredCellList, case: CellListCase) -> Result<(), KernelError> {
    let ConfiguredCellList { list, scenario, .. } = chosen;
    let mut base = 0;
    for (level, level_layout) in list.level.iter().enumerate() {
        let what = || format!("level {level} of {level_layout:?}, {} quanta, {case:?}", list.units_per_cell);
        let is_used = list.levels >> level & 1 == 1;
        same(what, &(level_layout.cells.x != 0), &is_used)?;
        if is_used {
            same(what, &level_layout.base, &base)?;
            same(what, &level_layout.cells.to_array().iter().all(|&cells| cells == 1 || cells > 2), &true)?;
            let cell_size = list.units_per_cell as f32 / level_layout.units_per_length;
            let finer = level_layout.units_per_length / list.level[0].units_per_length;
            let radius_is_finer = list.level[0].max_radius / level_layout.max_radius == finer;
            let is_cell_size = (64..=127).contains(&list.units_per_cell)
                && radius_is_finer
                && (2.0 * level_layout.max_radius..2.1 * level_layout.max_radius).contains(&cell_size);
            same(what, &is_cell_size, &true)?;
            // At the coordinate `far`, the number of units reaches 2³⁰.
            same(
                what,
                &(f32::from_bits(level_layout.far) * level_layout.units_per_length),
                &((1_u32 << 30) as f32),
            )?;
            for (axis, length) in scenario.space.lengths().into_iter().enumerate() {
                let (cells, around) = (level_layout.cells[axis], level_layout.around[axis]);
                let fits =
                    |around: u32, cell_size: f64| length.is_some_and(|l| l / f64::from(around) >= cell_size);
                let is_wide = around == 1 || (fits(around, cell_size.into()) && around.is_multiple_of(cells));
                let can_grow = cells > 1 && around + cells <= 32_768;
                let is_full = !(can_grow && fits(around + cells, 1.001 * f64::from(cell_size)));
                same(what, &(is_wide, is_full), &(true, true))?;
            }
            base += level_layout.cells.element_product();
        }
    }
    let what = |what: &str| format!("{what}, {case:?}");
    same(|| what("cells in all"), &list.cells, &base)?;
    same(|| what("cells fit the capacity"), &(list.cells <= CELL_CAPACITY && list.levels & 1 == 1), &true)?;
    let valid = || (0..scenario.spheres.len()).filter(|&id| chosen.may_pair(id));
    let without_cells = valid().filter(|&id| chosen.own_level(id) == LEVEL_WITHOUT_CELLS).count();
    let is_few = without_cells <= 8 || valid().count() == without_cells;
    same(|| what("few spheres have no cells"), &is_few, &true)?;
    levels_are_those_of_their_spheres(chosen, case)
}

/// Each occurring depth is a level of every side, if the side has enough levels.
fn levels_are_those_of_their_spheres(
    chosen: &ConfiguredCellList,
    case: CellListCase,
) -> Result<(), KernelError> {
    let ConfiguredCellList { list, scenario, division, .. } = chosen;
    let per_side = division.levels_per_side();
    let fits = |radius: f32, depth: i32| radius <= list.level[0].max_radius * (-depth as f32).exp2();
    let depth_of =
        |radius: f32| (1..CellListLayout::DEPTHS as i32).take_while(|&depth| fits(radius, depth)).count();
    let with_cells = (0..scenario.spheres.len())
        .filter(|&id| chosen.may_pair(id) && chosen.own_level(id) != LEVEL_WITHOUT_CELLS);
    let with_cells: Vec<(usize, f32)> =
        with_cells.map(|id| (division.side(id, scenario.spheres.len()), chosen.radius(id))).collect();
    let mut depths: Vec<usize> = with_cells.iter().map(|&(_, radius)| depth_of(radius)).chain([0]).collect();
    depths.sort_unstable();
    depths.dedup();
    let level_of_depth = |number: usize| number * per_side / depths.len().max(per_side);
    for &(side, radius) in &with_cells {
        let number = depths.partition_point(|&depth| depth < depth_of(radius));
        let level = level_of_depth(number);
        let what = || format!("level of {radius} on side {side}, {case:?}");
        same(what, &level_of(list, radius), &level)?;
        let level_layout =
            &list.level[side * per_side + if list.has_overfull_cells == 0 { 0 } else { level }];
        let first =
            (0..=number).find(|&number| level_of_depth(number) == level).map_or(0, |first| depths[first]);
        let depth = if list.has_overfull_cells == 0 { 0 } else { first };
        let expected = list.level[0].max_radius * (-(depth as f32)).exp2();
        same(
            what,
            &(level_layout.cells.x != 0, level_layout.max_radius, radius <= level_layout.max_radius),
            &(true, expected, true),
        )?;
    }
    Ok(())
}

/// One of two meeting levels searches the other, whose cells are at least as large.
fn levels_look_once(chosen: &ConfiguredCellList, case: CellListCase) -> Result<(), KernelError> {
    let list = &chosen.list;
    let looks = |from: usize, at: usize| list.level[from].searched_levels >> at & 1;
    let used = || (0..list.level.len()).filter(|level| list.levels >> level & 1 == 1);
    for a in used() {
        let what = |b: usize| format!("levels {a} and {b} of {:b}, {case:?}", list.levels);
        let per_side = case.division.levels_per_side();
        let groups_pair = |b: usize| u32::from(case.division.groups_pair(a / per_side, b / per_side));
        same(|| what(a), &(list.level[a].searches_itself, looks(a, a)), &(groups_pair(a), 0))?;
        same(|| what(a), &(list.level[a].searched_levels & !list.levels), &0)?;
        for b in used().filter(|&b| b > a) {
            same(|| what(b), &(looks(a, b) + looks(b, a)), &groups_pair(b))?;
            let is_coarser =
                |from: usize, at: usize| looks(from, at) == 0 || at % per_side <= from % per_side;
            same(|| what(b), &(is_coarser(a, b) && is_coarser(b, a)), &true)?;
        }
    }
    Ok(())
}

/// Spheres that pair at a distance are exempt.
fn touching_spheres_are_in_adjacent_cells(
    chosen: &ConfiguredCellList,
    case: CellListCase,
) -> Result<(), KernelError> {
    let ConfiguredCellList { list, scenario, .. } = chosen;
    if matches!(case.division, Division::NarrowSide { .. }) {
        return Ok(());
    }
    let step = scenario.spheres.len().div_ceil(500);
    let valid = scenario.only(|k| scenario.spheres[k].is_valid() && k.is_multiple_of(step));
    for pair in valid.oracle() {
        let (a, b) = (&valid.spheres[pair.i as usize], &valid.spheres[pair.j as usize]);
        let levels = [a, b].map(|sphere| level_of(list, sphere.radius));
        if levels.contains(&LEVEL_WITHOUT_CELLS) {
            continue;
        }
        let last_level = if levels[0] == levels[1] && list.has_overfull_cells != 0 { levels[0] } else { 0 };
        let first_of_side = (0..chosen.division.sides()).map(|side| side * chosen.division.levels_per_side());
        for level in first_of_side.flat_map(|first| [first, first + last_level]) {
            if list.level[level].cells.x == 0 {
                continue;
            }
            let at = |sphere| numbers(list, scenario.space, chosen.wrapped_center(sphere), level, true);
            let (of_a, of_b) = (at(a), at(b));
            let is_near = (0..3).all(|axis| {
                let apart = of_a[axis].abs_diff(of_b[axis]);
                let around = list.level[level].around[axis];
                apart <= 1 || (scenario.space.lengths()[axis].is_some() && apart + 1 >= around)
            });
            same(
                || format!("{a:?} in {of_a:?}, {b:?} in {of_b:?}, level {level}, {case:?}"),
                &is_near,
                &true,
            )?;
        }
    }
    Ok(())
}

pub(crate) fn occupancy_count(gpu: &GpuDevice) -> Result<(), KernelError> {
    for case in cases() {
        let chosen = case.choose(gpu)?;
        let ConfiguredCellList { call, scenario, list, variant, .. } = &chosen;
        let slots = call.occupancy_slots as usize;
        for groups in [1, case.spheres.div_ceil(k::WORKGROUP_SIZE)] {
            let call = KernelCall::new(gpu)
                .with("params", &[*call])?
                .with_layout("cell_list", list)?
                .with("spheres", &scenario.spheres)?
                .with_zeros::<u32>("occupancy", slots)?;
            let call = case.division.bind(call, scenario.spheres.len())?;
            call.run(&k::OCCUPANCY_COUNT, *variant, groups)?;
            let found = call.read::<u32>("occupancy", slots)?;
            let case = || format!("{groups} workgroups, {case:?}");
            ConfiguredCellList::agrees(case, &found, |fused| chosen.occupancy(fused))?;
        }
    }
    Ok(())
}

/// Each sphere gets its cell and a distinct rank in it.
pub(crate) fn cells_count(gpu: &GpuDevice) -> Result<(), KernelError> {
    for case in cases() {
        let chosen = case.choose(gpu)?;
        let ConfiguredCellList { call, scenario, list, variant, .. } = &chosen;
        let (table, call) = (chosen.occupancy(true), SearchParams { tau: TAU, ..*call });
        let call = KernelCall::new(gpu)
            .with("params", &[call])?
            .with_layout("cell_list", list)?
            .with("count_source", &[call])?
            .with("spheres", &scenario.spheres)?
            .with("occupancy", &table)?
            .with("outcome", &[Outcome::zeroed()])?
            .with_zeros::<u32>("starts", list.cells as usize + 2)?
            .with_zeros::<[u32; 2]>("cell_ranks", case.spheres as usize)?;
        let call = case.division.bind(call, scenario.spheres.len())?;
        call.run(&k::CELLS_COUNT, *variant, case.spheres.div_ceil(k::WORKGROUP_SIZE))?;
        let mut found = call.read::<[u32; 2]>("cell_ranks", case.spheres as usize)?;
        let cells = found.iter().map(|&[cell, _]| cell).collect();
        let what = |what: &str| format!("{what}, {case:?}");
        ConfiguredCellList::agrees(|| what("cells"), &cells, |fused| chosen.assigned_cells(&table, fused).0)?;
        let counts = call.read::<u32>("starts", list.cells as usize + 2)?;
        let mut expected = vec![0; counts.len()];
        cells.iter().for_each(|&cell| expected[cell as usize] += 1);
        same(|| what("spheres of each cell"), &counts, &expected)?;
        found.sort_unstable();
        let expected_ranks =
            (0_u32..).zip(&counts).flat_map(|(cell, &count)| (0..count).map(move |at| [cell, at]));
        same(|| what("ranks in cells"), &found, &expected_ranks.collect())?;
        let max_occupancy = call.read_one::<Outcome>("outcome")?.max_occupancy;
        if list.has_overfull_cells == 1 {
            ConfiguredCellList::agrees(
                || what("the fullest cell"),
                &max_occupancy,
                |fused| chosen.assigned_cells(&table, fused).1,
            )?;
        } else {
            let small =
                |id: usize| chosen.may_pair(id) && ![0, LEVEL_WITHOUT_CELLS].contains(&chosen.own_level(id));
            let mut smaller = vec![0; counts.len()];
            (0..cells.len()).filter(|&id| small(id)).for_each(|id| smaller[cells[id] as usize] += 1);
            let [least, most] = [&smaller, &counts].map(|counts| counts.iter().copied().max().unwrap_or(0));
            let is_told = if max_occupancy == 0 {
                least <= TAU
            } else {
                (least.max(TAU + 1)..=most).contains(&max_occupancy)
            };
            same(|| format!("{max_occupancy} of {least} to {most} in a cell, {case:?}"), &is_told, &true)?;
        }
    }
    Ok(())
}

pub(crate) fn cells_key(gpu: &GpuDevice) -> Result<(), KernelError> {
    for case in cases() {
        let chosen = case.choose(gpu)?;
        let ConfiguredCellList { call, scenario, list, variant, .. } = &chosen;
        let (table, tile) = (chosen.occupancy(true), k::RADIX_TILE);
        let tiles = case.spheres.div_ceil(tile);
        let pass = RadixPass { shift: 0, mask: 255, is_first: 1 };
        let lengths = SortCounts { items: case.spheres, counters: 256 * tiles };
        let call = KernelCall::new(gpu)
            .with("params", &[*call])?
            .with("digit_pass", &[pass])?
            .with_layout("cell_list", list)?
            .with("sort_counts", &[lengths])?
            .with("count_source", &[*call])?
            .with("spheres", &scenario.spheres)?
            .with("occupancy", &table)?
            .with("outcome", &[Outcome::zeroed()])?
            .with_zeros::<u32>("keys", case.spheres as usize)?
            .with("counts", &vec![7_u32; 256 * tiles as usize])?;
        let call = case.division.bind(call, scenario.spheres.len())?;
        call.run(&k::CELLS_KEY, *variant, tiles)?;
        let found = call.read::<u32>("keys", case.spheres as usize)?;
        let what = |what: &str| format!("{what}, {case:?}");
        ConfiguredCellList::agrees(|| what("keys"), &found, |fused| chosen.assigned_cells(&table, fused).0)?;
        let mut expected = vec![0_u32; 256 * tiles as usize];
        for (tile, keys) in found.chunks(tile as usize).enumerate() {
            keys.iter().for_each(|key| expected[(key & 255) as usize * tiles as usize + tile] += 1);
        }
        same(|| what("digits"), &call.read::<u32>("counts", expected.len())?, &expected)?;
        let max_occupancy = call.read_one::<Outcome>("outcome")?.max_occupancy;
        ConfiguredCellList::agrees(
            || what("the fullest cell"),
            &max_occupancy,
            |fused| chosen.assigned_cells(&table, fused).1,
        )?;
    }
    Ok(())
}
