//! One level's cells: from coordinates to rows of cells that lie next to each other in memory.
//!
//! Space is unbounded but the table is not. Where the bounds hold too many cells, the raster is folded: cells whose
//! coordinates agree modulo the raster's size share a table entry. Sharing only adds comparisons, never pairs.

use glam::{DVec3, UVec3, Vec3};

/// Below this many cells from the origin `f64` still counts single cells; farther out two different `f32`
/// coordinates lie 2²⁵ cells apart or more, so that only equal ones can meet.
const COUNTABLE: f64 = (1_u64 << 50) as f64;
/// How far rounding can move a coordinate, relative to the largest: some units in the last place of `f64`.
const ROUNDING: f64 = 1.0 / (1_u64 << 49) as f64;

/// The cells of one level.
#[derive(Clone, Debug)]
pub(crate) struct Raster {
    /// Cells per unit length.
    per_length: f64,
    /// The cell coordinate of the lowest corner; zero where folded.
    origin: DVec3,
    /// Cells per axis.
    pub(crate) size: UVec3,
    pub(crate) folded: bool,
    /// The largest effective radius of the level, and what rounding may add to it.
    reach: f64,
}

/// Cells from `first` on, per axis; counted on round the fold where there is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Block {
    pub(crate) first: UVec3,
    pub(crate) count: UVec3,
}

impl Raster {
    /// Cells of edge `edge` over `min..=max`, folded to `most` cells, for spheres up to radius `largest`.
    pub(crate) fn new(edge: f64, (min, max): (Vec3, Vec3), largest: f32, most: u64) -> Self {
        let per_length = edge.recip();
        let origin = (min.as_dvec3() * per_length).floor();
        let extent = (max.as_dvec3() * per_length).floor() - origin + 1.0;
        let (size, folded) = fold(extent, most.max(64));
        let far = min.abs().max(max.abs()).max_element();
        let slack = if folded { 0.0 } else { f64::from(far) * ROUNDING };
        let reach = f64::from(largest) * (1.0 + 1e-9) + slack;
        Self { per_length, origin: if folded { DVec3::ZERO } else { origin }, size, folded, reach }
    }

    /// How many table entries the raster has.
    pub(crate) fn cells(&self) -> u64 {
        self.size.to_array().iter().map(|&k| u64::from(k)).product()
    }

    /// The cell of a centre.
    #[inline(always)]
    pub(crate) fn cell_of(&self, center: Vec3) -> UVec3 {
        let at = center.as_dvec3() * self.per_length;
        if self.folded { self.fold_at(center, at) } else { (at - self.origin).as_uvec3() }
    }

    /// The table entry of a cell.
    #[inline(always)]
    pub(crate) fn index(&self, cell: UVec3) -> usize {
        let row = cell.z as usize * self.size.y as usize + cell.y as usize;
        row * self.size.x as usize + cell.x as usize
    }

    /// All cells that may hold a sphere of this level within reach of one of radius `radius` at `center`.
    ///
    /// Not folded: lower and upper corner come from the same monotone expression as [`cell_of`](Self::cell_of),
    /// from coordinates moved outwards by more than rounding can move them; cut to the raster.
    #[inline(always)]
    pub(crate) fn block(&self, center: Vec3, radius: f32) -> Block {
        if self.folded {
            return self.folded_block(center, radius);
        }
        let (center, reach) = (center.as_dvec3(), f64::from(radius) + self.reach);
        let last = self.size - 1;
        let first = ((center - reach) * self.per_length - self.origin).as_uvec3().min(last);
        let to = ((center + reach) * self.per_length - self.origin).as_uvec3().min(last);
        Block { first, count: to - first + 1 }
    }

    fn folded_block(&self, center: Vec3, radius: f32) -> Block {
        let at = center.as_dvec3() * self.per_length;
        let reach = f64::from(radius) + self.reach;
        let own = self.fold_at(center, at);
        let (mut first, mut count) = (own, UVec3::ONE);
        for axis in 0..3 {
            if at[axis].abs() >= COUNTABLE {
                continue;
            }
            let x = f64::from(center[axis]);
            let reach = reach + x.abs() * ROUNDING;
            let (low, high) = ((x - reach) * self.per_length, (x + reach) * self.per_length);
            let cells = high.floor() - low.floor() + 1.0;
            count[axis] = cells.min(f64::from(self.size[axis])) as u32;
            first[axis] = modulo(low.floor(), self.size[axis]);
        }
        Block { first, count }
    }

    fn fold_at(&self, center: Vec3, at: DVec3) -> UVec3 {
        let mut cell = UVec3::ZERO;
        for axis in 0..3 {
            cell[axis] = if at[axis].abs() < COUNTABLE {
                modulo(at[axis].floor(), self.size[axis])
            } else {
                // Only equal coordinates can meet out here, so any function of the value will do.
                center[axis].to_bits().wrapping_mul(0x9E37_79B1) % self.size[axis]
            };
        }
        cell
    }
}

/// `cell` modulo `size`, for a whole number of at most 2⁵¹.
fn modulo(cell: f64, size: u32) -> u32 {
    (cell as i64).rem_euclid(i64::from(size)) as u32
}

/// The raster's size: the whole extent where it has at most `most` cells, else the longest axes folded.
fn fold(extent: DVec3, most: u64) -> (UVec3, bool) {
    if extent.x * extent.y * extent.z <= most as f64 {
        return (extent.as_uvec3().max(UVec3::ONE), false);
    }
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| extent[a].total_cmp(&extent[b]));
    let (mut size, mut left) = (UVec3::ONE, most as f64);
    for (k, axis) in axes.into_iter().enumerate() {
        let share = left.powf(1.0 / (3 - k) as f64).floor().max(1.0);
        let cells = extent[axis].min(share);
        size[axis] = cells as u32;
        left /= cells;
    }
    (size, true)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the block holds the cell, on a folded or a plain raster.
    fn holds(raster: &Raster, block: Block, cell: UVec3) -> bool {
        (0..3).all(|k| {
            let steps = (cell[k] + raster.size[k] - block.first[k]) % raster.size[k];
            steps < block.count[k] && block.count[k] <= raster.size[k]
        })
    }

    #[test]
    fn a_block_holds_every_cell_in_reach_at_any_distance_from_the_origin() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f32 / (1 << 24) as f32 * 2.0 - 1.0
        };
        for scale in [0.0, 1.0, 1e3, 1e7, 1e12, 1e20, 3e38] {
            for most in [64, 1000, 1 << 40] {
                let base = Vec3::new(random(), random(), random()) * scale;
                let points: Vec<_> =
                    (0..40).map(|_| base + 20.0 * Vec3::new(random(), random(), random())).collect();
                let min = points.iter().fold(Vec3::INFINITY, |a, &b| a.min(b));
                let max = points.iter().fold(Vec3::NEG_INFINITY, |a, &b| a.max(b));
                let raster = Raster::new(1.7, (min, max), 2.0, most);
                for &p in &points {
                    for &q in &points {
                        let near = (p.as_dvec3() - q.as_dvec3()).length() <= 2.5;
                        let held = holds(&raster, raster.block(p, 0.5), raster.cell_of(q));
                        assert!(held || !near, "{p} loses {q}, folded {}", raster.folded);
                    }
                }
            }
        }
    }

    #[test]
    fn a_folded_raster_keeps_to_its_size() {
        for extent in [[1e9, 2.0, 3.0], [1e9, 1e9, 1e9], [1.0, 1.0, 1e300], [65.0, 1.0, 1.0]] {
            let (size, folded) = fold(extent.into(), 64);
            assert!(folded && size.x * size.y * size.z <= 64 && size.min_element() > 0, "{extent:?}: {size}");
        }
        assert_eq!(fold([4.0, 4.0, 4.0].into(), 64), (UVec3::new(4, 4, 4), false));
    }
}
