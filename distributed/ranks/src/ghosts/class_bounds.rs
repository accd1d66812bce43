use bytemuck::{Pod, Zeroable};
use lazygrid::Space;

use crate::{SizeClass, SphereWrapper, WrappedSphere};

/// The box of the centers of a rank's spheres of one size class and species group, and their largest effective radius.
/// 32 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ClassBounds {
    low: [f32; 3],
    high: [f32; 3],
    /// Implies the class.
    radius: f32,
    group: u32,
}

impl ClassBounds {
    /// Returns a box for each class and group, ascending.
    pub fn all_of(spheres: &[WrappedSphere]) -> Vec<Self> {
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

    /// Returns the box of one sphere.
    #[inline]
    pub fn around(sphere: &WrappedSphere) -> Self {
        let center = sphere.center.to_array();
        Self { low: center, high: center, radius: sphere.radius, group: sphere.group }
    }

    #[inline]
    fn has_kind_of(&self, sphere: &WrappedSphere) -> bool {
        self.group == sphere.group && self.class() == sphere.class()
    }

    fn add(&mut self, sphere: &WrappedSphere) {
        for (axis, x) in sphere.center.to_array().into_iter().enumerate() {
            self.low[axis] = self.low[axis].min(x);
            self.high[axis] = self.high[axis].max(x);
        }
        self.radius = self.radius.max(sphere.radius);
    }

    #[inline]
    pub fn class(&self) -> SizeClass {
        SizeClass::of(self.radius)
    }

    #[inline]
    pub fn group(&self) -> u32 {
        self.group
    }

    /// Returns `true` if a sphere in this box and one in the other may pair, or if unsure.
    #[inline]
    pub fn can_pair(&self, other: &Self, wrapper: &SphereWrapper) -> bool {
        let cutoff = wrapper.cutoff(self.group, other.group);
        cutoff.is_some_and(|cutoff| self.overlaps(other, wrapper.wrapped_space(), cutoff))
    }

    /// Returns `true` if spheres of both boxes may overlap and are at most `cutoff` apart, or if unsure. Their species
    /// must pair at most at the `cutoff`, which is infinite if only radii limit the distance.
    ///
    /// # Correctness
    ///
    /// 1. The test has the `f64` operations of the contact test.
    /// 2. Its distance by axis is at most that of any two spheres. Its radii and its cutoff are at least theirs.
    /// 3. Every operation is monotone, with or without rounding.
    /// 4. Effective radii of larger distances are cut at the largest `f32` number, so that such a radius limits no
    ///    distance.
    #[inline]
    pub fn overlaps(&self, other: &Self, space: &Space, cutoff: f64) -> bool {
        let lengths = space.lengths_f32();
        let gap = |axis: usize| {
            let ours = [self.low[axis], self.high[axis]].map(f64::from);
            gap(ours, [other.low[axis], other.high[axis]].map(f64::from), lengths[axis])
        };
        let (x, y, z) = (gap(0), gap(1), gap(2));
        let is_limited = self.radius < f32::MAX && other.radius < f32::MAX;
        let radii = f64::from(self.radius) + f64::from(other.radius);
        let reach = if is_limited { radii.min(cutoff) } else { cutoff };
        x * x + y * y + z * z <= reach * reach
    }
}

/// Is on a ring if `length` is given.
#[inline]
fn gap(a: [f64; 2], b: [f64; 2], length: Option<f32>) -> f64 {
    let direct = (b[0] - a[1]).max(a[0] - b[1]).max(0.0);
    match length {
        // Points are at most this span apart, or at least the rest of the ring.
        Some(length) => direct.min((f64::from(length) - (a[1].max(b[1]) - a[0].min(b[0]))).max(0.0)),
        None => direct,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sphere(x: f32, radius: f32) -> WrappedSphere {
        WrappedSphere { center: [x, 0.0, 0.0].into(), radius, group: 0 }
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
        assert!(ClassBounds::all_of(&[]).is_empty());
    }

    #[test]
    fn touching_sphere_overlaps_and_next_float_does_not() {
        let bounds = ClassBounds::all_of(&[sphere(0.0, 1.0), sphere(4.0, 1.0)])[0];
        let overlaps = |x, radius| overlap(&bounds, &sphere(x, radius), &Space::UNBOUNDED, f64::INFINITY);
        assert!(overlaps(2.0, 0.0) && overlaps(6.0, 1.0) && overlaps(-2.0, 1.0));
        assert!(!overlaps(6.0_f32.next_up(), 1.0) && !overlaps((-2.0_f32).next_down(), 1.0));
        assert!(overlaps(f32::MAX, f32::MAX));
        let far = |sign: f32| WrappedSphere { center: [sign * 3e38; 3].into(), ..sphere(0.0, f32::MAX) };
        let one = ClassBounds::around(&far(1.0));
        assert!(overlap(&one, &far(-1.0), &Space::UNBOUNDED, f64::INFINITY));
        // Only the cutoff limits the distance of spheres with this radius.
        let huge = sphere(0.0, f32::MAX);
        assert!(overlap(
            &bounds,
            &WrappedSphere { center: [9.0, 0.0, 0.0].into(), ..huge },
            &Space::UNBOUNDED,
            5.0
        ));
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
