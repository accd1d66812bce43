//! Spheres that count particles, or are in their way.

use lazygrid::{Algorithm, Backend, Config, Detector, Order, Spheres};

use crate::Error;
use crate::boundary::Boundary;
use crate::particles::Particles;

/// A sphere that counts particles, or is in their way. A particle is where its centre is, whatever its radius.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Receiver {
    /// Its name in output.
    pub name: String,
    /// Its centre at the beginning, in µm.
    pub center: [f32; 3],
    /// Its radius, in µm.
    pub radius: f32,
    /// What its surface does.
    pub kind: Kind,
    /// Whether it sees a species, species by species. Others go through it.
    pub sees: Vec<bool>,
    /// The velocity at which it goes, in µm/s.
    pub velocity: [f64; 3],
    /// Its diffusion coefficient, in µm²/s.
    pub diffusion: f64,
}

/// What the surface of a receiver does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Kind {
    /// Removes and counts what reaches it, also between two steps; see [`crossing`](crate::crossing).
    #[default]
    Absorbing,
    /// Removes and counts what is inside at the end of a step, and overlooks all that was inside only between.
    Endpoint,
    /// Lets everything through and says how many are inside.
    Transparent,
    /// Keeps out what is outside, and counts nothing.
    Reflecting,
    /// Removes and counts a part of what reaches it, and keeps out the rest.
    Partial(Sticking),
    /// Holds what binds to its receptors until it comes off again, keeps out the rest, and says how much it holds.
    Receptors(Receptors),
}

/// How much of what reaches a surface stays there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sticking {
    /// Each particle with this probability in each step in which it reaches the surface, whatever the length of steps.
    PerStep(f64),
    /// As many as a surface of this reactivity κ takes, in µm/s: the flux to it is κ times the concentration there.
    Reactivity(f64),
}

/// Alike receptors, anywhere on a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Receptors {
    /// How many there are; each holds one particle.
    pub count: u32,
    /// At which rate a free one binds, in µm³/s per particle: `n` free ones on a sphere have the reactivity
    /// n·rate/(4πR²).
    pub binding_rate: f64,
    /// At which rate a particle comes off, in 1/s.
    pub unbinding_rate: f64,
}

impl Kind {
    /// Whether the surface keeps out what comes from outside and does not stay there.
    pub fn turns_back(self) -> bool {
        matches!(self, Self::Reflecting | Self::Partial(_) | Self::Receptors(_))
    }

    /// Whether it removes particles for good, each of which is an arrival.
    pub fn takes_in(self) -> bool {
        matches!(self, Self::Absorbing | Self::Endpoint | Self::Partial(_))
    }
}

impl Receiver {
    /// Whether it has something to say of a species.
    pub fn counts(&self, species: usize) -> bool {
        self.sees[species] && self.kind != Kind::Reflecting
    }

    /// Whether it goes from place to place.
    pub fn moves(&self) -> bool {
        self.velocity != [0.0; 3] || self.diffusion > 0.0
    }

    /// How many particles of each species are inside the sphere around a point, of those that it sees.
    pub fn inside(&self, center: [f32; 3], boundary: &Boundary, particles: &Particles) -> Vec<u64> {
        let mut counts = vec![0; self.sees.len()];
        for at in 0..particles.len() {
            self.count(center, boundary, (particles, at), &mut counts);
        }
        counts
    }

    /// Counts a particle if it is inside the sphere around a point, and of a species that it sees.
    fn count(
        &self,
        center: [f32; 3],
        boundary: &Boundary,
        (particles, at): (&Particles, usize),
        counts: &mut [u64],
    ) {
        let species = particles.species[at] as usize;
        if self.sees[species] && height(self.radius, center, boundary, particles.position_of(at)) <= 0.0 {
            counts[species] += 1;
        }
    }
}

/// Transparent receivers up to this many look at every particle; more have those near them found. On the machine of the
/// tables in docs/simulator.md two take 2.5 times as long to look as a search does, and one 0.7 times.
const FEW: usize = 1;
/// Pairs that are looked at together.
const CHUNK: usize = 1 << 16;

/// How many particles of each species are inside each of the transparent receivers around these centres, and nothing for
/// others.
pub(crate) fn all_inside(
    receivers: &[Receiver],
    centers: &[[f32; 3]],
    boundary: &Boundary,
    particles: &Particles,
) -> Vec<Vec<u64>> {
    let looks = |(_, receiver): &(usize, &Receiver)| receiver.kind == Kind::Transparent;
    let looking: Vec<usize> = receivers.iter().enumerate().filter(looks).map(|(k, _)| k).collect();
    let nothing = || receivers.iter().map(|receiver| vec![0; receiver.sees.len()]).collect();
    if looking.len() > FEW
        && let Ok(found) = found_inside((receivers, &looking), centers, boundary, particles, nothing())
    {
        return found;
    }
    // Also where particles have left the range of numbers, which a detector does not take.
    let mut counts: Vec<Vec<u64>> = nothing();
    for k in looking {
        counts[k] = receivers[k].inside(centers[k], boundary, particles);
    }
    counts
}

/// Adds to the counts of those receivers that are `looking`.
fn found_inside(
    (receivers, looking): (&[Receiver], &[usize]),
    centers: &[[f32; 3]],
    boundary: &Boundary,
    particles: &Particles,
    mut counts: Vec<Vec<u64>>,
) -> Result<Vec<Vec<u64>>, Error> {
    // Larger than they are by what rounding may do: whether a particle is inside is decided as everywhere else.
    let grown = |&k: &usize| {
        let radius = receivers[k].radius;
        lazygrid::Sphere::new(centers[k], radius + rounding(centers[k], 2.0 * radius))
    };
    let spheres: Vec<_> = looking.iter().map(grown).collect();
    let points = vec![0.0; particles.len()];
    let [x, y, z] = &particles.position;
    let points = Spheres::columns(x, y, z, &points).map_err(lazygrid::Error::from)?;
    finder(boundary)?.stream((&spheres, points), CHUNK, |pairs| {
        for pair in pairs {
            let k = looking[pair.i as usize];
            receivers[k].count(centers[k], boundary, (particles, pair.j as usize), &mut counts[k]);
        }
        std::ops::ControlFlow::Continue(())
    })?;
    Ok(counts)
}

/// A detector of particles near receivers.
///
/// # Errors
/// [`Error::Detection`] for a box without extent.
pub(crate) fn finder(boundary: &Boundary) -> Result<Detector, Error> {
    let config = Config::default().backend(Backend::Cpu).algorithm(Algorithm::Auto).order(Order::Unordered);
    Ok(Detector::new(config.space(boundary.space()?))?)
}

/// More than rounding adds to distances up to this one from a point, or to such a reach.
#[inline(always)]
pub(crate) fn rounding(point: [f32; 3], distance: f32) -> f32 {
    4e-6 * (point[0].abs() + point[1].abs() + point[2].abs() + distance)
}

/// Distance of a point from the surface of a sphere, negative inside.
#[inline(always)]
pub fn height(radius: f32, center: [f32; 3], boundary: &Boundary, point: [f32; 3]) -> f32 {
    let [x, y, z] = boundary.offset(center, point);
    (x * x + y * y + z * z).sqrt() - radius
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::Particle;
    use crate::philox::{open_unit, philox};

    #[test]
    fn a_receiver_is_met_across_the_seam() {
        let periodic = Boundary::periodic([0.0; 3], [10.0; 3]);
        assert_eq!(height(1.0, [1.0, 0.0, 0.0], &periodic, [9.5, 0.0, 9.0]), 1.5_f32.hypot(1.0) - 1.0);
    }

    #[test]
    fn many_receivers_count_as_each_does() {
        let mut particles = Particles::default();
        let place = |k: u32| philox([k, 0, 0, 0], [5, 0]).map(|word| 10.0 * open_unit(word));
        for id in 0..3000 {
            let [x, y, z, _] = place(id);
            particles
                .push(Particle { id, position: [x, y, z], species: id % 3, ..Particle::default() }, false);
        }
        for boundary in [Boundary::default(), Boundary::periodic([0.0; 3], [10.0; 3])] {
            let one = |k: u32| {
                let kind = if k.is_multiple_of(5) { Kind::Absorbing } else { Kind::Transparent };
                let radius = 0.3 * (1 + k % 4) as f32;
                Receiver { radius, kind, sees: vec![true, k.is_multiple_of(2), true], ..Receiver::default() }
            };
            let receivers: Vec<Receiver> = (0..60).map(one).collect();
            let centers: Vec<[f32; 3]> =
                (0..60).map(|k| place(k + 9000)).map(|[x, y, z, _]| [x, y, z]).collect();
            let found = all_inside(&receivers, &centers, &boundary, &particles);
            let mut all = 0;
            for (k, receiver) in receivers.iter().enumerate() {
                let expected = match receiver.kind {
                    Kind::Transparent => receiver.inside(centers[k], &boundary, &particles),
                    _ => vec![0; 3],
                };
                assert_eq!(found[k], expected, "{k}");
                all += expected.iter().sum::<u64>();
            }
            assert!(all > 100, "{all}");
        }
    }
}
