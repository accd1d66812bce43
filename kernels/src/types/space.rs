use glam::{DVec3, Vec3};

use super::triclinic::TriclinicCell;
use crate::InputError;

/// The space of the spheres: each axis unbounded or periodic, or a triclinic cell with up to three cell vectors.
///
/// In a periodic space, minimum images decide: along a periodic axis of length `L`, `d − L·round(d/L)` replaces a
/// difference `d`. Spheres pair once, for any number of images in reach, and never with their own images. In a
/// triclinic cell, images are at integer multiples of the cell vectors. Coordinates may lie anywhere, as in unwrapped
/// trajectories.
///
/// ```
/// # use lazygrid_kernels::Space;
/// let slab = Space::periodic([Some(10.0), Some(10.0), None])?;
/// assert_eq!(slab.distance_squared([0.5, 0.0, 0.0].into(), [9.5, 0.0, 3.0].into()), 1.0 + 9.0);
///
/// // A box of 10 × 10 × 10 that is tilted by 4 along x for every 10 along y.
/// let vectors = [[10.0, 0.0, 0.0], [4.0, 10.0, 0.0], [0.0, 0.0, 10.0]];
/// let tilted = Space::triclinic(vectors.map(|vector| Some(vector.into())))?;
/// assert_eq!(tilted.distance_squared([1.0, 0.5, 0.0].into(), [5.0, 9.5, 0.0].into()), 1.0);
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

    /// Creates a space that is periodic along the axes with a length, in the unit of the spheres.
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

    pub(crate) fn from_lengths(lengths: [Option<f32>; 3]) -> Self {
        Self { lengths: lengths.map(|length| length.map(f64::from)), triclinic: None }
    }

    /// Creates a space that is periodic along up to three cell vectors. A LAMMPS box of lengths `lx, ly, lz` and tilts
    /// `xy, xz, yz` has the vectors `(lx, 0, 0)`, `(xy, ly, 0)` and `(xz, yz, lz)`. The rows of an ASE cell are its
    /// vectors; omit rows without `pbc`.
    ///
    /// # Errors
    /// [`InputError::CellVectors`] if a vector is zero or not finite, or if the box is thinner than 2⁻²⁴ of its longest
    /// vector or than `f32` can represent.
    pub fn triclinic(cell_vectors: [Option<[f64; 3]>; 3]) -> Result<Self, InputError> {
        if let Some(lengths) = along_axes(&cell_vectors) {
            return Self::periodic(lengths);
        }
        let cell = TriclinicCell::new(cell_vectors)?;
        Ok(Self {
            lengths: cell_vectors.map(|vector| vector.map(|vector| length(vector.into()))),
            triclinic: Some(cell),
        })
    }

    /// Returns the length of each periodic axis or cell vector.
    pub fn lengths(&self) -> [Option<f64>; 3] {
        self.lengths
    }

    /// Returns the lengths rounded to `f32`; exact if the space [fits `f32`](Self::fits_f32).
    pub fn lengths_f32(&self) -> [Option<f32>; 3] {
        self.lengths.map(|length| length.map(|length| length as f32))
    }

    pub(crate) fn scaled(&self, scale: f64) -> Self {
        let lengths = self.lengths.map(|length| length.map(|length| length * scale));
        Self { lengths, triclinic: self.triclinic.map(|cell| cell.scaled(scale)) }
    }

    /// Returns `true` if `f32` spheres need no conversion.
    pub fn fits_f32(&self) -> bool {
        match &self.triclinic {
            None => self.lengths.iter().flatten().all(|&length| f64::from(length as f32) == length),
            Some(cell) => cell.fits_f32(),
        }
    }

    /// Returns the periodic cell vectors.
    pub fn cell_vectors(&self) -> [Option<[f64; 3]>; 3] {
        match &self.triclinic {
            Some(cell) => cell.vectors(),
            None => {
                [0, 1, 2].map(|axis| self.lengths[axis].map(|length| (DVec3::AXES[axis] * length).to_array()))
            }
        }
    }

    /// Returns the triclinic cell, unless the cell vectors point along x, y and z.
    #[doc(hidden)]
    pub fn triclinic_cell(&self) -> Option<&TriclinicCell> {
        self.triclinic.as_ref()
    }

    /// Returns `true` if any axis is periodic.
    pub fn is_periodic(&self) -> bool {
        self.lengths != [None; 3]
    }

    /// Returns the image of a point nearest to the origin: within half a length along periodic axes.
    ///
    /// The result is exact along an axis whose length is an `f32` number, else computed in `f64` and rounded.
    /// Non-finite coordinates give NaN. In a triclinic cell, the result has at most half of each vector of the reduced
    /// basis, rounded.
    pub fn wrap(&self, point: Vec3) -> Vec3 {
        if let Some(cell) = &self.triclinic {
            let (_, [x, y, z]) = cell.minimum_image(point.as_dvec3().to_array());
            return DVec3::new(x, y, z).as_vec3();
        }
        let mut wrapped = point;
        for (axis, length) in self.lengths.into_iter().enumerate() {
            let Some(length) = length else { continue };
            wrapped[axis] = match f64::from(length as f32) == length {
                true => wrap(point[axis], length as f32),
                false => remainder(f64::from(point[axis]), length) as f32,
            };
        }
        wrapped
    }

    /// Returns the squared distance of minimum images, as the exact test of the CPU computes it. In a triclinic cell,
    /// it is as exact as the coordinates for points up to 2²⁰ boxes away.
    pub fn distance_squared(&self, a: Vec3, b: Vec3) -> f64 {
        if self.triclinic.is_some() || !self.fits_f32() {
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

/// Avoids overflow and underflow of squares.
fn length(vector: DVec3) -> f64 {
    /// Bits of the exponent.
    const EXPONENT: u64 = 0x7FF << 52;
    // Division by a power of two rounds no component that matters.
    let unit = f64::from_bits(vector.abs().max_element().to_bits() & EXPONENT).max(f64::MIN_POSITIVE);
    (vector / unit).length() * unit
}

/// Returns `None` also for another order of axes, because shifts count the given vectors.
fn along_axes(cell_vectors: &[Option<[f64; 3]>; 3]) -> Option<[Option<f64>; 3]> {
    let mut lengths = [None; 3];
    for (axis, vector) in cell_vectors.iter().enumerate() {
        let Some(vector) = vector else { continue };
        let is_along = (0..3).all(|other| other == axis || vector[other] == 0.0);
        if !is_along || vector[axis].is_nan() || vector[axis] <= 0.0 {
            return None;
        }
        lengths[axis] = Some(vector[axis]);
    }
    Some(lengths)
}

/// Returns the remainder of `x` of least magnitude, without rounding.
///
/// # Correctness
/// A remainder is a multiple of the last place of `length`, or of half of it if `x` is less than `length`. It is at
/// most half of `length`, so 24 bits hold it. The integer part and its product with `length` fit the 53 bits of `f64`.
#[inline(always)]
fn wrap(x: f32, length: f32) -> f32 {
    /// Number of lengths below which the integer part gives the exact remainder, except next to a tie.
    const NEAR: f64 = (1 << 20) as f64;
    let lengths = f64::from(x) / f64::from(length);
    if lengths.abs() < NEAR {
        // `round` is a function call on targets without the instruction.
        let whole = (lengths + 0.5_f64.copysign(lengths)) as i32;
        return (f64::from(x) - f64::from(whole) * f64::from(length)) as f32;
    }
    let rest = x % length;
    match rest.abs() >= length - rest.abs() {
        true => rest - length.copysign(rest),
        false => rest,
    }
}

/// Returns the remainder of `x` of least magnitude, with an error below an ulp of `length`.
fn remainder(x: f64, length: f64) -> f64 {
    let rest = x % length;
    if rest.abs() > 0.5 * length { rest - length.copysign(rest) } else { rest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::random::random_states;

    #[test]
    fn lengths_beyond_f32_wrap_in_f64() {
        for (x, length, expected) in [
            (10100.0, 10.1, 0.0),
            (10100.5, 10.1, 0.5),
            (-7.0, 10.1, 3.1),
            (1e38, 1e39, 1e38),
            (2.5, 1e-60, 0.0),
            (3e38, 5e38, -2e38),
        ] {
            let space = Space::periodic([None, Some(length), None]).expect("a length");
            let wrapped = f64::from(space.wrap(Vec3::new(x, x, 0.0)).y);
            let ulp = f64::from(f32::EPSILON) * expected;
            assert!((wrapped - expected).abs() <= ulp.abs().max(1e-11), "{x:e} in {length:e}: {wrapped:e}");
            assert!(space.wrap(Vec3::INFINITY).y.is_nan(), "{length:e}");
        }
    }

    fn whole(x: f32) -> i128 {
        (f64::from(x) * (1_u64 << 60) as f64) as i128
    }

    #[test]
    fn wrapping_is_exact_at_any_distance() {
        let lengths = [1.0_f32, 0.1, 3.0, 10.0, 1.0 / 3.0, 7.7e-4, 1e4, 16_777_215.0];
        let mut states = random_states(1);
        let mut random = || states() >> 33;
        for length in lengths {
            for k in 0..20_000_i32 {
                let scale = length * f32::from(k as i16 % 30).exp2();
                let mut x = ((random() % 2_000_001) as f32 / 1e6 - 1.0) * scale;
                if k % 3 == 0 {
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
    fn wrapping_handles_extreme_values() {
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
    fn lengths_of_cell_vectors_neither_overflow_nor_underflow() {
        for unit in [1.0, 0.1, 1e200, 3e307, 1e-200, 1e-300] {
            let vectors = [[3.0, 4.0, 0.0], [-4.0, 3.0, 0.0], [0.0, 3.0, 4.0]];
            let vectors = vectors.map(|vector| Some(vector.map(|number| number * unit)));
            let space = Space::triclinic(vectors).expect("a cell");
            for length in space.lengths() {
                let length = length.expect("a periodic axis");
                assert!((length / unit / 5.0 - 1.0).abs() < 1e-15, "{length:e}, not 5 · {unit:e}");
            }
        }
        assert_eq!([[0.0; 3], [5e-324, 0.0, 0.0]].map(|vector| length(vector.into())), [0.0, 5e-324]);
        assert!(length([f64::INFINITY, 1.0, 0.0].into()).is_nan());
    }

    #[test]
    fn invalid_length_is_refused_with_its_axis() {
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
