use lazygrid_kernels::Pair;

use super::super::columns::Columns;
use super::{Around, Axes, BAND, FLOOR, Images, Jobs, MAX_LANES, Row, Vector, Width, rows};

/// Plain loops over eight lanes.
#[derive(Clone, Copy)]
pub(crate) struct Portable;

impl Vector for Portable {
    const LANES: usize = 8;
    type Query = [f32; 4];
    type Gaps = ([f32; 8], [f32; 8]);

    #[inline(always)]
    fn query(self, sphere: [f32; 4]) -> [f32; 4] {
        sphere
    }

    #[inline(always)]
    fn gaps(self, columns: &Columns, base: usize, q: [f32; 4]) -> Self::Gaps {
        let [x, y, z, r] = columns.lanes::<8>(base);
        let (mut d2, mut s2) = ([0.0; 8], [0.0; 8]);
        for k in 0..8 {
            let (dx, dy, dz, s) = (x[k] - q[0], y[k] - q[1], z[k] - q[2], r[k] + q[3]);
            d2[k] = dx * dx + dy * dy + dz * dz;
            s2[k] = s * s;
        }
        (d2, s2)
    }

    #[inline(always)]
    fn possible(self, (d2, s2): Self::Gaps) -> u32 {
        (0..8).fold(0, |mask, k| mask | u32::from(d2[k] <= s2[k] * (1.0 + BAND) + FLOOR) << k)
    }

    #[inline(always)]
    fn certain(self, (d2, s2): Self::Gaps) -> u32 {
        (0..8).fold(0, |mask, k| mask | u32::from(d2[k] < s2[k] * (1.0 - BAND) - FLOOR) << k)
    }

    #[inline(always)]
    fn touching(self, rows: &[Row], pairs: &[Pair; MAX_LANES]) -> [u32; 2] {
        rows::touching(rows, pairs)
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
    fn look_around(self, columns: &Columns, spheres: (usize, usize), around: &Around, jobs: &mut Jobs) {
        look_around(columns, spheres, around, jobs);
    }

    #[inline(always)]
    fn pack(self, id: u32, ids: &[u32; MAX_LANES], lanes: u32, pairs: &mut [Pair; MAX_LANES]) -> usize {
        pack(id, ids, lanes, pairs)
    }
}

impl Width for Portable {
    #[inline(always)]
    fn nearest_gaps(self, columns: &Columns, base: usize, q: [f32; 4], images: &Images) -> [Self::Gaps; 2] {
        let [x, y, z, r] = columns.lanes::<8>(base);
        let (mut d2, mut wide, mut narrow) = ([0.0; 8], [0.0; 8], [0.0; 8]);
        for k in 0..8 {
            let nearest = |column: &[f32; 8], axis: usize| {
                let apart = (column[k] - q[axis]).abs();
                let other = images.lengths[axis] - apart;
                // Not `min`: where both are infinite the other is NaN, and not it.
                if other < apart { other } else { apart }
            };
            let (dx, dy, dz, s) = (nearest(x, 0), nearest(y, 1), nearest(z, 2), r[k] + q[3]);
            d2[k] = dx * dx + dy * dy + dz * dz;
            let (more, less) = (s + images.slack, (s - images.slack).max(0.0));
            (wide[k], narrow[k]) = (more * more, less * less);
        }
        [(d2, wide), (d2, narrow)]
    }
}

/// Looking around sphere by sphere.
#[inline(always)]
pub(super) fn look_around(columns: &Columns, (at, count): (usize, usize), around: &Around, jobs: &mut Jobs) {
    let Around { low, high, rows } = around;
    for at in at..at + count {
        let [x, y, z, r] = columns.sphere(at);
        let [lower_x, lower_y] = [x - r < low[0], y - r < low[1]];
        let [higher_x, higher_y, higher_z] = [x + r > high[0], y + r > high[1], z + r > high[2]];
        let (first, end) = (1 - usize::from(lower_x), 2 + usize::from(higher_x));
        let wanted = [true, higher_y, higher_z & lower_y, higher_z, higher_z & higher_y];
        jobs.push(at as u32, at as u32 + 1..rows[0][end], true);
        for row in 1..rows.len() {
            jobs.push(at as u32, rows[row][first]..rows[row][end], wanted[row]);
        }
    }
}

/// Packing lane by lane.
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
