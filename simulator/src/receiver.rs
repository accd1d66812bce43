//! Spheres that count particles.

use crate::boundary::Boundary;
use crate::particles::Particles;

/// A sphere that counts. A particle is where its centre is, whatever its radius.
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

impl Receiver {
    /// How many particles of each species are inside the sphere, of those that it sees.
    pub fn inside(&self, boundary: &Boundary, particles: &Particles) -> Vec<u64> {
        let mut counts = vec![0; self.sees.len()];
        for (at, &species) in particles.species.iter().enumerate() {
            let species = species as usize;
            if self.sees[species] && height(self, boundary, particles.position_of(at)) <= 0.0 {
                counts[species] += 1;
            }
        }
        counts
    }
}

/// How a receiver counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Removes and counts what reaches it, also between two steps; see [`crossing`](crate::crossing).
    Absorbing,
    /// Removes and counts what is inside at the end of a step, and overlooks all that was inside only between.
    Endpoint,
    /// Lets everything through and says how many are inside.
    Transparent,
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
    fn a_receiver_is_met_across_the_seam() {
        let periodic = Boundary::periodic([0.0; 3], [10.0; 3]);
        assert_eq!(height(&receiver(Kind::Absorbing), &periodic, [9.5, 0.0, 9.0]), 1.5_f32.hypot(1.0) - 1.0);
    }
}
