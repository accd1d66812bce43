//! The cells of one level, in contiguous rows.
//!
//! A grid with too many cells is folded: cells whose coordinates agree modulo its size share a table entry, which adds
//! comparisons, never pairs.

use std::ops::Range;

use glam::DVec3;

use crate::compare::{Axes, SimdWidth};
use crate::input::CenterBounds;
use crate::math::floor;

/// Distance from the origin, in cells, below which `f64` distinguishes cells. Farther out, different `f32` coordinates
/// are at least 2²⁵ cells apart.
const MAX_COUNTED_CELLS: f64 = (1_u64 << 50) as f64;
/// Below this half width of a range, in cells, a far sphere touches only spheres with an equal coordinate.
const FAR_CELLS: f64 = (1_u64 << 24) as f64;
/// Maximum repeats of a folded grid along a periodic axis. Cell numbers stay exact, and cells far larger than rounding.
const MAX_REPEATS: f64 = (1_u64 << 20) as f64;
/// Rounding error relative to the largest coordinate: some ulp of `f64`.
const ROUNDING: f64 = 1.0 / (1_u64 << 49) as f64;
/// Growth of a radius, far above the rounding of the exact test for two centers that are one radius apart. A searching
/// sphere may be larger, and farther from the origin, than all spheres of the grid.
const RADIUS_ROUNDING: f64 = 1e-9;
/// Upper bound of the rounding error of a sum of `f32` coordinates, relative to the largest.
const SINGLE_ROUNDING: f64 = 1.0 / (1_u64 << 20) as f64;

#[derive(Clone, Debug)]
pub(crate) struct CellGrid {
    axes: Axes,
    cell_sizes: [f64; 3],
    periodic: [bool; 3],
    pub(crate) size: [u32; 3],
    per_size: [f64; 3],
    pub(crate) folded: bool,
    /// Rows may wrap.
    pub(crate) circular: bool,
    /// Touching spheres are in equal or adjacent cells.
    pub(crate) adjoining: bool,
    /// Largest effective radius plus rounding.
    padding: f64,
    largest: f32,
}

/// `last` may exceed the size of a grid whose rows wrap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CellRange {
    pub(crate) first: [u32; 3],
    last: [u32; 3],
}

impl CellRange {
    #[inline(always)]
    pub(crate) fn count(&self) -> [u32; 3] {
        let (a, b) = (self.first, self.last);
        [b[0] - a[0] + 1, b[1] - a[1] + 1, b[2] - a[2] + 1]
    }

    /// Returns the cells along x up to the end of a row, and those that wrap.
    #[inline(always)]
    pub(crate) fn row_ranges(&self, size: [u32; 3]) -> [Range<u32>; 2] {
        let (first, count) = (self.first[0], self.count()[0]);
        let before = count.min(size[0] - first);
        [first..first + before, 0..count - before]
    }

    #[inline(always)]
    pub(crate) fn wraps(&self, size: [u32; 3]) -> bool {
        self.last[0] >= size[0] || self.last[1] >= size[1] || self.last[2] >= size[2]
    }
}

impl CellGrid {
    /// A periodic axis starts at `−length / 2` and has a whole number of cells no smaller than `cell_size`.
    pub(crate) fn new(
        cell_size: f64,
        bounds: CenterBounds,
        lengths: [Option<f32>; 3],
        largest: f32,
        most: u64,
    ) -> Self {
        let CenterBounds { min, max } = bounds;
        debug_assert!(cell_size > 0.0 && cell_size.is_finite(), "cells of size {cell_size}");
        let per_length = cell_size.recip();
        let mut origin = (min.as_dvec3() * per_length).floor();
        let mut extent = (max.as_dvec3() * per_length).floor() - origin + 1.0;
        for (axis, length) in lengths.into_iter().enumerate() {
            if let Some(length) = length {
                extent[axis] = (f64::from(length) * per_length).floor().max(1.0);
            }
        }
        let (size, reduced) = fold(extent, most.max(64));
        let periodic = lengths.map(|length| length.is_some());
        let mut cells = size.map(f64::from);
        let mut cell_sizes = [cell_size; 3];
        for (axis, length) in lengths.into_iter().enumerate() {
            if let Some(length) = length {
                // A multiple of the grid's size, so that the last and the first cell are adjacent there, too.
                cells[axis] *= (extent[axis] / cells[axis]).floor().min(MAX_REPEATS);
                cell_sizes[axis] = f64::from(length) / cells[axis];
                origin[axis] = -0.5 * cells[axis];
            }
        }
        let folded = reduced && (periodic.contains(&false) || cells != size.map(f64::from));
        let far = min.abs().max(max.abs()).max_element();
        let slack = if folded { 0.0 } else { f64::from(far) * ROUNDING };
        let padding = f64::from(largest) * (1.0 + RADIUS_ROUNDING) + slack;
        let last = cells.map(|cells| cells - 1.0);
        let axes = Axes {
            per_length: [cell_sizes[0].recip(), cell_sizes[1].recip(), cell_sizes[2].recip(), 0.0],
            origin: [origin.x, origin.y, origin.z, 0.0],
            last: [last[0], last[1], last[2], 0.0],
        };
        let narrowest = cell_sizes.into_iter().fold(f64::INFINITY, f64::min);
        let adjoining = !folded && (f64::from(largest) + padding) * (1.0 + 1e-6) <= narrowest;
        let circular = folded || periodic.contains(&true);
        let per_size = size.map(|size| f64::from(size).recip());
        Self { per_size, axes, cell_sizes, periodic, size, folded, circular, adjoining, padding, largest }
    }

    pub(crate) fn largest(&self) -> f32 {
        self.largest
    }

    pub(crate) fn rows_around(&self, radius: f64) -> f64 {
        let cells = |axis: usize| {
            let around = 1.0 + 2.0 * (radius + self.padding).max(0.0) / self.cell_sizes[axis];
            around.min(f64::from(self.size[axis]))
        };
        cells(1) * cells(2)
    }

    pub(crate) fn cells(&self) -> u64 {
        self.size.iter().map(|&k| u64::from(k)).product()
    }

    #[inline(always)]
    pub(crate) fn cell_of<V: SimdWidth>(&self, vector: V, [x, y, z]: [f32; 3]) -> [u32; 3] {
        if self.folded {
            return self.fold_at([x, y, z]);
        }
        let [x, y, z, _] = vector.cell(&self.axes, [x, y, z], 0.0);
        [x, y, z]
    }

    #[inline(always)]
    pub(crate) fn index(&self, cell: [u32; 3]) -> usize {
        let row = cell[2] as usize * self.size[1] as usize + cell[1] as usize;
        row * self.size[0] as usize + cell[0] as usize
    }

    /// Covers all spheres that may touch this one. Unless the grid is folded, both corners come from the monotone
    /// expression of [`cell_of`](Self::cell_of), with coordinates moved outward by more than rounding. On a periodic
    /// axis that suffices if they are not in its outermost cells, since nothing then touches across the boundary.
    #[inline(always)]
    pub(crate) fn block<V: SimdWidth>(&self, vector: V, [x, y, z, r]: [f32; 4]) -> CellRange {
        if self.folded {
            return self.circular_block([x, y, z], r);
        }
        let half = f64::from(r) * (1.0 + RADIUS_ROUNDING) + self.padding;
        let low = vector.cell(&self.axes, [x, y, z], -half);
        let high = vector.cell(&self.axes, [x, y, z], half);
        if self.circular {
            let is_outermost = |axis: usize| low[axis] == 0 || high[axis] + 1 >= self.size[axis];
            if (0..3).any(|axis| self.periodic[axis] & is_outermost(axis)) {
                return self.circular_block([x, y, z], r);
            }
        }
        CellRange { first: [low[0], low[1], low[2]], last: [high[0], high[1], high[2]] }
    }

    /// Returns bounds within which a sphere of `cell`, radius included, touches no sphere of lower or higher cells.
    /// They are inward by far more than `f32` rounding, or infinite. The grid must not be folded.
    #[inline(always)]
    pub(crate) fn bounds(&self, cell: [u32; 3]) -> ([f32; 3], [f32; 3]) {
        let (mut low, mut high) = ([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);
        for axis in 0..3 {
            let [from, to] = self.interior(axis, f64::from(cell[axis]) + self.axes.origin[axis]);
            if cell[axis] > 0 {
                low[axis] = from;
            }
            if cell[axis] + 1 < self.size[axis] {
                high[axis] = to;
            }
        }
        (low, high)
    }

    /// Returns the part of the cell beginning at `at`, in cells, that no sphere of other cells along the axis reaches.
    #[inline(always)]
    fn interior(&self, axis: usize, at: f64) -> [f32; 2] {
        let cell_size = self.cell_sizes[axis];
        let lower = at * cell_size;
        let slack = (lower.abs() + cell_size + self.padding) * SINGLE_ROUNDING + f64::from(f32::MIN_POSITIVE);
        [(lower + self.padding + slack) as f32, (lower + cell_size - self.padding - slack) as f32]
    }

    /// Returns `true` if no cell is adjacent to another cell both inside the box and across its boundary.
    pub(crate) fn has_distinct_sides(&self) -> bool {
        (0..3).all(|axis| !self.periodic[axis] || self.size[axis] != 2)
    }

    /// Returns bounds within which a sphere, radius included, touches no sphere across a periodic boundary.
    pub(crate) fn boundary_bounds(&self) -> ([f32; 3], [f32; 3]) {
        let (mut low, mut high) = ([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);
        for axis in (0..3).filter(|&axis| self.periodic[axis]) {
            // The box is symmetric about the origin.
            let [from, _] = self.interior(axis, self.axes.origin[axis]);
            (low[axis], high[axis]) = (from, -from);
        }
        (low, high)
    }

    #[inline(always)]
    pub(crate) fn is_at_boundary(&self, cell: [u32; 3]) -> bool {
        let at_boundary = |axis: usize| cell[axis] == 0 || cell[axis] + 1 == self.size[axis];
        self.circular && (0..3).any(|axis| self.periodic[axis] && at_boundary(axis))
    }

    #[inline(never)]
    fn circular_block(&self, center: [f32; 3], radius: f32) -> CellRange {
        let (mut first, mut last) = ([0; 3], [0; 3]);
        for axis in 0..3 {
            let (x, per_length) = (f64::from(center[axis]), self.axes.per_length[axis]);
            let half = f64::from(radius) * (1.0 + RADIUS_ROUNDING) + self.padding + x.abs() * ROUNDING;
            let (low, high) = match (self.periodic[axis], self.folded) {
                (true, _) => {
                    let cells = self.axes.last[axis] + 1.0;
                    // Wrapping may round a coordinate, so a center at the end of the axis may touch the first cell.
                    let (at, span) = (x * per_length + 0.5 * cells, half * per_length + cells * ROUNDING);
                    (floor(at - span), floor(at + span))
                }
                (false, true) if (x * per_length).abs() >= MAX_COUNTED_CELLS => {
                    let is_near = half * per_length < FAR_CELLS;
                    first[axis] = if is_near { self.far_cell(axis, center[axis]) } else { 0 };
                    last[axis] = if is_near { first[axis] } else { self.size[axis] - 1 };
                    continue;
                }
                (false, true) => (floor((x - half) * per_length), floor((x + half) * per_length)),
                (false, false) => {
                    let cell = |at: f64| (at * per_length - self.axes.origin[axis]).max(0.0);
                    let cut = |at: f64| cell(at).min(self.axes.last[axis]) as i64;
                    (cut(x - half), cut(x + half))
                }
            };
            first[axis] = self.fold(axis, low);
            last[axis] = first[axis] + high.saturating_sub(low).min(i64::from(self.size[axis] - 1)) as u32;
        }
        CellRange { first, last }
    }

    #[inline(never)]
    fn fold_at(&self, center: [f32; 3]) -> [u32; 3] {
        let mut cell = [0; 3];
        for axis in 0..3 {
            let at = f64::from(center[axis]) * self.axes.per_length[axis];
            cell[axis] = if self.periodic[axis] {
                let cell = (at - self.axes.origin[axis]).max(0.0).min(self.axes.last[axis]);
                self.fold(axis, cell as i64)
            } else if at.abs() < MAX_COUNTED_CELLS {
                self.fold(axis, floor(at))
            } else {
                self.far_cell(axis, center[axis])
            };
        }
        cell
    }

    /// Hashes the coordinate, because so far away only equal coordinates can touch.
    fn far_cell(&self, axis: usize, at: f32) -> u32 {
        at.to_bits().wrapping_mul(0x9E37_79B1) % self.size[axis]
    }

    #[inline(always)]
    fn fold(&self, axis: usize, cell: i64) -> u32 {
        let size = i64::from(self.size[axis]);
        if (0..size).contains(&cell) {
            return cell as u32;
        }
        let repeats = floor(cell as f64 * self.per_size[axis]);
        let rest = cell.wrapping_sub(repeats.wrapping_mul(size));
        // The product may have been rounded up.
        (if (0..size).contains(&rest) { rest } else { cell.rem_euclid(size) }) as u32
    }
}

fn fold(extent: DVec3, most: u64) -> ([u32; 3], bool) {
    if extent.x * extent.y * extent.z <= most as f64 {
        return (extent.max(DVec3::ONE).to_array().map(|cells| cells as u32), false);
    }
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| extent[a].total_cmp(&extent[b]));
    let (mut size, mut left) = ([1; 3], most as f64);
    for (k, axis) in axes.into_iter().enumerate() {
        let per_axis = left.powf(1.0 / (3 - k) as f64).floor().max(1.0);
        let cells = extent[axis].min(per_axis);
        size[axis] = cells as u32;
        left /= cells;
    }
    (size, true)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::compare::Portable;
    use crate::test_support::Random;

    fn contains(grid: &CellGrid, block: CellRange, cell: [u32; 3]) -> bool {
        (0..3).all(|k| {
            let steps = (cell[k] + grid.size[k] - block.first[k]) % grid.size[k];
            steps < block.count()[k] && block.count()[k] <= grid.size[k]
        })
    }

    #[test]
    fn cell_range_contains_every_touched_cell_at_any_distance_from_the_origin() {
        let mut random = Random(1);
        for scale in [0.0, 1.0, 1e3, 1e7, 1e12, 1e20, 3e38] {
            for most in [64, 1000, 1 << 26] {
                let base = Vec3::from(random.point(scale));
                let points: Vec<_> = (0..40).map(|_| base + Vec3::from(random.point(20.0))).collect();
                let mut bounds = CenterBounds::EMPTY;
                points.iter().for_each(|&point| bounds.add(point));
                let grid = CellGrid::new(1.7, bounds, [None; 3], 2.0, most);
                for &p in &points {
                    for &q in &points {
                        let near = (p.as_dvec3() - q.as_dvec3()).length() <= 2.5;
                        let block = grid.block(Portable, [p.x, p.y, p.z, 0.5]);
                        let is_found = contains(&grid, block, grid.cell_of(Portable, q.to_array()));
                        assert!(is_found || !near, "{p} loses {q}, folded {}", grid.folded);
                    }
                }
            }
        }
    }

    #[test]
    fn range_in_folded_periods_contains_every_touched_cell() {
        let mut random = Random(9);
        for (length, cell_size) in [(10.0_f32, 0.3), (1000.0, 0.01), (1e-3, 1e-7), (7.0, 1e-12)] {
            let cutoff = 1.5 * cell_size;
            let half = length / 2.0;
            let bounds = CenterBounds { min: Vec3::splat(-half), max: Vec3::splat(half) };
            let grid = CellGrid::new(cell_size, bounds, [Some(length); 3], cutoff as f32, 1 << 12);
            assert!(grid.folded && grid.cells() <= 1 << 12, "{grid:?}");
            for _ in 0..2000 {
                let near = Vec3::from(random.point(1.0)).map(|at| if at < 0.0 { half } else { half * at });
                let apart = Vec3::from(random.point(cutoff as f32 / 2.0));
                let other = (near + apart).map(|at| if at > half { at - length } else { at });
                let touched = (near.as_dvec3() - other.as_dvec3()).map(|at| {
                    let at = at.abs();
                    at.min(f64::from(length) - at)
                });
                let [x, y, z] = near.to_array();
                let block = grid.block(Portable, [x, y, z, 0.0]);
                let is_found = contains(&grid, block, grid.cell_of(Portable, other.to_array()));
                assert!(is_found || touched.length() > cutoff, "{near} loses {other} in {grid:?}");
            }
        }
    }

    #[test]
    fn coordinates_just_below_a_cell_boundary_stay_inside() {
        let center = Vec3::new(-1e-30, 1.0_f32.next_down(), -1.0_f32.next_down());
        let bounds = CenterBounds { min: center, max: center };
        let grid = CellGrid::new(1.0, bounds, [None; 3], 0.0, 64);
        assert_eq!(grid.cells(), 1);
        assert_eq!(grid.cell_of(Portable, center.to_array()), [0; 3]);
    }

    #[test]
    fn folded_grid_stays_within_its_size() {
        for extent in [[1e9, 2.0, 3.0], [1e9, 1e9, 1e9], [1.0, 1.0, 1e300], [65.0, 1.0, 1.0]] {
            let (size, folded) = fold(extent.into(), 64);
            let cells: u32 = size.iter().product();
            assert!(folded && (1..=64).contains(&cells), "{extent:?}: {size:?}");
        }
        assert_eq!(fold([4.0, 4.0, 4.0].into(), 64), ([4, 4, 4], false));
    }
}
