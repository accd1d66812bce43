//! Resolution of overlaps between particles that do not react.
//!
//! A particle may overlap several others. Overlaps that share a particle are resolved in order of pair priority, each
//! from the result of the previous ones. Overlaps without a common particle are resolved in parallel.
//!
//! Each overlap is resolved at most once per step, so a step always ends. Positions are rounded to `f32`. If an overlap
//! is smaller than the spacing of the coordinates, no particle moves, and the overlap is not counted.

use lazygrid::Pair;
use rayon::prelude::*;

use crate::model::boundary::Boundary;
use crate::model::particles::Particles;
use crate::model::{Contact, Model};
use crate::random::gaussian::direction;
use crate::random::philox::{Key, Purpose};
use crate::reaction::distance_squared;
use crate::reaction::matching::{ConflictPolicy, Matching, ReactionCandidate};

/// Resolves the overlaps of a model.
#[derive(Debug)]
pub struct Contacts {
    contact: Contact,
    diffusion: Vec<f64>,
    mass: Vec<f64>,
    boundary: Boundary,
    /// Boundaries of the particle centers, by species.
    center_domains: Vec<Boundary>,
    matching: Matching,
}

/// The new positions and velocities of two particles after a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Settled {
    position: [[f32; 3]; 2],
    velocity: [[f32; 3]; 2],
}

/// The number of pairs per parallel chunk.
const TASK: usize = 4096;

impl Contacts {
    /// Creates the contacts of a model that [`Model::check`] accepts.
    pub fn new(model: &Model) -> Self {
        let of = |get: fn(&crate::model::Species) -> f64| model.species.iter().map(get).collect();
        Self {
            contact: model.contact,
            diffusion: of(|species| species.diffusion),
            mass: of(|species| species.mass),
            boundary: model.boundary,
            center_domains: model.center_domains(),
            matching: Matching::default(),
        }
    }

    /// Returns `true` if the model resolves overlaps.
    pub fn act(&self) -> bool {
        matches!(self.contact, Contact::Separate | Contact::Elastic)
    }

    /// Resolves the overlaps among `pairs` if both particles are `free`. Returns the number of overlaps that changed a
    /// particle.
    pub fn settle(
        &mut self,
        particles: &mut Particles,
        pairs: &[Pair],
        free: impl Fn(u32) -> bool + Sync,
        (key, step): (Key, u32),
    ) -> u64 {
        let mut matching = std::mem::take(&mut self.matching);
        let overlap = |pair: &Pair| {
            let apart = distance_squared(particles, *pair, &self.boundary);
            let touch = reach(particles, *pair);
            (free(pair.i) && free(pair.j) && apart < touch * touch).then(|| {
                let ids = [pair.i, pair.j].map(|at| particles.id[at as usize]);
                let ids = [ids[0].min(ids[1]), ids[0].max(ids[1])];
                let [priority, ..] = key.draw(ids[0], ids[1], step, Purpose::Pair);
                let at =
                    if particles.id[pair.i as usize] == ids[0] { [pair.i, pair.j] } else { [pair.j, pair.i] };
                ReactionCandidate { at, consumes: [true; 2], rule: 0, priority, ids }
            })
        };
        let chunks: Vec<Vec<_>> =
            pairs.par_chunks(TASK).map(|pairs| pairs.iter().filter_map(overlap).collect()).collect();
        let mut overlaps = chunks.concat();
        let mut settled = 0;
        matching.rounds(&mut overlaps, particles.len(), ConflictPolicy::Defer, |overlaps, turn| {
            let settle =
                |&c: &u32| Some((c, self.settle_one(particles, &overlaps[c as usize], (key, step))?));
            let results: Vec<_> = turn.par_iter().with_min_len(256).filter_map(settle).collect();
            settled += results.len() as u64;
            for (c, Settled { position, velocity }) in results {
                for (k, at) in overlaps[c as usize].at.into_iter().enumerate() {
                    particles.set_position(at as usize, position[k]);
                    if self.contact == Contact::Elastic {
                        (0..3).for_each(|axis| particles.velocity[axis][at as usize] = velocity[k][axis]);
                    }
                }
            }
        });
        self.matching = matching;
        settled
    }

    /// Resolves one overlap. Returns `None` if earlier contacts separated the particles, if they move apart, or if
    /// rounding cancels the change.
    fn settle_one(
        &self,
        particles: &Particles,
        candidate: &ReactionCandidate,
        (key, step): (Key, u32),
    ) -> Option<Settled> {
        let [a, b] = candidate.at;
        let pair = Pair::new(a, b);
        let distance = distance_squared(particles, pair, &self.boundary).sqrt();
        let touch = reach(particles, pair);
        if distance >= touch {
            return None;
        }
        let [p, q] = [a, b].map(|at| particles.position_of(at as usize));
        let normal: [f64; 3] = if distance > 0.0 {
            std::array::from_fn(|k| {
                self.boundary.axes[k].displacement_exact(f64::from(q[k]) - f64::from(p[k])) / distance
            })
        } else {
            let [_, _, first, second] = key.draw(candidate.ids[0], candidate.ids[1], step, Purpose::Pair);
            direction(first, second).map(f64::from)
        };
        let [u, v] = [a, b].map(|at| particles.get(at as usize).velocity);
        let species = [a, b].map(|at| particles.species[at as usize] as usize);
        let settled = match self.contact {
            Contact::Elastic => {
                let velocity = bounce([u, v], species.map(|s| self.mass[s]), normal)?;
                Settled { position: [p, q], velocity }
            }
            _ => {
                // The gap equals the former overlap, as after a bounce.
                let apart = 2.0 * (touch - distance);
                let [da, db] = species.map(|s| self.diffusion[s]);
                let share = if da + db > 0.0 { da / (da + db) } else { 0.5 };
                let moved = |side: usize, from: [f32; 3], by: f64| {
                    let to = std::array::from_fn(|k| (f64::from(from[k]) + by * normal[k]) as f32);
                    self.center_domains[species[side]].confine(to)
                };
                Settled {
                    position: [moved(0, p, -share * apart), moved(1, q, (1.0 - share) * apart)],
                    velocity: [u, v],
                }
            }
        };
        (settled != Settled { position: [p, q], velocity: [u, v] }).then_some(settled)
    }
}

/// Returns the velocities after an elastic collision of smooth spheres. `normal` points from the first to the second
/// sphere. Returns `None` if they do not approach each other.
fn bounce([u, v]: [[f32; 3]; 2], [m, n]: [f64; 2], normal: [f64; 3]) -> Option<[[f32; 3]; 2]> {
    let approach: f64 = (0..3).map(|k| (f64::from(u[k]) - f64::from(v[k])) * normal[k]).sum();
    if approach <= 0.0 {
        return None;
    }
    let impulse = 2.0 * approach * m * n / (m + n);
    let after = |velocity: [f32; 3], by: f64| -> [f32; 3] {
        std::array::from_fn(|k| (f64::from(velocity[k]) + by * normal[k]) as f32)
    };
    Some([after(u, -impulse / m), after(v, impulse / n)])
}

/// Returns the contact distance, the sum of the radii.
fn reach(particles: &Particles, pair: Pair) -> f64 {
    f64::from(particles.radius[pair.i as usize]) + f64::from(particles.radius[pair.j as usize])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Species;
    use crate::model::particles::Particle;

    /// Runs four steps with two particles at `x` that overlap by `overlap` times their distance. Returns the number of
    /// resolved overlaps per step, and whether a particle moved.
    fn pushed(x: f32, overlap: f32) -> (Vec<u64>, bool) {
        let species = Species { name: "A".into(), diffusion: 1.0, mass: 1.0, ..Species::default() };
        let model =
            Model { species: vec![species], contact: Contact::Separate, time_step: 1.0, ..Model::default() };
        let mut particles = Particles::default();
        for id in 0..2 {
            let position = [x + id as f32, 0.0, 0.0];
            particles
                .push(Particle { id, position, radius: 0.5 + 0.5 * overlap, ..Particle::default() }, false);
        }
        let begun = particles.clone();
        let mut contacts = Contacts::new(&model);
        let settled = (0..4)
            .map(|step| contacts.settle(&mut particles, &[Pair::new(0, 1)], |_| true, (Key::new(1), step)));
        (settled.collect(), particles != begun)
    }

    #[test]
    fn what_rounding_cannot_part_stays_and_is_not_counted() {
        assert_eq!(pushed(0.0, 1e-4), (vec![1, 0, 0, 0], true));
        // The spacing of `f32` there is 2⁻¹⁰.
        assert_eq!(pushed(8192.0, 1e-4), (vec![0; 4], false));
        assert_eq!(pushed(8192.0, 0.25), (vec![1, 0, 0, 0], true));
    }
}
