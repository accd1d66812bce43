use glam::{DVec3, Vec3};

use super::triclinic::TriclinicCell;
use crate::InputError;

/// The space that spheres live in: along each axis unbounded, or periodic with some length; or periodic along up to three
/// edges of any direction, as those of a triclinic cell.
///
/// In a periodic space every sphere has images, one length apart, and two spheres are as far apart as their nearest
/// images: along a periodic axis of length `L` a difference `d` of coordinates counts as `d − L·round(d/L)`. Two
/// spheres are a pair once if that distance is at most their reach, however many of their images are; a sphere never
/// pairs with an image of its own. This holds for any radii, those larger than the box included.
///
/// The same holds of sheared spaces, where images are whole numbers of edges apart. The nearest ones are found whatever
/// the edges, also where tilts are longer than half an edge.
///
/// Only differences count, so it does not matter where the box begins, and coordinates may lie outside it, as those
/// of a simulator that unwraps trajectories do.
///
/// ```
/// # use lazygrid_kernels::Space;
/// let slab = Space::periodic([Some(10.0), Some(10.0), None])?;
/// assert_eq!(slab.distance_squared([0.5, 0.0, 0.0].into(), [9.5, 0.0, 3.0].into()), 1.0 + 9.0);
///
/// // A box of 10 × 10 × 10 that leans by 4 along x for every 10 along y.
/// let edges = [[10.0, 0.0, 0.0], [4.0, 10.0, 0.0], [0.0, 0.0, 10.0]];
/// let leaning = Space::triclinic(edges.map(|edge| Some(edge.into())))?;
/// assert_eq!(leaning.distance_squared([1.0, 0.5, 0.0].into(), [5.0, 9.5, 0.0].into()), 1.0);
/// # Ok::<(), lazygrid_kernels::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Space {
    lengths: [Option<f64>; 3],
    triclinic: Option<TriclinicCell>,
}

impl Space {
    /// Unbounded along all axes.
    pub const UNBOUNDED: Self = Self { lengths: [None; 3], triclinic: None };

    /// Periodic along those of the axes `x`, `y`, `z` that have a length, in the length unit of the spheres.
    ///
    /// # Errors
    /// [`InputError::PeriodicLength`] for a length that is not finite or not above zero.
    pub fn periodic(lengths: [Option<f64>; 3]) -> Result<Self, InputError> {
        for (axis, length) in ['x', 'y', 'z'].into_iter().zip(lengths) {
            if let Some(length) = length.filter(|length| !(length.is_finite() && *length > 0.0)) {
                return Err(InputError::PeriodicLength { axis, length });
            }
        }
        Ok(Self { lengths, triclinic: None })
    }

    /// The same of lengths that are known to be valid.
    pub(crate) fn of_lengths(lengths: [Option<f32>; 3]) -> Self {
        Self { lengths: lengths.map(|length| length.map(f64::from)), triclinic: None }
    }

    /// Periodic along up to three edges, which may have any direction, in the length unit of the spheres. It repeats along
    /// those that are given; the others, and where the box begins, make no difference.
    ///
    /// The box that LAMMPS writes as lengths `lx, ly, lz` and tilts `xy, xz, yz` has the edges `(lx, 0, 0)`, `(xy, ly, 0)`
    /// and `(xz, yz, lz)`; the cell of ASE has its rows as edges, of which those count that `pbc` names. Where every edge
    /// lies along an axis of its own, the space is that of [`periodic`](Self::periodic).
    ///
    /// # Errors
    /// [`InputError::CellVectors`] for edges that are not finite, zero, or so nearly in one line or plane that the box is thinner
    /// than 2⁻²⁴ of its longest edge; also for boxes thinner than what `f32` can hold.
    pub fn triclinic(cell_vectors: [Option<[f64; 3]>; 3]) -> Result<Self, InputError> {
        if let Some(lengths) = along_axes(&cell_vectors) {
            return Self::periodic(lengths);
        }
        let cell = TriclinicCell::new(cell_vectors)?;
        Ok(Self {
            lengths: cell_vectors.map(|edge| edge.map(|edge| DVec3::from(edge).length())),
            triclinic: Some(cell),
        })
    }

    /// The length of each periodic axis; of a [sheared](Self::triclinic) space the length of each edge.
    pub fn lengths(&self) -> [Option<f64>; 3] {
        self.lengths
    }

    /// The lengths rounded to `f32`; exact if the space [is narrow](Self::is_narrow).
    pub fn lengths_f32(&self) -> [Option<f32>; 3] {
        self.lengths.map(|length| length.map(|length| length as f32))
    }

    /// The same space in a unit that is `1 / scale` of this one's.
    pub(crate) fn scaled(&self, scale: f64) -> Self {
        let lengths = self.lengths.map(|length| length.map(|length| length * scale));
        Self { lengths, triclinic: self.triclinic.map(|cell| cell.scaled(scale)) }
    }

    /// Returns `true` if all lengths are `f32` numbers, as those of a space must be in which `f32` spheres are searched
    /// where they are.
    pub fn is_narrow(&self) -> bool {
        match &self.triclinic {
            None => self.lengths.iter().flatten().all(|&length| f64::from(length as f32) == length),
            // Pairs are decided on in `f64`, whatever the numbers of the edges.
            Some(cell) => cell.is_narrow(),
        }
    }

    /// The edges along which space repeats.
    pub fn cell_vectors(&self) -> [Option<[f64; 3]>; 3] {
        match &self.triclinic {
            Some(cell) => cell.vectors(),
            None => {
                [0, 1, 2].map(|axis| self.lengths[axis].map(|length| (DVec3::AXES[axis] * length).to_array()))
            }
        }
    }

    /// What is to be known of the edges where not all lie along the axes.
    pub fn triclinic_cell(&self) -> Option<&TriclinicCell> {
        self.triclinic.as_ref()
    }

    /// Returns `true` if any axis is periodic.
    pub fn is_periodic(&self) -> bool {
        self.lengths != [None; 3]
    }

    /// The image of a point nearest to the origin: along a periodic axis of length `L` between `−L/2` and `L/2`.
    ///
    /// Exact: the result is a whole number of lengths away, and `f32` can always represent it. Coordinates that are
    /// not finite give NaN. In a sheared space it is the image with at most half of each edge of a reduced box, rounded.
    pub fn wrap(&self, point: Vec3) -> Vec3 {
        if let Some(cell) = &self.triclinic {
            let (_, [x, y, z]) = cell.minimum_image(point.as_dvec3().to_array());
            return DVec3::new(x, y, z).as_vec3();
        }
        let mut wrapped = point;
        for (axis, length) in self.lengths_f32().into_iter().enumerate() {
            if let Some(length) = length {
                wrapped[axis] = wrap(point[axis], length);
            }
        }
        wrapped
    }

    /// The squared distance of the nearest images of two points, as the exact test of the CPU path takes it. In a sheared
    /// space differences of coordinates are folded in `f64`, which for points up to 2²⁰ boxes away is as exact as their
    /// coordinates are.
    pub fn distance_squared(&self, a: Vec3, b: Vec3) -> f64 {
        if self.triclinic.is_some() || !self.is_narrow() {
            let [x, y, z] = self.minimum_image(a.as_dvec3().to_array(), b.as_dvec3().to_array()).vector;
            return x * x + y * y + z * z;
        }
        let (a, b) = (self.wrap(a), self.wrap(b));
        let mut d = [0.0; 3];
        for (axis, length) in self.lengths.into_iter().enumerate() {
            d[axis] = (f64::from(a[axis]) - f64::from(b[axis])).abs();
            if let Some(length) = length {
                // Both lie within half a length of the origin, hence within one length of each other.
                d[axis] = d[axis].min(length - d[axis]);
            }
        }
        d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    }
}

/// The length of each axis, where every edge lies along one of its own.
fn along_axes(edges: &[Option<[f64; 3]>; 3]) -> Option<[Option<f64>; 3]> {
    let mut lengths = [None; 3];
    for edge in edges.iter().flatten() {
        let axis = (0..3).find(|&axis| edge[axis] != 0.0)?;
        let is_along = (0..3).all(|other| other == axis || edge[other] == 0.0);
        if !is_along || lengths[axis].is_some() {
            return None;
        }
        lengths[axis] = Some(edge[axis].abs());
    }
    Some(lengths)
}

/// The remainder of `x` of least magnitude.
///
/// Why nothing is rounded: a remainder is a multiple of the last place of `length`, or half of that where `x` is less
/// than `length`, and at most half of `length`, so 24 bits hold it; the whole part and its product with `length` fit
/// the 53 bits of `f64`.
#[inline(always)]
fn wrap(x: f32, length: f32) -> f32 {
    /// Below so many lengths the whole part, off by rounding only next to a tie, gives the exact remainder.
    const NEAR: f64 = (1 << 20) as f64;
    let lengths = f64::from(x) / f64::from(length);
    if lengths.abs() < NEAR {
        // Not `round`, which is a call where the target lacks it.
        let whole = (lengths + 0.5_f64.copysign(lengths)) as i32;
        return (f64::from(x) - f64::from(whole) * f64::from(length)) as f32;
    }
    let rest = x % length;
    match rest.abs() >= length - rest.abs() {
        true => rest - length.copysign(rest),
        false => rest,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In units so small that every value is a whole number of them.
    fn whole(x: f32) -> i128 {
        (f64::from(x) * (1_u64 << 60) as f64) as i128
    }

    #[test]
    fn wrapping_is_exact_at_any_distance() {
        let lengths = [1.0_f32, 0.1, 3.0, 10.0, 1.0 / 3.0, 7.7e-4, 1e4, 16_777_215.0];
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        for length in lengths {
            for k in 0..20_000_i32 {
                let scale = length * f32::from(k as i16 % 30).exp2();
                let mut x = ((random() % 2_000_001) as f32 / 1e6 - 1.0) * scale;
                if k % 3 == 0 {
                    // Next to a tie.
                    x = (random() % 9) as f32 * 0.5 * length;
                    x = [x, x.next_up(), x.next_down(), -x][k as usize / 3 % 4];
                }
                if x != 0.0 && x.abs() < 1e-8 {
                    continue;
                }
                let wrapped = wrap(x, length);
                assert!(2 * whole(wrapped).abs() <= whole(length), "{x:e} in {length:e}: {wrapped:e}");
                assert_eq!(
                    (whole(x) - whole(wrapped)) % whole(length),
                    0,
                    "{x:e} in {length:e}: {wrapped:e}"
                );
            }
        }
    }

    #[test]
    fn extremes() {
        let tiny = f32::from_bits(1);
        assert_eq!(wrap(f32::MAX, f32::MAX), 0.0);
        assert_eq!(wrap(f32::MAX / 2.0, f32::MAX).abs(), f32::MAX / 2.0);
        assert_eq!(wrap(f32::MIN, tiny), 0.0);
        assert_eq!(wrap(2.0 * tiny, 3.0 * tiny), -tiny);
        assert!(wrap(f32::MAX, 0.1).abs() <= 0.05);
        assert!(wrap(f32::INFINITY, 1.0).is_nan() && wrap(f32::NAN, 1.0).is_nan());
        assert_eq!(wrap(-1e-30, 1.0), -1e-30);
    }

    #[test]
    fn lengths_that_are_none_are_refused_by_axis() {
        for length in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let Err(InputError::PeriodicLength { axis, .. }) =
                Space::periodic([None, Some(length), Some(0.0)])
            else {
                panic!("a box of length {length} was accepted")
            };
            assert_eq!(axis, 'y');
        }
    }
}
