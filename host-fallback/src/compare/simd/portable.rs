use std::ops::Range;

use lazygrid_kernels::Pair;
use wide::f32x8;

use super::super::columns::Columns;
use super::{
    Axes, BAND, FLOOR, MAX_LANES, NeighborRows, PeriodicBox, PeriodicSimd, RunQueue, SimdTask, SimdWidth,
    Xyzr, scalar,
};
use crate::frame::{Bounds, FrameMap};

#[derive(Clone, Copy)]
pub(crate) struct Portable;

impl SimdWidth for Portable {
    const LANES: usize = 8;
    type Query = [f32x8; 4];
    type SquaredDistances = (f32x8, f32x8);

    #[inline(never)]
    fn call<T: SimdTask>(self, task: T, vector: impl SimdWidth) -> T::Result {
        task.run(vector)
    }

    #[inline(always)]
    fn query(self, sphere: [f32; 4]) -> [f32x8; 4] {
        sphere.map(f32x8::splat)
    }

    #[inline(always)]
    fn squared_distances(self, columns: &Columns, base: usize, q: [f32x8; 4]) -> Self::SquaredDistances {
        let [x, y, z, r] = columns.lanes::<8>(base).map(|lanes| f32x8::new(*lanes));
        let (dx, dy, dz, s) = (x - q[0], y - q[1], z - q[2], r + q[3]);
        (dx * dx + dy * dy + dz * dz, s * s)
    }

    #[inline(always)]
    fn possible(self, (d2, s2): Self::SquaredDistances) -> u32 {
        d2.simd_le(s2 * f32x8::splat(1.0 + BAND) + f32x8::splat(FLOOR)).to_bitmask()
    }

    #[inline(always)]
    fn certain(self, (d2, s2): Self::SquaredDistances) -> u32 {
        d2.simd_lt(s2 * f32x8::splat(1.0 - BAND) - f32x8::splat(FLOOR)).to_bitmask()
    }

    #[inline(always)]
    fn touching(self, rows: &[Xyzr], pairs: &[Pair; MAX_LANES]) -> [u32; 2] {
        scalar::touching(rows, pairs)
    }

    #[inline(always)]
    fn cell(self, axes: &Axes, center: [f32; 3], offset: f64) -> [u32; 4] {
        let mut cell = [0; 4];
        for axis in 0..3 {
            let at = (f64::from(center[axis]) + offset) * axes.per_length[axis] - axes.origin[axis];
            cell[axis] = at.max(0.0).min(axes.last[axis]) as u32;
        }
        cell
    }

    #[inline(always)]
    fn add_to_bounds(self, bounds: &mut Bounds, row: [f64; 4]) {
        bounds.add(row);
    }

    #[inline(always)]
    fn is_in_frame(self, map: &FrameMap<'_>, row: [f64; 4]) -> bool {
        map.contains(row)
    }

    #[inline(always)]
    fn map_to_frame<const PERIODIC: bool>(self, map: &FrameMap<'_>, row: [f64; 4]) -> Xyzr {
        map.map::<PERIODIC>(row)
    }

    #[inline(always)]
    fn squared_displacement<const PERIODIC: bool>(self, now: Xyzr, then: Xyzr, lengths: &[f32; 4]) -> f32 {
        scalar::squared_displacement::<PERIODIC>(now, then, lengths)
    }

    #[inline(always)]
    fn find_neighbor_runs(
        self,
        columns: &Columns,
        spheres: Range<usize>,
        neighbors: &NeighborRows,
        queue: &mut RunQueue,
    ) {
        find_neighbor_runs(columns, spheres, neighbors, queue);
    }

    #[inline(always)]
    fn pack(self, id: u32, ids: &[u32; MAX_LANES], lanes: u32, pairs: &mut [Pair; MAX_LANES]) -> usize {
        pack(id, ids, lanes, pairs)
    }

    #[inline(always)]
    fn compact(self, pairs: &[Pair; MAX_LANES], lanes: u32, packed: &mut [Pair; MAX_LANES]) -> usize {
        compact(pairs, lanes, packed)
    }
}

impl PeriodicSimd for Portable {
    #[inline(always)]
    fn minimum_image_touching(
        self,
        rows: &[Xyzr],
        pairs: &[Pair; MAX_LANES],
        periodic: &PeriodicBox,
    ) -> [u32; 2] {
        scalar::minimum_image_touching(rows, pairs, periodic)
    }

    #[inline(always)]
    fn minimum_image_distances(
        self,
        columns: &Columns,
        base: usize,
        q: [f32x8; 4],
        periodic: &PeriodicBox,
    ) -> [Self::SquaredDistances; 2] {
        let [x, y, z, r] = columns.lanes::<8>(base).map(|lanes| f32x8::new(*lanes));
        let nearest = |column: f32x8, axis: usize| {
            let apart = (column - q[axis]).abs();
            let other = f32x8::splat(periodic.lengths[axis]) - apart;
            // Not the minimum: if both are infinite, `other` is NaN.
            other.simd_lt(apart).select(other, apart)
        };
        let (dx, dy, dz, s) = (nearest(x, 0), nearest(y, 1), nearest(z, 2), r + q[3]);
        let slack = f32x8::splat(periodic.slack);
        let (more, less) = (s + slack, (s - slack).max(f32x8::ZERO));
        let d2 = dx * dx + dy * dy + dz * dz;
        [(d2, more * more), (d2, less * less)]
    }
}

#[inline(always)]
pub(super) fn find_neighbor_runs(
    columns: &Columns,
    spheres: Range<usize>,
    neighbors: &NeighborRows,
    queue: &mut RunQueue,
) {
    let NeighborRows { low, high, rows } = neighbors;
    for at in spheres {
        let [x, y, z, r] = columns.sphere(at);
        let [lower_x, lower_y] = [x - r < low[0], y - r < low[1]];
        let [higher_x, higher_y, higher_z] = [x + r > high[0], y + r > high[1], z + r > high[2]];
        let (first, end) = (1 - usize::from(lower_x), 2 + usize::from(higher_x));
        let wanted = [true, higher_y, higher_z & lower_y, higher_z, higher_z & higher_y];
        queue.push(at as u32, at as u32 + 1..rows[0][end], true);
        for row in 1..rows.len() {
            queue.push(at as u32, rows[row][first]..rows[row][end], wanted[row]);
        }
    }
}

#[inline(always)]
pub(super) fn compact(pairs: &[Pair; MAX_LANES], lanes: u32, packed: &mut [Pair; MAX_LANES]) -> usize {
    let mut count = 0;
    for (lane, &pair) in pairs.iter().enumerate() {
        packed[count % MAX_LANES] = pair;
        count += (lanes >> lane & 1) as usize;
    }
    count
}

#[inline(always)]
pub(super) fn pack(id: u32, ids: &[u32; MAX_LANES], lanes: u32, pairs: &mut [Pair; MAX_LANES]) -> usize {
    let (mut open, mut packed) = (lanes, 0);
    while open != 0 {
        pairs[packed % MAX_LANES] = Pair::new(id, ids[open.trailing_zeros() as usize % MAX_LANES]);
        packed += 1;
        open &= open - 1;
    }
    packed
}
