use bytemuck::Zeroable;
use glam::Vec3;
use lazygrid::gpu::{GpuDevice, Outcome};
use lazygrid::{Space, Sphere};
use lazygrid_kernels::kernel::{self as k, Variant};
use lazygrid_kernels::layout::{CellListLayout, InputStats, SearchParams, SortCounts};

use super::cell_list::expected_stats;
use super::division::Division;
use super::kernel_call::KernelCall;
use super::support::{KernelError, changed, same};
use crate::scenes::periodic;
use crate::{Random, TestInput};

pub(crate) const CELL_CAPACITY: u32 = 4096;
/// Level of the size classes without cells, whose spheres are listed.
pub(crate) const LEVEL_WITHOUT_CELLS: usize = 255;
/// Largest occupancy at which smaller spheres stay in a coarse cell.
pub(crate) const TAU: u32 = 8;

#[derive(Clone)]
pub(crate) struct ConfiguredCellList {
    pub(crate) call: SearchParams,
    pub(crate) scenario: TestInput,
    pub(crate) division: Division,
    pub(crate) list: CellListLayout,
    pub(crate) variant: Variant,
    pub(crate) lengths: SortCounts,
    pub(crate) outcome: Outcome,
    pub(crate) stats: InputStats,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct CellListCase {
    pub(crate) spheres: u32,
    pub(crate) lengths: [Option<f32>; 3],
    pub(crate) is_overfull: bool,
    pub(crate) division: Division,
}

pub(crate) fn cases() -> impl Iterator<Item = CellListCase> {
    let spaces = [[None; 3], [Some(20.0), None, Some(24.5)], [Some(0.75); 3]];
    let species = [false, true].map(|meets_itself| Division::Species { meets_itself });
    let pairs = [2, 3, 4].map(Division::DisjointPairs);
    let narrow = [false, true].map(|two_sets| Division::NarrowSide { two_sets });
    let several_sides = [Division::TwoSets].into_iter().chain(species).chain(narrow).chain(pairs);
    let one = [0, 1, 257, 5000].map(|spheres| (spheres, Division::OneSet));
    let several = several_sides.flat_map(|division| [257, 5000].map(move |spheres| (spheres, division)));
    one.into_iter().chain(several).flat_map(move |(spheres, division)| {
        let case = move |lengths, is_overfull| CellListCase { spheres, lengths, is_overfull, division };
        spaces
            .into_iter()
            .flat_map(move |lengths| [false, true].map(|is_overfull| case(lengths, is_overfull)))
    })
}

fn scene(count: u32) -> Vec<Sphere> {
    let mut random = Random(u64::from(count));
    let mut coordinate = |side: f32| (random.unit() - 0.5) * side;
    let sphere = |k: u32| {
        let side = if k.is_multiple_of(3) { 1.0 } else { 20.0 };
        let radius = if k % 200 == 50 { 4.0 } else { [0.5, 0.2, 0.06, 0.025, 0.01][k as usize / 3 % 5] };
        let center = [(); 3].map(|()| coordinate(side));
        Sphere::new(if k % 100 == 99 { [f32::NAN; 3] } else { center }, radius)
    };
    (0..count).map(sphere).collect()
}

impl CellListCase {
    pub(crate) fn choose(self, gpu: &GpuDevice) -> Result<ConfiguredCellList, KernelError> {
        self.choose_for(gpu, scene(self.spheres))
    }

    pub(crate) fn choose_for(
        self,
        gpu: &GpuDevice,
        spheres: Vec<Sphere>,
    ) -> Result<ConfiguredCellList, KernelError> {
        let tau = if self.is_overfull { TAU } else { u32::MAX };
        let before = changed(Outcome::zeroed(), |new| {
            new.max_occupancy = TAU + 1;
            new.deferred_blocks = 7;
            new.found_lo = 7;
            new.dispatch_z = 1;
        });
        self.choose_after(gpu, spheres, tau, before)
    }

    pub(crate) fn choose_after(
        self,
        gpu: &GpuDevice,
        spheres: Vec<Sphere>,
        tau: u32,
        before: Outcome,
    ) -> Result<ConfiguredCellList, KernelError> {
        let space = periodic::space(self.lengths);
        let call = SearchParams {
            spheres: self.spheres,
            cells: CELL_CAPACITY,
            cell_ratio: 2.0,
            tau,
            occupancy_slots: 512,
            pair_capacity: 1 << 22,
            window_end: u32::MAX,
            candidates_per_invocation: 256,
            tiles_per_submission: SearchParams::UNLIMITED,
            ..SearchParams::zeroed()
        };
        let (division, count) = (self.division, spheres.len());
        let call = division.divide(call.in_space(space));
        let species = division.has_species();
        let variant = Variant { periodic: space.is_periodic(), species, ..Variant::default() };
        let images: Vec<Sphere> =
            spheres.iter().map(|sphere| Sphere::new(space.wrap(sphere.center), sphere.radius)).collect();
        let input =
            CellListInput { spheres: &spheres, stats: expected_stats(&images, division, false), division };
        let configured = configure(gpu, call, variant, input, before)?;
        let ConfigureResult { list, lengths, outcome, stats } = configured;
        let scenario = TestInput { space, mixture: division.mixture(count), ..spheres.into() };
        Ok(ConfiguredCellList { call, scenario, division, list, variant, lengths, outcome, stats })
    }
}

pub(crate) struct CellListInput<'a> {
    pub(crate) spheres: &'a [Sphere],
    pub(crate) stats: InputStats,
    pub(crate) division: Division,
}

pub(crate) struct ConfigureResult {
    pub(crate) list: CellListLayout,
    lengths: SortCounts,
    outcome: Outcome,
    stats: InputStats,
}

pub(crate) fn configure(
    gpu: &GpuDevice,
    call: SearchParams,
    variant: Variant,
    input: CellListInput<'_>,
    before: Outcome,
) -> Result<ConfigureResult, KernelError> {
    let CellListInput { spheres, stats, division } = input;
    let call = KernelCall::new(gpu)
        .with("params", &[call])?
        .with("count_source", &[call.spheres])?
        .with("spheres", spheres)?
        .with("stats", &[stats])?
        .with_layout("cell_list", &CellListLayout::zeroed())?
        .with("outcome", &[before])?
        .with("sort_counts", &[SortCounts::zeroed()])?;
    let call = division.bind(call, spheres.len())?;
    call.run(&k::CELL_LIST_CONFIGURE, variant, 1)?;
    Ok(ConfigureResult {
        list: call.read_layout("cell_list")?,
        lengths: call.read_one("sort_counts")?,
        outcome: call.read_one("outcome")?,
        stats: call.read_one("stats")?,
    })
}

pub(crate) fn level_of(list: &CellListLayout, radius: f32) -> usize {
    let class = (radius.to_bits() >> 23) as usize;
    (list.class_levels[class / 4] >> (class % 4 * 8) & 255) as usize
}

/// Returns the cell number per axis before wrapping, with the rounding of a fused multiply-add if `fused`.
pub(crate) fn numbers(
    list: &CellListLayout,
    space: Space,
    center: Vec3,
    level: usize,
    fused: bool,
) -> [u32; 3] {
    let level_layout = &list.level[level];
    let quanta = i64::from(list.units_per_cell);
    let open = |x: f32| {
        let (size, middle) = (x.abs().to_bits(), 1_i64 << 30);
        if size < level_layout.far {
            return (middle + ((x * level_layout.units_per_length).floor() as i64).div_euclid(quanta)) as u32;
        }
        let beyond = i64::from((size - level_layout.far).min(0x1fff_ffff));
        match x < 0.0 {
            true => (middle - (middle + quanta - 1) / quanta - beyond) as u32,
            false => (middle + middle / quanta + beyond) as u32,
        }
    };
    [0, 1, 2].map(|axis| match space.lengths()[axis] {
        None => open(center[axis]).wrapping_sub(level_layout.low[axis]),
        Some(_) => {
            let (around, per_length) = (level_layout.around[axis], level_layout.cells_per_length[axis]);
            let half = 0.5 * around as f32;
            let at =
                if fused { center[axis].mul_add(per_length, half) } else { center[axis] * per_length + half };
            (at.floor() as i32 + around as i32) as u32
        }
    })
}

fn cell(list: &CellListLayout, space: Space, center: Vec3, level: usize, fused: bool) -> u32 {
    let level_layout = &list.level[level];
    let [x, y, z] = numbers(list, space, center, level, fused);
    let [x, y, z] = [x % level_layout.cells.x, y % level_layout.cells.y, z % level_layout.cells.z];
    level_layout.base + (z * level_layout.cells.y + y) * level_layout.cells.x + x
}

impl ConfiguredCellList {
    pub(crate) fn wrapped_center(&self, sphere: &Sphere) -> Vec3 {
        self.scenario.space.wrap(sphere.center)
    }

    pub(crate) fn may_pair(&self, id: usize) -> bool {
        let spheres = &self.scenario.spheres;
        spheres[id].is_valid() && self.division.may_pair(id, spheres.len())
    }

    fn first_level(&self, id: usize) -> usize {
        self.division.levels_per_side() * self.division.side(id, self.scenario.spheres.len())
    }

    pub(crate) fn radius(&self, id: usize) -> f32 {
        self.division.effective_radius(id, &self.scenario.spheres)
    }

    pub(crate) fn own_level(&self, id: usize) -> usize {
        level_of(&self.list, self.radius(id))
    }

    fn coarsest(&self, id: usize, fused: bool) -> Option<u32> {
        let sphere = &self.scenario.spheres[id];
        let has_cell = self.may_pair(id) && self.own_level(id) != LEVEL_WITHOUT_CELLS;
        let level = self.first_level(id);
        has_cell.then(|| cell(&self.list, self.scenario.space, self.wrapped_center(sphere), level, fused))
    }

    pub(crate) fn occupancy(&self, fused: bool) -> Vec<u32> {
        let mut occupancy = vec![0; self.call.occupancy_slots as usize];
        let slots = occupancy.len();
        let cells = (0..self.scenario.spheres.len()).filter_map(|id| self.coarsest(id, fused));
        cells
            .filter(|_| self.list.has_overfull_cells != 0)
            .for_each(|cell| occupancy[cell as usize % slots] += 1);
        occupancy
    }

    /// Returns the cell, and the occupancy of an overfull cell that the sphere left, or 0.
    fn assigned_cell(&self, id: usize, occupancies: &[u32], fused: bool) -> (u32, u32) {
        let (list, space, sphere) = (&self.list, self.scenario.space, &self.scenario.spheres[id]);
        let Some(coarsest) = self.coarsest(id, fused) else {
            return (list.cells + u32::from(!self.may_pair(id)), 0);
        };
        let level = self.own_level(id);
        let occupancy = occupancies[coarsest as usize % occupancies.len()];
        match level != 0 && list.has_overfull_cells != 0 && occupancy > self.call.tau {
            true => (
                cell(list, space, self.wrapped_center(sphere), self.first_level(id) + level, fused),
                occupancy,
            ),
            false => (coarsest, 0),
        }
    }

    pub(crate) fn assigned_cells(&self, occupancy: &[u32], fused: bool) -> (Vec<u32>, u32) {
        let assigned_cells =
            (0..self.scenario.spheres.len()).map(|id| self.assigned_cell(id, occupancy, fused));
        let (cells, occupancies): (Vec<u32>, Vec<u32>) = assigned_cells.unzip();
        (cells, occupancies.into_iter().max().unwrap_or(0))
    }

    pub(crate) fn agrees<T: PartialEq + std::fmt::Debug>(
        case: impl FnOnce() -> String,
        found: &T,
        expected: impl Fn(bool) -> T,
    ) -> Result<(), KernelError> {
        let fused = expected(true);
        if *found == fused { Ok(()) } else { same(case, found, &expected(false)) }
    }
}
