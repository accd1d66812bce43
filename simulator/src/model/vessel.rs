//! A circular vessel. Its wall reflects paths one by one; such billiards conserve volumes, so a uniform density stays
//! uniform at any step length.

/// A cylinder along an axis, possibly with ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vessel {
    /// Axis: 0, 1 or 2.
    pub along: usize,
    /// Point on the axis, in µm.
    pub center: [f32; 3],
    /// Radius, in µm.
    pub radius: f32,
}

/// Reflections per step; then a particle stays at the wall.
const BOUNCES: usize = 64;

impl Vessel {
    /// Returns the vessel for centers of spheres of this radius.
    #[inline(always)]
    pub fn inset(self, radius: f32) -> Self {
        Self { radius: self.radius - radius, ..self }
    }

    pub(crate) fn across(&self) -> [usize; 2] {
        [(self.along + 1) % 3, (self.along + 2) % 3]
    }

    pub(crate) fn offset(&self, p: [f64; 3]) -> [f64; 2] {
        self.across().map(|k| p[k] - f64::from(self.center[k]))
    }

    /// Returns the distance from the axis, in µm.
    pub fn distance(&self, p: [f32; 3]) -> f64 {
        let [y, z] = self.offset(p.map(f64::from));
        y.hypot(z)
    }

    /// Mirrors a position beyond the wall. One beyond twice the radius goes to the axis.
    pub fn confine(&self, mut p: [f32; 3]) -> [f32; 3] {
        let (distance, radius) = (self.distance(p), f64::from(self.radius));
        if distance > radius {
            let factor = (2.0 * radius - distance).max(0.0) / distance;
            let mirrored = self.offset(p.map(f64::from)).map(|c| c * factor);
            self.put(&mut p, mirrored);
        }
        p
    }

    fn put(&self, p: &mut [f32; 3], at: [f64; 2]) {
        for (k, c) in self.across().into_iter().zip(at) {
            p[k] = (f64::from(self.center[k]) + c) as f32;
        }
        let mut shrunk = 1.0;
        while self.distance(*p) > f64::from(self.radius) && shrunk > 0.99 {
            shrunk -= 1e-7;
            for (k, c) in self.across().into_iter().zip(at) {
                p[k] = (f64::from(self.center[k]) + shrunk * c) as f32;
            }
        }
    }

    /// Returns the end of a path with reflections, which change `velocity` too.
    pub fn reflect(&self, from: [f32; 3], mut to: [f32; 3], velocity: &mut [f32; 3]) -> [f32; 3] {
        let radius = f64::from(self.radius);
        if self.distance(to) <= radius {
            return to;
        }
        let mut at = self.offset(from.map(f64::from));
        let end = self.offset(to.map(f64::from));
        let mut way = [end[0] - at[0], end[1] - at[1]];
        let outside = (at[0].hypot(at[1]) / radius).max(1.0);
        at = at.map(|c| c / outside);
        for _ in 0..BOUNCES {
            let [a, b] = [way[0] * way[0] + way[1] * way[1], at[0] * way[0] + at[1] * way[1]];
            let c = (at[0] * at[0] + at[1] * at[1] - radius * radius).min(0.0);
            let t = (-b + (b * b - a * c).max(0.0).sqrt()) / a;
            if a == 0.0 || t >= 1.0 {
                at = [at[0] + way[0], at[1] + way[1]];
                break;
            }
            at = [at[0] + t * way[0], at[1] + t * way[1]];
            let normal = at.map(|c| c / radius);
            let turned = |v: [f64; 2]| {
                let out = v[0] * normal[0] + v[1] * normal[1];
                [v[0] - 2.0 * out * normal[0], v[1] - 2.0 * out * normal[1]]
            };
            way = turned(way.map(|c| (1.0 - t) * c));
            let v = turned(self.across().map(|k| f64::from(velocity[k])));
            self.across().into_iter().zip(v).for_each(|(k, v)| velocity[k] = v as f32);
        }
        self.put(&mut to, at);
        to
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VESSEL: Vessel = Vessel { along: 1, center: [1.0, 5.0, -2.0], radius: 2.0 };

    fn close(found: [f32; 3], expected: [f32; 3]) {
        assert!(
            found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5),
            "{found:?} and not {expected:?}"
        );
    }

    #[test]
    fn ways_are_those_of_light() {
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
    }

    #[test]
    fn nothing_stays_outside() {
        assert_eq!(VESSEL.inset(0.5).confine([1.0, 9.0, 0.0]), [1.0, 9.0, -1.0]);
        assert_eq!(VESSEL.confine([1.0, 9.0, 90.0]), [1.0, 9.0, -2.0]);
        let mut from = [1.0, 0.0, -2.0];
        for k in 0..100_000_u32 {
            let [x, _, z] =
                crate::random::gaussian::normals(crate::random::philox::philox([k, 0, 0, 0], [1, 2]));
            from = VESSEL.reflect(from, [from[0] + 3.0 * x, 0.0, from[2] + 3.0 * z], &mut [0.0; 3]);
            assert!(VESSEL.distance(from) <= 2.0, "{k}: {from:?}");
        }
    }
}
