use glam::Vec3;

use crate::InputError;

/// The space that spheres live in: along each axis unbounded, or periodic with some length.
///
/// In a periodic space every sphere has images, one length apart, and two spheres are as far apart as their nearest
/// images: along a periodic axis of length `L` a difference `d` of coordinates counts as `d − L·round(d/L)`. Two
/// spheres are a pair once if that distance is at most their reach, however many of their images are; a sphere never
/// pairs with an image of its own. This holds for any radii, those larger than the box included.
///
/// Only differences count, so it does not matter where the box begins, and coordinates may lie outside it, as those
/// of a simulator that unwraps trajectories do.
///
/// ```
/// # use lazygrid_kernels::Space;
/// let slab = Space::periodic([Some(10.0), Some(10.0), None])?;
/// assert_eq!(slab.distance_squared([0.5, 0.0, 0.0].into(), [9.5, 0.0, 3.0].into()), 1.0 + 9.0);
/// # Ok::<(), lazygrid_kernels::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Space {
    lengths: [Option<f32>; 3],
}

impl Space {
    /// Unbounded along all axes.
    pub const UNBOUNDED: Self = Self { lengths: [None; 3] };

    /// Periodic along those of the axes `x`, `y`, `z` that have a length, in the length unit of the spheres.
    ///
    /// # Errors
    /// [`InputError::Period`] for a length that is not finite or not above zero.
    pub fn periodic(lengths: [Option<f32>; 3]) -> Result<Self, InputError> {
        for (axis, length) in ['x', 'y', 'z'].into_iter().zip(lengths) {
            if let Some(length) = length.filter(|length| !(length.is_finite() && *length > 0.0)) {
                return Err(InputError::Period { axis, length });
            }
        }
        Ok(Self { lengths })
    }

    /// The length of each periodic axis.
    pub fn lengths(&self) -> [Option<f32>; 3] {
        self.lengths
    }

    /// Whether any axis is periodic.
    pub fn is_periodic(&self) -> bool {
        self.lengths != [None; 3]
    }

    /// The image of a point nearest to the origin: along a periodic axis of length `L` between `−L/2` and `L/2`.
    ///
    /// Exact: the result is a whole number of lengths away, and `f32` can always represent it. Coordinates that are
    /// not finite give NaN.
    pub fn wrap(&self, point: Vec3) -> Vec3 {
        let mut wrapped = point;
        for (axis, length) in self.lengths.into_iter().enumerate() {
            if let Some(length) = length {
                wrapped[axis] = wrap(point[axis], length);
            }
        }
        wrapped
    }

    /// The squared distance of the nearest images of two points, as the exact test of the CPU path takes it.
    pub fn distance_squared(&self, a: Vec3, b: Vec3) -> f64 {
        let (a, b) = (self.wrap(a), self.wrap(b));
        let mut d = [0.0; 3];
        for (axis, length) in self.lengths.into_iter().enumerate() {
            d[axis] = (f64::from(a[axis]) - f64::from(b[axis])).abs();
            if let Some(length) = length {
                // Both lie within half a length of the origin, hence within one length of each other.
                d[axis] = d[axis].min(f64::from(length) - d[axis]);
            }
        }
        d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    }
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
    match rest.abs() > length - rest.abs() {
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
        for length in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let Err(InputError::Period { axis, .. }) = Space::periodic([None, Some(length), Some(0.0)])
            else {
                panic!("a box of length {length} was accepted")
            };
            assert_eq!(axis, 'y');
        }
    }
}
