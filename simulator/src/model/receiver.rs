use lazygrid::{Algorithm, Backend, Config, Detector, Interactions, Order, Spheres};

use crate::Error;
use crate::model::boundary::Boundary;
use crate::model::particles::Particles;
use crate::model::receptors::ReceptorType;

/// A sphere, or a wall, that acts on particles by their centers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Receiver {
    pub name: String,
    /// Center at the beginning of the run, in µm.
    pub center: [f32; 3],
    pub radius: f32,
    pub kind: ReceiverKind,
    /// `true` for the species that the receiver acts on.
    pub sees: Vec<bool>,
    /// In µm/s.
    pub velocity: [f64; 3],
    /// In µm²/s.
    pub diffusion: f64,
    /// In µm²/s, for bound particles.
    pub surface_diffusion: f64,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub enum ReceiverKind {
    /// Removes and counts particles whose path reaches it; see [`path_hit`](crate::motion::path_hit).
    #[default]
    Absorbing,
    /// Removes and counts particles inside at the end of a step.
    Endpoint,
    /// Lets particles pass and counts those inside.
    Transparent,
    /// Reflects particles and counts nothing.
    Reflecting,
    /// Removes and counts some of the particles that reach it, reflects the others.
    Partial(Adsorption),
    /// Binds particles to receptors, reflects the others, counts bound ones.
    Receptors(Vec<ReceptorType>),
    /// Wall that removes and counts particles whose path reaches it.
    Wall(WallFace),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WallFace {
    /// The lower wall across this axis.
    Low(usize),
    /// The upper wall across this axis.
    High(usize),
    /// The curved wall of a vessel.
    Side,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Adsorption {
    /// Probability at the surface per particle and step; the rate depends on the time step.
    PerStep(f64),
    /// Reactivity κ, in µm/s: the flux is κ times the local concentration.
    Reactivity(f64),
}

impl ReceiverKind {
    pub fn reflects(&self) -> bool {
        matches!(self, Self::Reflecting | Self::Partial(_) | Self::Receptors(_))
    }

    pub(crate) fn is_active_sphere(&self) -> bool {
        !matches!(self, Self::Transparent | Self::Wall(_))
    }

    pub fn absorbs(&self) -> bool {
        matches!(self, Self::Absorbing | Self::Endpoint | Self::Partial(_) | Self::Wall(_))
    }
}

impl Receiver {
    pub fn counts(&self, species: usize) -> bool {
        let counts = match self.kind {
            ReceiverKind::Reflecting => false,
            ReceiverKind::Receptors(_) => self.binds(species),
            _ => true,
        };
        self.sees[species] && counts
    }

    /// Returns `true` if the receiver counts particles inside or bound now, not arrivals.
    pub fn is_momentary(&self) -> bool {
        matches!(self.kind, ReceiverKind::Transparent | ReceiverKind::Receptors(_))
    }

    pub(crate) fn reflects_some(&self) -> bool {
        self.kind.reflects() && self.sees.contains(&true)
    }

    pub(crate) fn is_across(&self, axis: usize) -> bool {
        let faces = [WallFace::Low(axis), WallFace::High(axis)];
        matches!(self.kind, ReceiverKind::Wall(face) if faces.contains(&face))
    }

    pub fn moves(&self) -> bool {
        self.velocity != [0.0; 3] || self.diffusion > 0.0
    }

    /// Returns counts around `center`, by species; 0 for those that `sees` excludes.
    pub fn inside(&self, center: [f32; 3], boundary: &Boundary, particles: &Particles) -> Vec<u64> {
        let mut counts = vec![0; self.sees.len()];
        for at in (0..particles.len()).filter(|&at| self.has_inside(center, boundary, particles, at)) {
            counts[particles.species[at] as usize] += 1;
        }
        counts
    }

    fn has_inside(&self, center: [f32; 3], boundary: &Boundary, particles: &Particles, at: usize) -> bool {
        self.sees[particles.species[at] as usize]
            && signed_distance(self.radius, center, boundary, particles.position_of(at)) <= 0.0
    }
}

/// Largest number of receivers that test every particle: 0.7 times the time of a search for one receiver, 2.5 times for
/// two (two cores of an AMD EPYC).
const MAX_TESTED: usize = 1;
const CHUNK: usize = 1 << 16;

pub(crate) fn all_inside(
    receivers: &[Receiver],
    centers: &[[f32; 3]],
    boundary: &Boundary,
    particles: &Particles,
) -> Vec<Vec<u64>> {
    let mut counts: Vec<Vec<u64>> = receivers.iter().map(|receiver| vec![0; receiver.sees.len()]).collect();
    for (k, at) in inside_of(receivers, centers, boundary, particles) {
        counts[k as usize][particles.species[at as usize] as usize] += 1;
    }
    counts
}

pub(crate) fn inside_of(
    receivers: &[Receiver],
    centers: &[[f32; 3]],
    boundary: &Boundary,
    particles: &Particles,
) -> Vec<(u32, u32)> {
    let looks = |(_, receiver): &(usize, &Receiver)| receiver.kind == ReceiverKind::Transparent;
    let looking: Vec<usize> = receivers.iter().enumerate().filter(looks).map(|(k, _)| k).collect();
    if looking.len() > MAX_TESTED
        && let Ok(found) = found_inside(receivers, &looking, centers, boundary, particles)
    {
        return found;
    }
    // Also serves non-finite coordinates, which the detector rejects.
    let has = |k: usize, at: usize| receivers[k].has_inside(centers[k], boundary, particles, at);
    let pairs_inside =
        |k: usize| (0..particles.len()).filter(move |&at| has(k, at)).map(move |at| (k as u32, at as u32));
    looking.into_iter().flat_map(pairs_inside).collect()
}

fn found_inside(
    receivers: &[Receiver],
    looking: &[usize],
    centers: &[[f32; 3]],
    boundary: &Boundary,
    particles: &Particles,
) -> Result<Vec<(u32, u32)>, Error> {
    let mut inside = Vec::new();
    // Grown by the rounding error, so that nothing is missed.
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
            if receivers[k].has_inside(centers[k], boundary, particles, pair.j as usize) {
                inside.push((k as u32, pair.j));
            }
        }
        std::ops::ControlFlow::Continue(())
    })?;
    Ok(inside)
}

/// Creates a CPU detector with pairs in any order.
pub(crate) fn finder(boundary: &Boundary) -> Result<Detector, Error> {
    finder_with(boundary, None)
}

pub(crate) fn finder_with(
    boundary: &Boundary,
    interactions: Option<Interactions>,
) -> Result<Detector, Error> {
    let config = Config::default().backend(Backend::Cpu).algorithm(Algorithm::Auto).order(Order::Unordered);
    Ok(Detector::new(config.space(boundary.space()?).interactions(interactions))?)
}

/// Bounds the rounding error of distances up to `distance` from a point, in µm.
#[inline(always)]
pub(crate) fn rounding(point: [f32; 3], distance: f32) -> f32 {
    4e-6 * (point[0].abs() + point[1].abs() + point[2].abs() + distance)
}

/// Returns the distance from a sphere's surface, in µm, negative inside.
#[inline(always)]
pub fn signed_distance(radius: f32, center: [f32; 3], boundary: &Boundary, point: [f32; 3]) -> f32 {
    let [x, y, z] = boundary.displacement(center, point);
    (x * x + y * y + z * z).sqrt() - radius
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::particles::Particle;
    use crate::random::philox::{open_unit, philox};

    #[test]
    fn distance_crosses_the_periodic_boundary() {
        let periodic = Boundary::periodic([0.0; 3], [10.0; 3]);
        assert_eq!(
            signed_distance(1.0, [1.0, 0.0, 0.0], &periodic, [9.5, 0.0, 9.0]),
            1.5_f32.hypot(1.0) - 1.0
        );
    }

    #[test]
    fn many_receivers_count_as_each_does() {
        let mut particles = Particles::default();
        let random_point = |k: u32| philox([k, 0, 0, 0], [5, 0]).map(|word| 10.0 * open_unit(word));
        for id in 0..3000 {
            let [x, y, z, _] = random_point(id);
            particles
                .push(Particle { id, position: [x, y, z], species: id % 3, ..Particle::default() }, false);
        }
        for boundary in [Boundary::default(), Boundary::periodic([0.0; 3], [10.0; 3])] {
            let one = |k: u32| {
                let kind =
                    if k.is_multiple_of(5) { ReceiverKind::Absorbing } else { ReceiverKind::Transparent };
                let radius = 0.3 * (1 + k % 4) as f32;
                Receiver { radius, kind, sees: vec![true, k.is_multiple_of(2), true], ..Receiver::default() }
            };
            let receivers: Vec<Receiver> = (0..60).map(one).collect();
            let centers: Vec<[f32; 3]> =
                (0..60).map(|k| random_point(k + 9000)).map(|[x, y, z, _]| [x, y, z]).collect();
            let found = all_inside(&receivers, &centers, &boundary, &particles);
            let mut all = 0;
            for (k, receiver) in receivers.iter().enumerate() {
                let expected = match receiver.kind {
                    ReceiverKind::Transparent => receiver.inside(centers[k], &boundary, &particles),
                    _ => vec![0; 3],
                };
                assert_eq!(found[k], expected, "{k}");
                all += expected.iter().sum::<u64>();
            }
            assert!(all > 100, "{all}");
        }
    }
}
