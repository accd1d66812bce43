//! Geometry of the paper's grids: the cells of an unbounded or periodic grid that a sphere overlaps.
//!
//! # Correctness
//!
//! A pair can share several cells. The cell that reports it has, on each axis, the larger of the two spheres' lowest
//! cells. Every entry carries a corner mask: one bit per axis, set if the cell is the sphere's lowest on it. A cell
//! owns a pair exactly if the two masks together have all three bits.
//!
//! A periodic axis is a ring of cells. There a cell owns a pair if on every axis one sphere begins in it and the other
//! overlaps it. Spheres of `a` and `b` cells have one such cell if they share any. Two would mean that each sphere
//! begins inside the other, so that both cover a ring of at most `a + b − 2` cells. A ring therefore has at least 3
//! cells for spheres of up to 2 cells, and 5 for spheres of 3; else it is one cell, in which all begin. For the same
//! reason two spheres share only one arc of the ring, which is treated as a line.

use std::convert::Infallible;

use glam::{BVec3, DVec3, UVec3, Vec3};

use crate::executor::{Chunks, Executor};
use crate::input::InputStats;
use crate::math::floor;

pub(crate) const ALL_AXES: u8 = 0b111;
/// Largest cell number on either side of the origin. Farther out, different `f32` coordinates are at least eight cells
/// apart, and no diameter exceeds two cells. So only spheres with equal coordinates can touch, and the bits of the
/// coordinate give the number of a far cell.
const MAX_INTEGER_CELL: u32 = 1 << 27;
/// Unused numbers before the far cells: spheres near the limit overlap two cells beyond it.
const FAR_GAP: u32 = 16;
const MIDDLE: u32 = 1 << 31;
/// Growth of radii, far above the rounding of the exact test.
const RADIUS_GROWTH: f64 = 1.0 + 1e-9;
/// Largest relative rounding error of a coordinate: some ulp of `f64`.
const ROUNDING: f64 = 1.0 / (1_u64 << 49) as f64;
/// Factor on the cell size, so that a widened sphere of one cell's diameter never spans three.
const CELL_SLACK: f64 = 1.0 + 1.0 / (1 << 20) as f64;
/// Maximum cells of a ring, so that rounding of its length is less than [`CELL_SLACK`].
const MAX_RING_CELLS: f64 = (1 << 26) as f64;
const POINTS_PER_CELL: f64 = 4.0;
const MAX_SHIFTS: usize = 4;
const CHUNK_SPHERES: usize = 1 << 14;

#[derive(Clone, Debug, Default)]
pub(crate) struct UniformGrid {
    cell_size: f64,
    per_length: f64,
    /// In cells, below 1. Included in a ring's origin.
    shift: DVec3,
    first_far: u32,
    periodic: PeriodicAxes,
}

/// Rings of cells. Cell 0 begins at minus half a length.
#[derive(Clone, Debug, Default)]
struct PeriodicAxes {
    /// 0 for an unbounded axis.
    count: UVec3,
    per_length: DVec3,
    origin: DVec3,
    lengths: DVec3,
}

impl PeriodicAxes {
    /// Cells are no smaller than `cell_size`, in short rings `diameter`.
    fn new(cell_size: f64, diameter: f64, lengths: [Option<f32>; 3]) -> Self {
        let (per_length, zero) = (DVec3::splat(cell_size.recip()), DVec3::ZERO);
        let mut periodic = Self { count: UVec3::ZERO, per_length, origin: zero, lengths: zero };
        for (axis, length) in lengths.into_iter().enumerate() {
            let Some(length) = length.map(f64::from) else { continue };
            let count = (length / cell_size).min(MAX_RING_CELLS);
            let least = if cell_size >= diameter * CELL_SLACK { 3.0 } else { 5.0 };
            let count = if count >= least {
                count as u32
            } else if length / 3.0 >= diameter * CELL_SLACK {
                3
            } else {
                1
            };
            periodic.count[axis] = count;
            periodic.per_length[axis] = f64::from(count) / length;
            periodic.origin[axis] = 0.5 * f64::from(count);
            periodic.lengths[axis] = length;
        }
        periodic
    }
}

impl UniformGrid {
    /// Uses `ratio` × the largest diameter, or the density if all radii are zero.
    pub(crate) fn new(stats: &InputStats, ratio: f32, lengths: [Option<f32>; 3]) -> Self {
        let diameter = 2.0 * f64::from(stats.largest_radius());
        let cell_size = match diameter > 0.0 {
            true => f64::from(ratio) * diameter,
            false => {
                let extent = (stats.max.as_dvec3() - stats.min.as_dvec3()).max_element();
                extent / (stats.spheres as f64 / POINTS_PER_CELL).cbrt().max(1.0)
            }
        };
        Self::with_cell_size(cell_size * CELL_SLACK, diameter, lengths)
    }

    pub(crate) fn coarser(&self, lengths: [Option<f32>; 3]) -> Self {
        Self::with_cell_size(2.0 * self.cell_size, f64::INFINITY, lengths)
    }

    fn with_cell_size(cell_size: f64, diameter: f64, lengths: [Option<f32>; 3]) -> Self {
        let cell_size = cell_size.max(f64::from(f32::MIN_POSITIVE));
        let limit = (cell_size * f64::from(MAX_INTEGER_CELL)) as f32;
        let first_far = limit.next_down().min(f32::MAX).to_bits();
        let (per_length, periodic) = (cell_size.recip(), PeriodicAxes::new(cell_size, diameter, lengths));
        Self { cell_size, per_length, shift: DVec3::ZERO, first_far, periodic }
    }

    /// At most one shift per axis moves a given sphere across a cell boundary.
    fn shifts(ratio: f32) -> usize {
        (ratio as usize).clamp(1, MAX_SHIFTS)
    }

    /// Bounds the mean number of cells per sphere of a grid that is [shifted](Self::shifted) if it has more.
    ///
    /// At one of *p* shifts per axis a sphere overlaps two cells along that axis, otherwise one. The mean over all *p*³
    /// shifts is (1 + 1/*p*)³, so the best shift has no more.
    pub(crate) fn most_cells(ratio: f32) -> f64 {
        let shifts = Self::shifts(ratio) as f64;
        if ratio < 1.0 { 27.0 } else { (1.0 + shifts.recip()).powi(3) }
    }

    pub(crate) fn shifted<const PERIODIC: bool>(
        mut self,
        ratio: f32,
        sphere: impl Fn(usize) -> (Vec3, f32) + Sync + Send,
        n: usize,
        executor: Executor,
    ) -> Self {
        let shifts = Self::shifts(ratio);
        // The shift at which the sphere crosses a boundary, or `MAX_SHIFTS`.
        let at = |low: f64, high: f64| {
            let (low, high) = (floor(low * shifts as f64), floor(high * shifts as f64));
            if low == high { MAX_SHIFTS } else { (-high).rem_euclid(shifts as i64) as usize }
        };
        type Counts = [[[u64; MAX_SHIFTS + 1]; MAX_SHIFTS + 1]; MAX_SHIFTS + 1];
        let count = |mut counts: Counts, chunk: usize| {
            for k in chunk * CHUNK_SPHERES..n.min((chunk + 1) * CHUNK_SPHERES) {
                let (center, radius) = sphere(k);
                let (low, high) = self.bounds::<PERIODIC>(center, radius);
                counts[at(low.x, high.x)][at(low.y, high.y)][at(low.z, high.z)] += 1;
            }
            Ok::<_, Infallible>(counts)
        };
        let add = |mut a: Counts, b: Counts| {
            let cells = a.as_flattened_mut().as_flattened_mut().iter_mut();
            cells.zip(b.as_flattened().as_flattened()).for_each(|(a, b)| *a += b);
            Ok(a)
        };
        let Ok(counts) =
            executor.fold(Chunks::unlimited(n.div_ceil(CHUNK_SPHERES)), Counts::default, count, add);
        let cells = |shift: [usize; 3]| {
            let mut cells = 0;
            for (x, plane) in counts.iter().enumerate() {
                for (y, row) in plane.iter().enumerate() {
                    for (z, count) in row.iter().enumerate() {
                        let across = [x, y, z].iter().zip(shift).filter(|&(&at, shift)| at == shift).count();
                        cells += count << across;
                    }
                }
            }
            cells
        };
        let all = (0..shifts.pow(3)).map(|k| [k % shifts, k / shifts % shifts, k / shifts / shifts]);
        let best = all.min_by_key(|&shift| cells(shift)).unwrap_or_default();
        let shift = DVec3::from_array(best.map(|shift| shift as f64 / shifts as f64));
        self.shift += shift;
        self.periodic.origin += shift;
        self
    }

    pub(crate) fn cell_size(&self) -> f64 {
        let PeriodicAxes { count, per_length, lengths, .. } = &self.periodic;
        if count.to_array() == [1; 3] {
            return self.cell_size.min(lengths.max_element());
        }
        (0..3)
            .filter(|&axis| count[axis] > 1)
            .fold(self.cell_size, |cell_size, axis| cell_size.min(per_length[axis].recip()))
    }

    /// Widened by more than rounding. Both corners come from one monotone expression.
    #[inline(always)]
    pub(crate) fn bounds<const PERIODIC: bool>(&self, center: Vec3, radius: f32) -> (DVec3, DVec3) {
        let center = center.as_dvec3();
        if PERIODIC {
            let PeriodicAxes { per_length, origin, lengths, .. } = self.periodic;
            let half = center.abs().max(lengths) * ROUNDING + f64::from(radius) * RADIUS_GROWTH;
            return ((center - half) * per_length + origin, (center + half) * per_length + origin);
        }
        let half = center.abs() * ROUNDING + f64::from(radius) * RADIUS_GROWTH;
        ((center - half) * self.per_length + self.shift, (center + half) * self.per_length + self.shift)
    }

    /// On a ring, numbers may exceed the end; see [`wrap`](Self::wrap).
    #[inline(always)]
    pub(crate) fn cover<const PERIODIC: bool>(&self, center: Vec3, radius: f32) -> CellBox {
        let (low, high) = self.bounds::<PERIODIC>(center, radius);
        // Sums are positive, so the cast rounds down. `floor` may be a function call.
        let counted = |at: DVec3| (at + f64::from(MIDDLE)).as_uvec3();
        let mut cover = CellBox { low: counted(low), high: counted(high) };
        let far = self.is_far(center);
        if far.any() {
            for axis in 0..3 {
                if far.test(axis) {
                    let cell = self.far_cell(center[axis]);
                    (cover.low[axis], cover.high[axis]) = (cell, cell);
                }
            }
        }
        if PERIODIC {
            for axis in 0..3 {
                match i64::from(self.periodic.count[axis]) {
                    0 => {}
                    1 => (cover.low[axis], cover.high[axis]) = (0, 0),
                    count => {
                        let (first, last) = (floor(low[axis]), floor(high[axis]));
                        let start = first + if first < 0 { count } else { 0 };
                        let start = start - if start >= count { count } else { 0 };
                        cover.low[axis] = start as u32;
                        cover.high[axis] = (start + last - first) as u32;
                    }
                }
            }
        }
        cover
    }

    #[inline(always)]
    pub(crate) fn wrap<const PERIODIC: bool>(&self, mut cell: UVec3) -> UVec3 {
        if PERIODIC {
            for axis in 0..3 {
                let count = self.periodic.count[axis];
                cell[axis] -= if count > 0 && cell[axis] >= count { count } else { 0 };
            }
        }
        cell
    }

    pub(crate) fn bounds_of(&self, min: Vec3, max: Vec3, largest: f32) -> (UVec3, UVec3) {
        let (mut low, mut high) =
            (self.cover::<false>(min, largest).low, self.cover::<false>(max, largest).high);
        for axis in 0..3 {
            if self.periodic.count[axis] > 0 {
                (low[axis], high[axis]) = (0, self.periodic.count[axis] - 1);
            }
        }
        (low, high)
    }

    /// Returns the maximum distance of coordinates in this cell to the origin, in cells; on a ring, its number of
    /// cells.
    pub(crate) fn away(&self, corner: DVec3) -> DVec3 {
        corner.abs().max(self.periodic.count.as_dvec3()) + 1.0
    }

    /// Converts from cells to the unit of length.
    pub(crate) fn widest(&self, sides: DVec3) -> f64 {
        (sides / self.periodic.per_length).max_element()
    }

    /// Moves a box to its image nearest to the cell at `corner`.
    #[inline(always)]
    pub(crate) fn image_at(&self, corner: DVec3, (mut low, mut high): (DVec3, DVec3)) -> (DVec3, DVec3) {
        for axis in 0..3 {
            let ring = f64::from(self.periodic.count[axis]);
            if ring > 1.0 {
                // A sphere that overlaps a cell has an image within half a ring of the cell's center.
                let away = corner[axis] + 0.5 - 0.5 * (low[axis] + high[axis]);
                let shift = if away.abs() > 0.5 * ring { ring.copysign(away) } else { 0.0 };
                (low[axis], high[axis]) = (low[axis] + shift, high[axis] + shift);
            }
        }
        (low, high)
    }

    #[inline(always)]
    fn is_far(&self, center: Vec3) -> BVec3 {
        (center.as_dvec3() * self.per_length).abs().cmpge(DVec3::splat(f64::from(MAX_INTEGER_CELL)))
    }

    fn far_cell(&self, coordinate: f32) -> u32 {
        let step = MAX_INTEGER_CELL + FAR_GAP + coordinate.abs().to_bits().saturating_sub(self.first_far);
        if coordinate > 0.0 { MIDDLE + step } else { MIDDLE - step }
    }

    /// Returns the corner in cells; `None` on an axis with a far cell or a whole ring.
    pub(crate) fn corner(&self, cell: UVec3) -> [Option<f64>; 3] {
        [0, 1, 2].map(|axis| match (self.periodic.count[axis], cell[axis]) {
            (0, k) if k.abs_diff(MIDDLE) < MAX_INTEGER_CELL + FAR_GAP => {
                Some(f64::from(k) - f64::from(MIDDLE))
            }
            (0 | 1, _) => None,
            (_, k) => Some(f64::from(k)),
        })
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CellBox {
    pub(crate) low: UVec3,
    pub(crate) high: UVec3,
}

impl CellBox {
    /// At most 8 if the cell size is at least the largest diameter, 27 if at least half.
    #[inline(always)]
    pub(crate) fn cells(self) -> usize {
        let size = self.high - self.low + 1;
        (size.x * size.y * size.z) as usize
    }

    #[inline(always)]
    pub(crate) fn for_each(self, mut take: impl FnMut(UVec3, u8)) {
        let Self { low, high } = self;
        for z in low.z..=high.z {
            let mask_z = u8::from(z == low.z) << 2;
            for y in low.y..=high.y {
                let mask_y = mask_z | u8::from(y == low.y) << 1;
                for x in low.x..=high.x {
                    take(UVec3::new(x, y, z), mask_y | u8::from(x == low.x));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
