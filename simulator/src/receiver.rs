//! Spheres that count particles.

use crate::boundary::Boundary;
use crate::philox::{Key, Purpose, open_unit};

/// A sphere that counts.
#[derive(Clone, Debug, PartialEq)]
pub struct Receiver {
    /// Its name in output.
    pub name: String,
    /// Its centre, in µm.
    pub center: [f32; 3],
    /// Its radius, in µm.
    pub radius: f32,
    /// How it counts.
    pub kind: Kind,
    /// Whether it sees a species, species by species.
    pub sees: Vec<bool>,
}

/// How a receiver counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Removes and counts what reaches it, also between two steps: with both ends of a step outside, at distances
    /// `a` and `b` from the surface, the path met the sphere with probability exp(−ab/(DΔt)). On average over the
    /// angle between the ends that is exact for a sphere.
    Absorbing,
    /// Removes and counts what is inside at the end of a step, and overlooks all that was inside only between.
    Endpoint,
    /// Lets everything through and says how many are inside.
    Transparent,
}

/// Beyond this exponent the probability is below the smallest random number.
const NEVER: f32 = 17.0;

/// Whether a particle that went from `before` to `after` met the sphere. `diffusion_step` is DΔt of its species in
/// µm².
#[inline]
pub fn meets(receiver: &Receiver, boundary: &Boundary, ends: [[f32; 3]; 2], diffusion_step: f32) -> Meeting {
    let [a, b] = ends.map(|end| height(receiver, boundary, end));
    if b <= 0.0 {
        return Meeting::Sure;
    }
    if receiver.kind == Kind::Endpoint {
        return Meeting::Never;
    }
    let exponent = a * b / diffusion_step;
    // A particle at rest gives 0/0 on the surface only, which is met at the end of the step.
    if exponent < NEVER { Meeting::Probably(libm::expf(-exponent)) } else { Meeting::Never }
}

/// Whether a path met a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Meeting {
    /// It did.
    Sure,
    /// It did not.
    Never,
    /// With this probability.
    Probably(f32),
}

impl Meeting {
    /// Draws where chance decides.
    #[inline]
    pub fn happens(self, key: Key, id: u32, receiver: u32, step: u32) -> bool {
        match self {
            Self::Sure => true,
            Self::Never => false,
            Self::Probably(p) => open_unit(key.draw(id, receiver, step, Purpose::Receiver)[0]) < p,
        }
    }
}

/// Distance of a point from the receiver's surface, negative inside.
#[inline(always)]
pub fn height(receiver: &Receiver, boundary: &Boundary, point: [f32; 3]) -> f32 {
    let [x, y, z] = boundary.offset(receiver.center, point);
    (x * x + y * y + z * z).sqrt() - receiver.radius
}

#[cfg(test)]
mod tests {
    use super::*;

    fn receiver(kind: Kind) -> Receiver {
        Receiver { name: "r".into(), center: [1.0, 0.0, 0.0], radius: 1.0, kind, sees: vec![true] }
    }

    #[test]
    fn crossing_follows_the_bridge() {
        let open = Boundary::default();
        let ends = [[2.5, 0.0, 0.0], [1.0, 1.25, 0.0]];
        let Meeting::Probably(p) = meets(&receiver(Kind::Absorbing), &open, ends, 0.25) else { panic!() };
        assert!((p - (-0.5_f32).exp()).abs() < 1e-6);
        assert_eq!(meets(&receiver(Kind::Endpoint), &open, ends, 0.25), Meeting::Never);
        assert_eq!(meets(&receiver(Kind::Absorbing), &open, ends, 0.0), Meeting::Never);
        let inside = [[9.0, 0.0, 0.0], [1.5, 0.0, 0.0]];
        assert_eq!(meets(&receiver(Kind::Endpoint), &open, inside, 0.25), Meeting::Sure);
    }

    #[test]
    fn a_receiver_is_met_across_the_seam() {
        let periodic = Boundary::periodic([0.0; 3], [10.0; 3]);
        assert_eq!(height(&receiver(Kind::Absorbing), &periodic, [9.5, 0.0, 9.0]), 1.5_f32.hypot(1.0) - 1.0);
    }
}
