//! A round vessel. Its wall reflects paths like a billiard, which conserves volumes, so a uniform density stays uniform
//! at any step length.

use crate::random::gaussian::{cos_sin, direction};
use crate::random::philox::open_unit;

/// A cylinder, which the boundary of its axis may limit, or a sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vessel {
    /// Axis of a cylinder: 0, 1 or 2. `None` is a sphere.
    pub along: Option<usize>,
    /// A point on the middle line, or the center of a sphere, in µm.
    pub center: [f32; 3],
    /// In µm.
    pub radius: f32,
}

/// Limit of reflections in a step; a particle with more stays at the wall.
const BOUNCES: usize = 64;

impl Vessel {
    #[inline(always)]
    pub fn inset(self, radius: f32) -> Self {
        Self { radius: self.radius - radius, ..self }
    }

    /// Removes the component along a cylinder.
    #[inline(always)]
    pub(crate) fn across(&self, mut v: [f64; 3]) -> [f64; 3] {
        if let Some(along) = self.along {
            v[along] = 0.0;
        }
        v
    }

    /// Returns the vector from the middle line or center.
    pub(crate) fn offset(&self, p: [f64; 3]) -> [f64; 3] {
        self.across(std::array::from_fn(|k| p[k] - f64::from(self.center[k])))
    }

    /// Returns the distance from the middle line or center.
    pub fn distance(&self, p: [f32; 3]) -> f64 {
        self.length(self.offset(p.map(f64::from)))
    }

    pub(crate) fn length(&self, v: [f64; 3]) -> f64 {
        // Coordinates are `f32`, so no square overflows. `hypot` would take a quarter of a step.
        let v = self.across(v);
        dot(v, v).sqrt()
    }

    /// Mirrors a position beyond the wall along the line through the middle line or center until it is inside.
    pub fn confine(&self, mut p: [f32; 3]) -> [f32; 3] {
        let (distance, radius) = (self.distance(p), f64::from(self.radius));
        if distance > radius {
            let rest = (distance + radius).rem_euclid(4.0 * radius);
            let folded = radius - (2.0 * radius - rest).abs();
            let factor = if folded.is_finite() { folded / distance } else { 0.0 };
            let mirrored = self.offset(p.map(f64::from)).map(|c| c * factor);
            self.set_offset(&mut p, mirrored);
        }
        p
    }

    /// Replaces the components across a cylinder, or all of a sphere, by those of a uniform point.
    pub(crate) fn uniform_point(&self, mut p: [f32; 3], words: [u32; 4]) -> [f32; 3] {
        let unit = f64::from(open_unit(words[0]));
        let offset = match self.along {
            None => direction(words[1], words[2]).map(|c| libm::cbrt(unit) * f64::from(c)),
            Some(along) => {
                let mut across = [0.0; 3];
                let [cosine, sine] = cos_sin(words[1]).map(f64::from);
                across[(along + 1) % 3] = unit.sqrt() * cosine;
                across[(along + 2) % 3] = unit.sqrt() * sine;
                across
            }
        };
        self.set_offset(&mut p, offset.map(|c| f64::from(self.radius) * c));
        p
    }

    fn set_offset(&self, p: &mut [f32; 3], at: [f64; 3]) {
        let mut shrunk = 1.0;
        loop {
            for k in (0..3).filter(|&k| Some(k) != self.along) {
                p[k] = (f64::from(self.center[k]) + shrunk * at[k]) as f32;
            }
            if self.distance(*p) <= f64::from(self.radius) || shrunk <= 0.99 {
                return;
            }
            shrunk -= 1e-7;
        }
    }

    /// Returns the end of a reflected path, and reflects `velocity`.
    pub fn reflect(&self, from: [f32; 3], mut to: [f32; 3], velocity: &mut [f32; 3]) -> [f32; 3] {
        let radius = f64::from(self.radius);
        if self.distance(to) <= radius {
            return to;
        }
        let mut at = self.offset(from.map(f64::from));
        let end = self.offset(to.map(f64::from));
        let displacement: [f64; 3] = std::array::from_fn(|k| end[k] - at[k]);
        let outside = (self.length(at) / radius).max(1.0);
        at = at.map(|c| c / outside);
        let at = self.follow_path(at, displacement, |_, normal, _| {
            *velocity = mirrored(velocity.map(f64::from), normal).map(|v| v as f32);
        });
        self.set_offset(&mut to, at);
        to
    }

    /// Returns the offset at the end. At each reflection, calls `on_reflection` with the offset, the normal and the
    /// fraction of the remaining path.
    #[inline(always)]
    fn follow_path(
        &self,
        mut at: [f64; 3],
        mut displacement: [f64; 3],
        mut on_reflection: impl FnMut([f64; 3], [f64; 3], f64),
    ) -> [f64; 3] {
        let radius = f64::from(self.radius);
        for _ in 0..BOUNCES {
            let [a, b] = [dot(displacement, displacement), dot(at, displacement)];
            let c = (dot(at, at) - radius * radius).min(0.0);
            let t = (-b + (b * b - a * c).max(0.0).sqrt()) / a;
            if a == 0.0 || t >= 1.0 {
                return std::array::from_fn(|k| at[k] + displacement[k]);
            }
            at = std::array::from_fn(|k| at[k] + t * displacement[k]);
            let normal = at.map(|c| c / radius);
            on_reflection(at, normal, t);
            displacement = mirrored(displacement.map(|c| (1.0 - t) * c), normal);
        }
        at
    }

    /// Returns the corners and ends of a reflected path, each with its fraction of the path.
    pub(crate) fn corners(&self, from: [f32; 3], to: [f32; 3]) -> Vec<(f64, [f64; 3])> {
        let begin = from.map(f64::from);
        let whole: [f64; 3] = std::array::from_fn(|k| f64::from(to[k]) - begin[k]);
        let center = self.center.map(f64::from);
        let point = |fraction: f64, offset: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|k| match self.along {
                Some(along) if k == along => begin[k] + fraction * whole[k],
                _ => center[k] + offset[k],
            })
        };
        let (mut corners, mut traveled) = (vec![(0.0, begin)], 0.0);
        let end = self.follow_path(self.offset(begin), self.across(whole), |at, _, fraction| {
            traveled += (1.0 - traveled) * fraction;
            corners.push((traveled, point(traveled, at)));
        });
        corners.push((1.0, point(1.0, end)));
        corners
    }
}

fn mirrored(v: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
    let out = dot(v, normal);
    std::array::from_fn(|k| v[k] - 2.0 * out * normal[k])
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    const VESSEL: Vessel = Vessel { along: Some(1), center: [1.0, 5.0, -2.0], radius: 2.0 };
    const SPHERE: Vessel = Vessel { along: None, ..VESSEL };

    fn close(found: [f32; 3], expected: [f32; 3]) {
        assert!(
            found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5),
            "{found:?} and not {expected:?}"
        );
    }

    #[test]
    fn reflected_paths_have_the_angle_of_incidence() {
        let mut velocity = [3.0, 7.0, 4.0];
        assert_eq!(VESSEL.reflect([1.0, 0.0, -2.0], [2.0, 9.0, -1.0], &mut velocity), [2.0, 9.0, -1.0]);
        assert_eq!(velocity, [3.0, 7.0, 4.0]);
        close(VESSEL.reflect([1.0, 0.0, -2.0], [1.0, 1.0, 1.0], &mut velocity), [1.0, 1.0, -1.0]);
        close(velocity, [3.0, 7.0, -4.0]);
        close(VESSEL.reflect([1.0, 0.0, -2.0], [1.0, 1.0, 5.0], &mut velocity), [1.0, 1.0, -3.0 - 0.0]);
        let half = 2.0_f32.sqrt();
        let start = [1.0 + half, 0.0, -2.0 - half];
        let mut velocity = [0.0, 1.0, 6.0];
        close(
            VESSEL.reflect(start, [1.0 + half, 0.0, -2.0 + 2.0 * half], &mut velocity),
            [1.0, 0.0, -2.0 + half],
        );
        close(velocity, [-6.0, 1.0, 0.0]);
        let mut velocity = [0.0, 6.0, 1.0];
        let end =
            SPHERE.reflect([1.0 - half, 5.0, -2.0], [1.0 - half, 5.0 + 2.0 * half, -2.0], &mut velocity);
        close(end, [1.0, 5.0 + half, -2.0]);
        close(velocity, [6.0, 0.0, 1.0]);
    }

    #[test]
    fn nothing_stays_outside() {
        assert_eq!(VESSEL.inset(0.5).confine([1.0, 9.0, 0.0]), [1.0, 9.0, -1.0]);
        assert_eq!(VESSEL.confine([1.0, 9.0, 3.0]), [1.0, 9.0, -3.0]);
        assert_eq!(VESSEL.confine([1.0, 9.0, 7.0]), [1.0, 9.0, -1.0]);
        assert_eq!(SPHERE.confine([1.0, 8.0, -2.0]), [1.0, 6.0, -2.0]);
        for vessel in [VESSEL, SPHERE] {
            let mut from = vessel.center;
            for k in 0..100_000_u32 {
                let z = crate::random::gaussian::normals(crate::random::philox::philox([k, 0, 0, 0], [1, 2]));
                let to = std::array::from_fn(|k| from[k] + 3.0 * z[k]);
                from = vessel.reflect(from, to, &mut [0.0; 3]);
                assert!(vessel.distance(from) <= 2.0, "{k}: {from:?}");
            }
        }
    }
}
