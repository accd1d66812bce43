#[cfg(doc)]
use lazygrid_kernels::DistanceMap;

use super::{Columns, MAX_LANES, PairFilter, Xyzr};
use crate::frame::SearchFrame;

/// Relative and absolute slack of certain contacts; the absolute slack is a fraction of the longest axis.
const CERTAIN_SLACK: [f32; 2] = [1.0 / (1 << 16) as f32, 1.0 / (1 << 18) as f32];
/// Relative slack of possible contacts.
const POSSIBLE_SLACK: f32 = 1.0 / (1 << 16) as f32;
/// Sum of radii, as a fraction of the shortest axis, up to which the nearest orthogonal image is the minimum image.
const MAX_SUM: f32 = 0.49;

/// Decides most candidates of orthogonalized coordinates in `f32`, by their distance in space. The exact test decides
/// the others.
///
/// # Correctness
///
/// Let `u` be the nearest orthogonal image of a difference of two spheres, `s` the sum of their radii there, `g` the
/// growth of radii, `B` the [`DistanceMap`] and `L` the longest axis.
///
/// 1. The minimum image in space, of length `v`, has orthogonalized components of at most `g·v`. If the spheres touch,
///    `g·v ≤ s`. If also `s` is less than half of the shortest axis, these components are `u`, and `|B·u| = g·v`.
/// 2. Along a periodic axis, two coordinates round by 2⁻²⁵ of `L` each, and their difference by 2⁻²⁴. Since `B` is at
///    most 4, `|B·u|` errs by less than `4·√3·2⁻²³·L`, which is less than 2⁻²⁰ of `L`, the growth of both radii for
///    rounding. Along an unbounded axis, the same holds for the distances from the origin in place of `L`.
///    The product with `B` adds less than 2⁻¹⁸ of `s`. So `|B·u|` exceeds `s` by at most [`POSSIBLE_SLACK`] if the
///    spheres touch.
/// 3. `B·u` is `g` times some image, and the minimum image is no longer. The radii were enlarged by at most 2⁻¹⁹ of
///    themselves and, near the origin, 2⁻²⁰ of `L` for both. So spheres touch if `|B·u|` is less than `s` by
///    [`CERTAIN_SLACK`], which includes the rounding of the exact test.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriclinicFilter {
    /// Infinite for an unbounded axis.
    lengths: [f32; 3],
    rows: [f32; 6],
    max_sum: f32,
    /// Subtracted from sums of radii; infinite if no contact is certain.
    certain_slack: f32,
    /// Added to sums of radii with displacement limits, by which a distance in space may change more than in
    /// orthogonalized coordinates.
    margin: f32,
    norm: f32,
}

impl TriclinicFilter {
    /// Returns `None` unless the frame is triclinic, and in cells of extreme size or shape.
    fn from_frame(frame: &SearchFrame) -> Option<Self> {
        let cell = frame.orthogonalization()?;
        let (map, lengths) = (cell.distance_map()?, cell.space().lengths_f32());
        let shortest = lengths.into_iter().flatten().fold(f32::INFINITY, f32::min);
        let longest = lengths.into_iter().flatten().fold(0.0, f32::max);
        let filter = Self {
            lengths: lengths.map(|length| length.unwrap_or(f32::INFINITY)),
            rows: map.rows.map(|number| number as f32),
            max_sum: MAX_SUM * shortest,
            certain_slack: CERTAIN_SLACK[1] * longest,
            margin: 0.0,
            norm: (map.norm as f32).next_up(),
        };
        Some(if frame.has_least_growth() { filter } else { filter.without_certain() })
    }

    /// Returns the filter of candidates that `exact` decides.
    pub(crate) fn for_candidates(frame: &SearchFrame, exact: Option<&PairFilter<'_>>) -> Option<Self> {
        let near = Self::from_frame(frame)?;
        let is_by_radii = exact.is_none_or(PairFilter::is_contact_of_radii);
        Some(if is_by_radii { near } else { near.without_certain() })
    }

    fn without_certain(self) -> Self {
        Self { certain_slack: f32::INFINITY, ..self }
    }

    /// For candidates of spheres that move by up to `limit`, which is part of each radius.
    pub(crate) fn widened(self, limit: f32) -> Self {
        Self { margin: (2.0 * (self.norm - 1.0).max(0.0) * limit).next_up(), ..self.without_certain() }
    }

    /// Returns the lanes of possible and certain contacts. May read padding.
    #[inline]
    pub(crate) fn touching(&self, columns: &Columns, at: usize, base: usize) -> [u32; 2] {
        let (own, [x, y, z, r]) = (columns.sphere(at), columns.lanes::<MAX_LANES>(base));
        let mut lanes = [0; 2];
        for lane in 0..MAX_LANES {
            let [possible, certain] = self.touch([x[lane], y[lane], z[lane], r[lane]], own);
            lanes[0] |= u32::from(possible) << lane;
            lanes[1] |= u32::from(certain) << lane;
        }
        lanes
    }

    /// Returns `true` if contact is possible, and if it is certain.
    #[inline(always)]
    pub(crate) fn touch(&self, a: Xyzr, b: Xyzr) -> [bool; 2] {
        let apart = |axis: usize| {
            let (apart, length) = (a[axis] - b[axis], self.lengths[axis]);
            let image = apart - length.copysign(apart);
            if apart.abs() <= 0.5 * length { apart } else { image }
        };
        let ([x, y, z], sum, rows) = ([apart(0), apart(1), apart(2)], a[3] + b[3], &self.rows);
        let first = rows[0] * x + rows[1] * y + rows[2] * z;
        let (second, third) = (rows[3] * y + rows[4] * z, rows[5] * z);
        let squared = first * first + second * second + third * third;
        let (wide, narrow) = (sum + self.margin, (sum - self.certain_slack).max(0.0));
        let is_apart = squared > wide * wide * (1.0 + 2.0 * POSSIBLE_SLACK) + f32::MIN_POSITIVE;
        let bound = narrow * narrow * (1.0 - 2.0 * CERTAIN_SLACK[0]) - f32::MIN_POSITIVE;
        // A square that overflows bounds nothing.
        let is_certain = (squared < bound) & (bound < f32::INFINITY);
        [!is_apart | (wide > self.max_sum), is_certain]
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::{Space, Sphere};

    use super::*;
    use crate::frame::Bounds;
    use crate::test_support::Random;

    fn row(Sphere { center, radius }: Sphere) -> Xyzr {
        [center.x, center.y, center.z, radius]
    }

    #[test]
    fn decisions_are_those_of_the_exact_test() {
        let mut source = Random(7);
        let mut random = || f64::from(source.unit()) + f64::from(source.unit()) / (1 << 23) as f64;
        let [mut refused, mut sure, mut open] = [0; 3];
        for case in 0..2000_usize {
            let unit = [1.0, 1e-30, 1e25, 1e150][case % 4];
            let tilt = [0.5, 0.9, 3.0][case / 4 % 3];
            let thin = [1.0, 0.3, 0.05][case / 12 % 3];
            let cell_vectors = [
                Some([1.0, 0.0, 0.0]),
                Some([tilt * random(), thin, 0.0]),
                (case % 5 != 0).then(|| [tilt * random(), tilt * random(), 0.8]),
            ];
            let cell_vectors =
                cell_vectors.map(|vector| vector.map(|vector: [f64; 3]| vector.map(|number| unit * number)));
            let Ok(space) = Space::triclinic(cell_vectors) else { continue };
            let is_f32 = unit < 1e100 && case % 3 == 0;
            let rounded = |number: f64| if is_f32 { f64::from(number as f32) } else { number };
            let (far, size) = ([1.0, 1.0, 10.0, 1e5, 3e6][case / 36 % 5], [0.3, 0.03, 0.003][case / 180 % 3]);
            let pairs: Vec<_> = (0..200)
                .map(|_| {
                    let a = [(); 3].map(|()| unit * far * random());
                    let shift = cell_vectors
                        .map(|vector| if vector.is_some() { (far * random()).round() } else { 0.0 });
                    let away = space.image([(); 3].map(|()| unit * size * random()), shift);
                    [a, [0, 1, 2].map(|axis| a[axis] + away[axis])].map(|point| point.map(rounded))
                })
                .collect();
            let mut bounds = Bounds::EMPTY;
            pairs.as_flattened().iter().for_each(|&[x, y, z]| bounds.add([x, y, z, 0.0]));
            let frame = match space.triclinic_cell().filter(|_| is_f32) {
                Some(cell) => SearchFrame::triclinic_f32(cell),
                None => SearchFrame::new(&bounds, &space),
            };
            let frame = frame.with_growth_in(&bounds);
            let Some(filter) = TriclinicFilter::from_frame(&frame) else { continue };
            for (k, [a, b]) in pairs.into_iter().enumerate() {
                let apart = space.minimum_image(a, b).vector.map(|component| component / unit);
                let distance = unit * apart.iter().map(|component| component * component).sum::<f64>().sqrt();
                let gaps =
                    [0.0, 1e-16, -1e-16, 1e-8, -1e-8, 1e-6, -1e-6, 1e-5, -1e-5, 1e-4, -1e-4, 0.02, -0.02];
                let (sum, fraction) = (distance * (1.0 + gaps[k % gaps.len()]), [0.5, 0.0, 0.999][k % 3]);
                let sphere = |[x, y, z]: [f64; 3], radius: f64| [x, y, z, rounded(radius)];
                let (a, b) = (sphere(a, fraction * sum), sphere(b, sum - fraction * sum));
                let [possible, certain] = filter.touch(row(frame.sphere(a)), row(frame.sphere(b)));
                let expected = space.touch(a, b, None);
                assert!(possible || !expected, "lost: {space:?}, {a:?}, {b:?}");
                assert!(!certain || expected, "added: {space:?}, {a:?}, {b:?}");
                refused += usize::from(!possible);
                sure += usize::from(certain);
                open += usize::from(possible && !certain);
            }
        }
        assert!(refused > 10_000 && sure > 10_000, "{refused}, {sure}, {open}");
    }

    #[test]
    fn candidates_are_kept_until_a_sphere_exceeds_its_limit() {
        let mut source = Random(11);
        let mut random = || f64::from(source.unit());
        let [mut accepted, mut refused] = [0; 2];
        for case in 0..20_000 {
            let tilt = [0.5, 0.95][case % 2];
            let cell_vectors =
                [[1.0, 0.0, 0.0], [tilt * random(), 0.9, 0.0], [tilt * random(), tilt * random(), 0.8]];
            let space = Space::triclinic(cell_vectors.map(Some)).expect("a cell");
            let frame = SearchFrame::triclinic_f32(space.triclinic_cell().expect("a triclinic space"));
            let Some(filter) = TriclinicFilter::from_frame(&frame) else { continue };
            let sphere = |[x, y, z]: [f64; 3]| frame.sphere([x, y, z, 0.01]);
            let move_by = |from: [f64; 3], by: [f64; 3]| [0, 1, 2].map(|axis| from[axis] + by[axis]);
            let now: [f64; 3] = [(); 3].map(|()| random());
            let away = [(); 3].map(|()| 0.04 * random());
            let moves = [(); 2].map(|()| [(); 3].map(|()| 0.008 * random()));
            let [a, b] = [now, move_by(now, away)];
            let moved = [move_by(a, moves[0]), move_by(b, moves[1])];
            let away_in_frame = |from, to| {
                let apart: glam::Vec3 = sphere(from).center - sphere(to).center;
                let lengths = frame.space().lengths_f32().map(|length| length.expect("a periodic axis"));
                apart.abs().min(glam::Vec3::from(lengths) - apart.abs()).length()
            };
            let limit = 1.0001 * away_in_frame(a, moved[0]).max(away_in_frame(b, moved[1]));
            let wide = [a, b].map(|center| {
                let Sphere { center, radius } = sphere(center);
                row(Sphere { center, radius: (radius + limit).next_up() })
            });
            let [possible, certain] = filter.widened(limit).touch(wide[0], wide[1]);
            let [[ax, ay, az], [bx, by, bz]] = moved;
            let touches = space.touch([ax, ay, az, 0.01], [bx, by, bz, 0.01], None);
            assert!(possible || !touches, "lost: {space:?}, {moved:?}");
            assert!(!certain);
            accepted += usize::from(touches);
            refused += usize::from(!possible);
        }
        assert!(accepted > 500 && refused > 500, "{accepted}, {refused}");
    }
}
