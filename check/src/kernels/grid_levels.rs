use std::collections::HashMap;

use bytemuck::Zeroable;
use glam::{IVec3, UVec3, Vec3};
use lazygrid::Sphere;
use lazygrid::gpu::{GpuDevice, Outcome};
use lazygrid_kernels::kernel::{self as k, Variant};
use lazygrid_kernels::layout::{Bounds, Grid, LevelKeys, SearchParams};

use super::kernel_call::KernelCall;
use super::support::{KernelError, SIZES, same, variants};
use crate::Random;

const HAS_OWN: u32 = 1 << 31;
const SLOTS: u32 = 4096;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Cells {
    first: [i32; 3],
    more: [i32; 3],
    depth: u32,
}

impl Cells {
    fn packed(self) -> [u32; 2] {
        let [x, y, z] = self.first.map(|c| u64::from(c as u32 & 0x3ffff));
        let more = (0..3).fold(0, |bits, axis| bits | (self.more[axis] as u64) << axis);
        let word = x | y << 18 | z << 36 | more << 54 | u64::from(self.depth) << 57;
        [word as u32, (word >> 32) as u32]
    }

    fn at(self, depth: u32) -> Self {
        let shift = self.depth - depth;
        let first = self.first.map(|c| c >> shift);
        let more = [0, 1, 2].map(|axis| ((self.first[axis] + self.more[axis]) >> shift) - first[axis]);
        Self { first, more, depth }
    }

    fn all(self) -> impl Iterator<Item = [i32; 3]> {
        let [x, y, z] = [0, 1, 2].map(|axis| self.first[axis]..=self.first[axis] + self.more[axis]);
        let rows = z.flat_map(move |z| y.clone().map(move |y| [y, z]));
        rows.flat_map(move |[y, z]| x.clone().map(move |x| [x, y, z]))
    }
}

/// Powers of two avoid rounding.
fn grid(spheres: usize, split_policy: u32) -> Grid {
    let mut grid = Grid {
        inverse_edge: Vec3::splat(0.125),
        low: IVec3::splat(-1024),
        high: IVec3::splat(1023),
        spheres: spheres as u32,
        split_policy,
        level_mask: 1,
        depth_mask: 1,
        ..Grid::zeroed()
    };
    grid.levels[0] = LevelKeys { bits: UVec3::splat(8), base: 0 };
    grid
}

fn call(split_policy: u32, tau: u32) -> SearchParams {
    SearchParams {
        cell_ratio: 2.0,
        key_bits: 24,
        split_policy,
        tau,
        occupancy_slots: SLOTS,
        entry_capacity: 1 << 20,
        ..SearchParams::zeroed()
    }
}

fn spheres(count: usize) -> Vec<Sphere> {
    let mut random = Random(count as u64);
    let mut coordinate = || (random.word() % 1024) as f32 / 8.0 - 64.0;
    (0..count)
        .map(|i| {
            let center = if i % 3 == 0 { [1.0; 3] } else { [coordinate(), coordinate(), coordinate()] };
            Sphere::new(center, 1.75 / (1 << ((i * 7 + i / 8) % 8)) as f32)
        })
        .collect()
}

fn cells_plain(sphere: &Sphere) -> Cells {
    let center = sphere.center.to_array();
    let largest = center.iter().fold(0.0_f32, |most, c| most.max(c.abs())) * 0.125;
    let diameter = 2.0 * sphere.radius * 0.125;
    let width = diameter + (diameter + 2.0 * largest) * 2_f32.powi(-20);
    let exponent = |value: f32| (value.to_bits() >> 23) as i32 - 127;
    let depth = (-1 - exponent(2.0 * width)).min(15 - exponent(largest)).clamp(0, 31);
    let cell = |c: f32, sign: f32| {
        let half = sphere.radius + (c.abs() * 2_f32.powi(-21) + sphere.radius * 2_f32.powi(-21));
        ((c + sign * half) * 0.125 * 2_f32.powi(depth)).floor() as i32
    };
    let first = center.map(|c| cell(c, -1.0));
    let last = center.map(|c| cell(c, 1.0));
    Cells { first, more: [0, 1, 2].map(|axis| last[axis] - first[axis]), depth: depth as u32 }
}

fn slot(depth: u32, [x, y, z]: [i32; 3]) -> usize {
    let [x, y, z] = [
        (x as u32).wrapping_mul(0x9e37_79b1),
        (y as u32).wrapping_mul(0x85eb_ca6b),
        (z as u32).wrapping_mul(0xc2b2_ae35),
    ];
    let mixed = x ^ y.rotate_right(7) ^ z.rotate_right(15);
    let mut hash = mixed.wrapping_add(depth.wrapping_mul(0x27d4_eb2f));
    hash = (hash ^ (hash >> 15)).wrapping_mul(0x2c1b_3c6d);
    hash ^= hash >> 13;
    ((hash & (SLOTS - 1)) + if depth == 0 { 0 } else { SLOTS }) as usize
}

fn add(occupancy: &mut [u32], depth: u32, cell: [i32; 3], is_own: bool) {
    let counter = &mut occupancy[slot(depth, cell)];
    *counter = if is_own { *counter | HAS_OWN } else { *counter + 1 };
}

fn is_overfull(counter: u32, tau: u32) -> bool {
    counter & !HAS_OWN > tau
}

fn expected_occupancy(cells: &[Cells], tau: u32) -> (Vec<u32>, Vec<u32>) {
    let mut first = vec![0; 2 * SLOTS as usize];
    for sphere_cells in cells {
        sphere_cells.at(0).all().for_each(|cell| add(&mut first, 0, cell, sphere_cells.depth == 0));
    }
    let mut all = first.clone();
    for sphere_cells in cells {
        for depth in 1..=sphere_cells.depth {
            for cell in sphere_cells.at(depth).all() {
                if is_overfull(first[slot(0, cell.map(|c| c >> depth))], tau) {
                    add(&mut all, depth, cell, depth == sphere_cells.depth);
                }
            }
        }
    }
    (first, all)
}

fn depths_of(cells: &[Cells]) -> u32 {
    cells.iter().fold(0, |bits, sphere_cells| bits | 1 << sphere_cells.depth)
}

fn packed(cells: &[Cells]) -> Vec<[u32; 2]> {
    cells.iter().map(|sphere_cells| sphere_cells.packed()).collect()
}

pub(crate) fn occupancy_clear(gpu: &GpuDevice) -> Result<(), KernelError> {
    for slots in [1_u32, 256, 512, 8192] {
        for split_policy in [1, 2] {
            let call = KernelCall::new(gpu)
                .with("params", &[SearchParams { occupancy_slots: slots, ..call(split_policy, 0) }])?
                .with_layout("grid", &grid(1, split_policy))?
                .with("occupancy", &vec![7_u32; 2 * slots as usize + 3])?;
            call.run(&k::OCCUPANCY_CLEAR, Variant::default(), (2 * slots).div_ceil(k::OCCUPANCY_TILE))?;
            let found = call.read::<u32>("occupancy", 2 * slots as usize + 3)?;
            let cleared = if split_policy == 2 { 2 * slots as usize } else { 0 };
            let expected: Vec<u32> = (0..found.len()).map(|k| if k < cleared { 0 } else { 7 }).collect();
            same(|| format!("{slots} slots, split_policy {split_policy}"), &found, &expected)?;
        }
    }
    Ok(())
}

pub(crate) fn cells_find(gpu: &GpuDevice) -> Result<(), KernelError> {
    for size in SIZES {
        for split_policy in [0, 1, 2] {
            let mut spheres = spheres(size);
            let mut expected: Vec<Cells> = spheres.iter().map(cells_plain).collect();
            if split_policy == 0 {
                expected.iter_mut().for_each(|cells| *cells = cells.at(0));
            }
            let mut words = packed(&expected);
            if size > 300 {
                spheres[300].radius = f32::NAN;
                words[300] = [u32::MAX; 2];
                expected.remove(300);
            }
            let call = KernelCall::new(gpu)
                .with("params", &[call(split_policy, 0)])?
                .with_layout("grid", &grid(size, split_policy))?
                .with("spheres", &spheres)?
                .with("bounds", &[Bounds::zeroed()])?
                .with_zeros::<[u32; 2]>("cells", size)?
                .with_zeros::<u32>("occupancy", 2 * SLOTS as usize)?;
            call.run(&k::CELLS_FIND, Variant::default(), size.div_ceil(256) as u32)?;
            let case = |what: &str| format!("{what}, {size} spheres, split_policy {split_policy}");
            same(|| case("cells"), &call.read::<[u32; 2]>("cells", size)?, &words)?;
            let bounds = call.read_one::<Bounds>("bounds")?;
            let count_at = |depth: u32| {
                expected.iter().filter(|sphere_cells| sphere_cells.depth == depth).count() as u32
            };
            let counted =
                std::array::from_fn(|depth| if split_policy == 1 { count_at(depth as u32) } else { 0 });
            same(|| case("depths, counted"), &bounds.descending, &counted)?;
            let depths = if split_policy == 0 { 0 } else { depths_of(&expected) };
            same(|| case("depths"), &bounds.depth_mask, &depths)?;
            let table = if split_policy == 2 { expected.as_slice() } else { &[] };
            let found = call.read::<u32>("occupancy", 2 * SLOTS as usize)?;
            same(|| case("density"), &found, &expected_occupancy(table, 0).0)?;
        }
    }
    Ok(())
}

pub(crate) fn levels_count(gpu: &GpuDevice) -> Result<(), KernelError> {
    for size in SIZES {
        for tau in [0, 3, 400, u32::MAX] {
            let cells: Vec<Cells> = spheres(size).iter().map(cells_plain).collect();
            let (first, all) = expected_occupancy(&cells, tau);
            let mut bounds = Bounds { depth_mask: depths_of(&cells), ..Bounds::zeroed() };
            let call = KernelCall::new(gpu)
                .with("params", &[call(2, tau)])?
                .with_layout("grid", &grid(size, 2))?
                .with("bounds", &[bounds])?
                .with("cells", &packed(&cells))?
                .with("occupancy", &first)?;
            call.run(&k::LEVELS_COUNT, Variant::default(), size.div_ceil(256) as u32)?;
            let case = |what: &str| format!("{what}, {size} spheres, tau {tau}");
            same(|| case("density"), &call.read::<u32>("occupancy", all.len())?, &all)?;
            for sphere_cells in cells.iter().filter(|sphere_cells| sphere_cells.depth > 0) {
                let descends = sphere_cells.at(0).all().any(|cell| is_overfull(first[slot(0, cell)], tau));
                bounds.descending[sphere_cells.depth as usize] += u32::from(descends);
            }
            same(|| case("bounds"), &call.read_one::<Bounds>("bounds")?, &bounds)?;
        }
    }
    Ok(())
}

pub(crate) fn levels_assign_keys(gpu: &GpuDevice) -> Result<(), KernelError> {
    let mut random = Random(5);
    for key_bits in [16_u32, 24, 32] {
        for depths in [1_u32, 0b11, 0b1_0001, 1 << 31 | 1, u32::MAX, 0x0010_8002] {
            let mut bounds = Bounds { depth_mask: depths, ..Bounds::zeroed() };
            for depth in (0..32).filter(|depth| depths >> depth & 1 == 1) {
                bounds.descending[depth] = random.word() >> (8 + random.word() % 24);
            }
            let has_descending = bounds.descending[1..].iter().any(|&count| count > 0);
            let call = KernelCall::new(gpu)
                .with("params", &[SearchParams { key_bits, ..call(2, 0) }])?
                .with("bounds", &[bounds])?
                .with_layout("grid", &grid(1 << 20, 2))?;
            call.run(&k::LEVELS_ASSIGN_KEYS, Variant::default(), 1)?;
            let grid = call.read_layout::<Grid>("grid")?;
            let case = |what: &str| format!("{what}, {key_bits} bits, depths {depths:x}");
            if !has_descending {
                same(|| case("one level"), &[grid.split_policy, grid.level_mask, grid.passive], &[0, 1, 0])?;
                continue;
            }
            same(
                || case("levels"),
                &[grid.level_mask, grid.depth_mask, grid.passive],
                &[depths | 1, depths, 1],
            )?;
            let mut end = 0_u64;
            for depth in (0..32).filter(|depth| grid.level_mask >> depth & 1 == 1) {
                let LevelKeys { bits, base } = grid.levels[depth];
                same(|| case(&format!("the first key of depth {depth}")), &u64::from(base), &end)?;
                // With three bits per axis, a key repeats after eight cells.
                same(
                    || case(&format!("{bits:?} bits of three or more")),
                    &bits.cmpge(UVec3::splat(3)).all(),
                    &true,
                )?;
                end += 1 << bits.element_sum();
            }
            same(|| case(&format!("{end} keys fit")), &(end <= 1 << (key_bits - 1)), &true)?;
        }
    }
    Ok(())
}

fn expected_entries(cells: &[Cells], grid: &Grid, occupancy: &[u32], tau: u32) -> Vec<[u32; 2]> {
    let mut entries = Vec::new();
    for (index, sphere_cells) in cells.iter().enumerate() {
        let mut handed: HashMap<[i32; 3], bool> = HashMap::new();
        for depth in (0..=sphere_cells.depth).filter(|depth| grid.level_mask >> depth & 1 == 1) {
            let here = sphere_cells.at(depth);
            let above = (0..depth).rev().find(|depth| grid.level_mask >> depth & 1 == 1);
            let mut next = HashMap::new();
            for cell in here.all() {
                let parent = above.map(|above| cell.map(|c| c >> (depth - above)));
                if parent.is_some_and(|parent| !handed[&parent]) {
                    next.insert(cell, false);
                    continue;
                }
                let counter = occupancy[slot(depth, cell)];
                let refined =
                    depth < sphere_cells.depth && (grid.split_policy == 1 || is_overfull(counter, tau));
                let meets = if grid.split_policy == 1 {
                    grid.depth_mask >> depth & 1 == 1
                } else {
                    counter & HAS_OWN != 0
                };
                next.insert(cell, refined);
                if refined && !meets {
                    continue;
                }
                let LevelKeys { bits, base } = grid.levels[depth as usize];
                let folded = [0, 1, 2].map(|axis| cell[axis] as u32 & ((1 << bits[axis]) - 1));
                let key = base + (folded[0] | folded[1] << bits[0] | folded[2] << (bits[0] + bits[1]));
                let first = (0..3)
                    .fold(0, |flags, axis| flags | u32::from(cell[axis] == here.first[axis]) << (29 + axis));
                entries.push([key << grid.passive | u32::from(refined), index as u32 | first]);
            }
            handed = next;
        }
    }
    entries.sort_unstable();
    entries
}

pub(crate) fn entries_emit(gpu: &GpuDevice) -> Result<(), KernelError> {
    for variant in variants(gpu) {
        for (size, (split_policy, tau)) in SIZES.into_iter().flat_map(|size| {
            [(1, 0), (2, 0), (2, 3), (2, 400), (2, u32::MAX)].map(|settings| (size, settings))
        }) {
            let cells: Vec<Cells> = spheres(size).iter().map(cells_plain).collect();
            let (_, occupancy) = expected_occupancy(&cells, tau);
            let occupied = depths_of(&cells);
            let mut grid = Grid {
                level_mask: occupied | 1,
                depth_mask: occupied,
                passive: 1,
                ..grid(size, split_policy)
            };
            for depth in 0..32 {
                grid.levels[depth] = LevelKeys { bits: UVec3::new(3, 4, 5), base: (depth as u32) << 12 };
            }
            let call = KernelCall::new(gpu)
                .with("params", &[call(split_policy, tau)])?
                .with_layout("grid", &grid)?
                .with("cells", &packed(&cells))?
                .with("occupancy", &occupancy)?
                .with("outcome", &[Outcome::zeroed()])?
                .with_zeros::<u32>("keys", 1 << 20)?
                .with_zeros::<u32>("objects", 1 << 20)?;
            call.run(&k::ENTRIES_EMIT, variant, size.div_ceil(256) as u32)?;
            let count = call.read_one::<Outcome>("outcome")?.entries_needed() as usize;
            let [keys, objects] = [call.read::<u32>("keys", count)?, call.read::<u32>("objects", count)?];
            let mut found: Vec<[u32; 2]> = keys.into_iter().zip(objects).map(|(k, o)| [k, o]).collect();
            found.sort_unstable();
            let expected = expected_entries(&cells, &grid, &occupancy, tau);
            let case = || format!("{size} spheres, split_policy {split_policy}, tau {tau}, {variant:?}");
            same(case, &found, &expected)?;
        }
    }
    Ok(())
}
