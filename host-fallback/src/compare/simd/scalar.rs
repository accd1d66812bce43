use lazygrid_kernels::Pair;

use super::{BAND, FLOOR, MAX_LANES, PeriodicBox};

/// Center and radius.
pub(crate) type Xyzr = [f32; 4];

struct SquaredDistances {
    d2: [f32; MAX_LANES],
    s2: [f32; MAX_LANES],
}

impl SquaredDistances {
    #[inline(always)]
    fn possible(&self) -> u32 {
        (0..MAX_LANES)
            .fold(0, |mask, k| mask | u32::from(self.d2[k] <= self.s2[k] * (1.0 + BAND) + FLOOR) << k)
    }

    #[inline(always)]
    fn certain(&self) -> u32 {
        (0..MAX_LANES)
            .fold(0, |mask, k| mask | u32::from(self.d2[k] < self.s2[k] * (1.0 - BAND) - FLOOR) << k)
    }
}

#[inline(always)]
pub(super) fn touching(rows: &[Xyzr], pairs: &[Pair; MAX_LANES]) -> [u32; 2] {
    let mut distances = SquaredDistances { d2: [0.0; MAX_LANES], s2: [0.0; MAX_LANES] };
    for (k, pair) in pairs.iter().enumerate() {
        let (a, b) = (rows[pair.i as usize], rows[pair.j as usize]);
        let [dx, dy, dz, s] = [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] + b[3]];
        (distances.d2[k], distances.s2[k]) = (dx * dx + dy * dy + dz * dz, s * s);
    }
    [distances.possible(), distances.certain()]
}

#[inline(always)]
pub(super) fn minimum_image_touching(
    rows: &[Xyzr],
    pairs: &[Pair; MAX_LANES],
    periodic: &PeriodicBox,
) -> [u32; 2] {
    let none = || SquaredDistances { d2: [0.0; MAX_LANES], s2: [0.0; MAX_LANES] };
    let (mut wide, mut narrow) = (none(), none());
    for (k, pair) in pairs.iter().enumerate() {
        let (a, b) = (rows[pair.i as usize], rows[pair.j as usize]);
        let nearest = |axis: usize| {
            let apart = (a[axis] - b[axis]).abs();
            let other = periodic.lengths[axis] - apart;
            // Not `min`: if both are infinite, `other` is NaN.
            if other < apart { other } else { apart }
        };
        let [dx, dy, dz] = [nearest(0), nearest(1), nearest(2)];
        let s = a[3] + b[3];
        let (more, less) = (s + periodic.slack, (s - periodic.slack).max(0.0));
        let d2 = dx * dx + dy * dy + dz * dz;
        (wide.d2[k], narrow.d2[k]) = (d2, d2);
        (wide.s2[k], narrow.s2[k]) = (more * more, less * less);
    }
    [wide.possible(), narrow.certain()]
}

#[inline(always)]
pub(super) fn squared_displacement<const PERIODIC: bool>(now: Xyzr, then: Xyzr, lengths: &[f32; 4]) -> f32 {
    let mut squares = [0.0; 4];
    for lane in 0..4 {
        let mut apart = now[lane] - then[lane];
        if PERIODIC {
            apart = apart.abs();
            let other = (lengths[lane] - apart).abs();
            apart = if other < apart { other } else { apart };
        }
        squares[lane] = apart * apart;
    }
    squares[0] + squares[1] + squares[2]
}
