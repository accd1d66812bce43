use lazygrid::Space;

use crate::{Coordinate, SizeClass, SphereWrapper, WrappedSphere};

/// Factor of the largest distance that exceeds all rounding of this and of the contact test.
const MARGIN: f64 = 1.0 + 1.0 / (1_u64 << 40) as f64;
/// Distance above which squares do not underflow, 2⁻⁴⁸⁰.
const MIN_SQUARED: f64 = f64::from_bits((1023 - 480) << 52);

/// The bounding box of a rank's centers of one size class and species group, and the largest effective
/// radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassBounds<T = f32> {
    low: [T; 3],
    high: [T; 3],
    /// Implies the class.
    radius: T,
    group: u32,
}

impl<T: Coordinate> ClassBounds<T> {
    /// Returns a box for each class and group, in this order.
    pub fn all_of(spheres: &[WrappedSphere<T>]) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        // Boxes are few, and equal spheres often adjacent.
        let mut last = 0;
        for sphere in spheres {
            if !all.get(last).is_some_and(|bounds| bounds.has_kind_of(sphere)) {
                last = all.iter().position(|bounds| bounds.has_kind_of(sphere)).unwrap_or(all.len());
            }
            match all.get_mut(last) {
                Some(bounds) => bounds.add(sphere),
                None => all.push(Self::around(sphere)),
            }
        }
        all.sort_unstable_by_key(|bounds| (bounds.class(), bounds.group));
        all
    }

    #[inline]
    pub fn around(sphere: &WrappedSphere<T>) -> Self {
        let center = sphere.center;
        Self { low: center, high: center, radius: sphere.radius, group: sphere.group }
    }

    pub(crate) fn from_message([x, y, z, high_x, high_y, high_z, radius, group]: [T; 8]) -> Self {
        Self { low: [x, y, z], high: [high_x, high_y, high_z], radius, group: group.to_group() }
    }

    pub(crate) fn message(&self) -> [T; 8] {
        let ([x, y, z], [high_x, high_y, high_z]) = (self.low, self.high);
        [x, y, z, high_x, high_y, high_z, self.radius, T::from_group(self.group)]
    }

    #[inline]
    fn has_kind_of(&self, sphere: &WrappedSphere<T>) -> bool {
        self.group == sphere.group && self.class() == sphere.class()
    }

    fn add(&mut self, sphere: &WrappedSphere<T>) {
        for (axis, x) in sphere.center.into_iter().enumerate() {
            self.low[axis] = if x < self.low[axis] { x } else { self.low[axis] };
            self.high[axis] = if x > self.high[axis] { x } else { self.high[axis] };
        }
        self.radius = if sphere.radius > self.radius { sphere.radius } else { self.radius };
    }

    #[inline]
    pub fn class(&self) -> SizeClass {
        SizeClass::from_radius(self.radius.into() as f32)
    }

    #[inline]
    pub fn group(&self) -> u32 {
        self.group
    }

    /// Returns `true` if spheres of both boxes may pair, or if unsure.
    #[inline]
    pub fn can_pair(&self, other: &Self, wrapper: &SphereWrapper) -> bool {
        let (cutoff, space) = (wrapper.cutoff(self.group, other.group), wrapper.wrapped_space());
        // Radii have grown by the rounding of images, but cutoffs have not.
        let is_limited = !(T::WRAPPING_ENLARGES_RADII && space.is_periodic());
        cutoff.is_some_and(|cutoff| {
            self.overlaps(other, space, if is_limited { cutoff } else { f64::INFINITY })
        })
    }

    /// Returns `true` if spheres of both boxes may overlap and are at most `cutoff` apart, or if unsure. `cutoff` is at
    /// least that of their species, infinite if only radii count.
    ///
    /// # Correctness
    ///
    /// 1. The test has the `f64` operations of the contact test.
    /// 2. Its distance by axis is at most that of any two spheres. Its radii and its cutoff are at least
    ///    theirs.
    /// 3. Every operation is monotone, with or without rounding.
    /// 4. Radii of at least [`Coordinate::UNLIMITED`] limit no distance: larger `f32` radii are cut there.
    /// 5. The `f64` contact test computes as if exponents had no bounds. Here an overflowing sum of squares
    ///    exceeds every limit with a finite square, and squares that may underflow are not used. Along each axis,
    ///    touching spheres exceed the limit by rounding at most, which the margin covers.
    /// 6. Wrapped `f64` centers are exact. Radii have grown by more than the contact test rounds images
    ///    ([`SphereWrapper::wrap_f64`]).
    #[inline]
    pub fn overlaps(&self, other: &Self, space: &Space, cutoff: f64) -> bool {
        let lengths = space.lengths();
        let gap = |axis: usize| {
            let ours = [self.low[axis], self.high[axis]].map(T::into);
            gap(ours, [other.low[axis], other.high[axis]].map(T::into), lengths[axis])
        };
        let (x, y, z) = (gap(0), gap(1), gap(2));
        let is_limited = self.radius < T::UNLIMITED && other.radius < T::UNLIMITED;
        let radii = self.radius.into() + other.radius.into();
        let limit = if is_limited { radii.min(cutoff) } else { cutoff };
        let limit = (limit * MARGIN).next_up();
        let is_near = x.max(y).max(z) <= limit;
        is_near && (limit < MIN_SQUARED || x * x + y * y + z * z <= limit * limit)
    }
}

/// Returns the gap of two intervals, on a ring if `length` is given.
#[inline]
fn gap(a: [f64; 2], b: [f64; 2], length: Option<f64>) -> f64 {
    let direct = (b[0] - a[1]).max(a[0] - b[1]).max(0.0);
    match length {
        // Around the ring, points are at least its length less their span apart.
        Some(length) => direct.min((length - (a[1].max(b[1]) - a[0].min(b[0]))).max(0.0)),
        None => direct,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sphere(x: f32, radius: f32) -> WrappedSphere {
        WrappedSphere { center: [x, 0.0, 0.0], radius, group: 0 }
    }

    fn overlap(bounds: &ClassBounds, sphere: &WrappedSphere, space: &Space, cutoff: f64) -> bool {
        bounds.overlaps(&ClassBounds::around(sphere), space, cutoff)
    }

    #[test]
    fn spheres_of_several_classes_and_groups_have_a_box_each() {
        let other = WrappedSphere { group: 1, ..sphere(7.0, 1.25) };
        let spheres = [sphere(0.0, 1.0), other, sphere(5.0, 1.5), sphere(-1.0, 2.0), sphere(9.0, 0.0)];
        let all = ClassBounds::all_of(&spheres);
        assert_eq!(all.iter().map(ClassBounds::group).collect::<Vec<_>>(), [0, 0, 1, 0]);
        assert!(all.is_sorted_by_key(ClassBounds::class));
        assert_eq!((all[1].low[0], all[1].high[0], all[1].radius), (0.0, 5.0, 1.5));
        assert_eq!((all[2].low[0], all[2].high[0], all[2].radius), (7.0, 7.0, 1.25));
        assert!(ClassBounds::<f32>::all_of(&[]).is_empty());
    }

    #[test]
    fn touching_sphere_overlaps_and_next_float_does_not() {
        let bounds = ClassBounds::all_of(&[sphere(0.0, 1.0), sphere(4.0, 1.0)])[0];
        let overlaps = |x, radius| overlap(&bounds, &sphere(x, radius), &Space::UNBOUNDED, f64::INFINITY);
        assert!(overlaps(2.0, 0.0) && overlaps(6.0, 1.0) && overlaps(-2.0, 1.0));
        assert!(!overlaps(6.0_f32.next_up(), 1.0) && !overlaps((-2.0_f32).next_down(), 1.0));
        assert!(overlaps(f32::MAX, f32::MAX));
        let far = |sign: f32| WrappedSphere { center: [sign * 3e38; 3], ..sphere(0.0, f32::MAX) };
        let one = ClassBounds::around(&far(1.0));
        assert!(overlap(&one, &far(-1.0), &Space::UNBOUNDED, f64::INFINITY));
        let huge = sphere(0.0, f32::MAX);
        assert!(overlap(&bounds, &WrappedSphere { center: [9.0, 0.0, 0.0], ..huge }, &Space::UNBOUNDED, 5.0));
        assert!(!overlap(&one, &far(-1.0), &Space::UNBOUNDED, 1e38));
    }

    #[test]
    fn cutoff_below_the_radii_limits_the_distance() {
        let bounds = ClassBounds::all_of(&[sphere(0.0, 1.0), sphere(4.0, 1.0)])[0];
        let overlaps = |x, radius| overlap(&bounds, &sphere(x, radius), &Space::UNBOUNDED, 1.5);
        assert!(overlaps(5.5, 1.0) && overlaps(-1.5, 1.0) && overlaps(2.0, 1.0) && overlaps(5.25, 0.25));
        assert!(!overlaps(5.5_f32.next_up(), 1.0) && !overlaps(5.5, 0.25));
        let space = Space::periodic([Some(10.0), None, None]).unwrap();
        assert!(overlap(&bounds, &sphere(-4.5, 1.0), &space, 1.5));
        assert!(!overlap(&bounds, &sphere(-4.0, 1.0), &space, 1.5));
    }

    #[test]
    fn periodic_sphere_overlaps_across_the_boundary() {
        let space = Space::periodic([Some(10.0), None, None]).unwrap();
        let bounds = ClassBounds::all_of(&[sphere(-4.5, 0.5), sphere(-4.0, 0.5)])[0];
        let overlaps = |x, radius| overlap(&bounds, &sphere(x, radius), &space, f64::INFINITY);
        assert!(overlaps(4.5, 0.5) && overlaps(5.0, 0.0) && overlaps(-3.5, 0.0));
        assert!(!overlaps(4.5, 0.25) && !overlaps(0.0, 3.0));
    }
}
