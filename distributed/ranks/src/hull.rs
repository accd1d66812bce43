use bytemuck::{Pod, Zeroable};
use lazygrid::Space;

use crate::{Body, Class};

/// The summary of a rank's spheres of one class for the other ranks: the box of their centres, and their largest effective
/// radius. 32 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Hull {
    low: [f32; 3],
    high: [f32; 3],
    radius: f32,
    // The class follows from the radius, as all radii of a hull are of one.
    spheres: u32,
}

impl Hull {
    /// One hull per class that occurs among the bodies, by rising class.
    pub fn of(bodies: &[Body]) -> Vec<Self> {
        let mut hulls = [None::<Self>; Class::COUNT];
        for body in bodies {
            let hull = &mut hulls[body.class().index()];
            match hull {
                Some(hull) => hull.add(body),
                None => *hull = Some(Self::around(body)),
            }
        }
        hulls.into_iter().flatten().collect()
    }

    fn around(body: &Body) -> Self {
        let center = body.center.to_array();
        Self { low: center, high: center, radius: body.radius, spheres: 1 }
    }

    fn add(&mut self, body: &Body) {
        for (axis, x) in body.center.to_array().into_iter().enumerate() {
            self.low[axis] = self.low[axis].min(x);
            self.high[axis] = self.high[axis].max(x);
        }
        self.radius = self.radius.max(body.radius);
        self.spheres = self.spheres.saturating_add(1);
    }

    /// The class of all spheres in it.
    #[inline]
    pub fn class(&self) -> Class {
        Class::of(self.radius)
    }

    /// Returns `true` if a body may overlap a sphere in this hull. Never wrong when it says no.
    #[inline]
    pub fn meets(&self, space: &Space, body: &Body) -> bool {
        self.meets_hull(space, &Self::around(body))
    }

    /// Returns `true` if a sphere of the one hull may overlap a sphere of the other. Never wrong when it says no.
    ///
    /// Why: this evaluates what decides contact, in the same `f64` operations, at distances per axis that no two spheres
    /// of the hulls undercut and for radii that none exceed. Every operation is monotone, rounded or not.
    #[inline]
    pub fn meets_hull(&self, space: &Space, other: &Self) -> bool {
        let lengths = space.lengths_f32();
        let gap = |axis: usize| {
            let ours = [self.low[axis], self.high[axis]].map(f64::from);
            gap(ours, [other.low[axis], other.high[axis]].map(f64::from), lengths[axis])
        };
        let (x, y, z) = (gap(0), gap(1), gap(2));
        let reach = f64::from(self.radius) + f64::from(other.radius);
        x * x + y * y + z * z <= reach * reach
    }
}

/// The least distance of two intervals `[low, high]`, on a ring where the axis has a length.
#[inline]
fn gap(a: [f64; 2], b: [f64; 2], length: Option<f32>) -> f64 {
    let straight = (b[0] - a[1]).max(a[0] - b[1]).max(0.0);
    match length {
        // Points of the intervals are no farther apart than this span, hence no nearer the other way round than what it
        // leaves of the ring.
        Some(length) => straight.min((f64::from(length) - (a[1].max(b[1]) - a[0].min(b[0]))).max(0.0)),
        None => straight,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(x: f32, radius: f32) -> Body {
        Body { center: [x, 0.0, 0.0].into(), radius }
    }

    #[test]
    fn one_hull_per_class() {
        let hulls = Hull::of(&[body(0.0, 1.0), body(5.0, 1.5), body(-1.0, 2.0), body(9.0, 0.0)]);
        assert_eq!(hulls.len(), 3);
        assert!(hulls.is_sorted_by_key(Hull::class));
        assert_eq!((hulls[1].low[0], hulls[1].high[0], hulls[1].radius), (0.0, 5.0, 1.5));
        assert!(Hull::of(&[]).is_empty());
    }

    #[test]
    fn touching_meets_and_a_hair_more_does_not() {
        let hull = Hull::of(&[body(0.0, 1.0), body(4.0, 1.0)])[0];
        let meets = |x, radius| hull.meets(&Space::UNBOUNDED, &body(x, radius));
        assert!(meets(2.0, 0.0) && meets(6.0, 1.0) && meets(-2.0, 1.0));
        assert!(!meets(6.0_f32.next_up(), 1.0) && !meets((-2.0_f32).next_down(), 1.0));
        assert!(meets(f32::MAX, f32::MAX));
    }

    #[test]
    fn rings_close() {
        let space = Space::periodic([Some(10.0), None, None]).unwrap();
        let hull = Hull::of(&[body(-4.5, 0.5), body(-4.0, 0.5)])[0];
        let meets = |x, radius| hull.meets(&space, &body(x, radius));
        assert!(meets(4.5, 0.5) && meets(5.0, 0.0) && meets(-3.5, 0.0));
        assert!(!meets(4.5, 0.25) && !meets(0.0, 3.0));
    }
}
