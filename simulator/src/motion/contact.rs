//! Separation of particles that overlap at the end of a step.
//!
//! Species that react with each other are not separated: a reaction may need them closer than contact.
//!
//! In each of four passes, a particle moves by the mean displacement that would separate its overlaps, unless it would
//! enter a reflecting receiver. Sums are integers, so their order has no effect.
//!
//! Overlaps below the rounding error of an `f32` distance remain and are not counted.

use lazygrid::Pair;
use rayon::prelude::*;

use crate::model::boundary::Boundary;
use crate::model::particles::Particles;
use crate::model::reactive_pairs::ReactivePairs;
use crate::model::receiver::rounding;
use crate::model::{Contact, Model};
use crate::random::gaussian::direction;
use crate::random::philox::{Purpose, StepKey};
use crate::reaction::distance_squared;

mod reflecting_spheres;

use reflecting_spheres::{ReflectingSpheres, Shift};

#[derive(Debug)]
pub struct Contacts {
    separates: bool,
    diffusion: Vec<f64>,
    reactive: ReactivePairs,
    reflecting_spheres: ReflectingSpheres,
    boundary: Boundary,
    center_domains: Vec<Boundary>,
    /// Unit of displacements, in µm.
    quantum: f64,
}

pub(crate) const PASSES: u32 = 4;
const CHUNK: usize = 4096;
/// Units per largest contact distance; the sum of 2²² such distances fits 64 bits.
const UNITS: f64 = (1_u64 << 40) as f64;

/// Index of a particle, and its displacement in units.
pub(crate) type Push = (u32, [i64; 3]);

impl Contacts {
    pub fn new(model: &Model) -> Self {
        let largest = model.species.iter().map(|species| f64::from(species.radius)).fold(0.0, f64::max);
        Self {
            separates: model.contact == Contact::Separate,
            diffusion: model.species.iter().map(|species| species.diffusion).collect(),
            reactive: ReactivePairs::new(model),
            reflecting_spheres: ReflectingSpheres::new(model),
            boundary: model.boundary,
            center_domains: model.center_domains(),
            quantum: 2.0 * largest / UNITS,
        }
    }

    pub fn separate(&self) -> bool {
        self.separates
    }

    pub(crate) fn set_centers(&mut self, centers: &[[f32; 3]]) {
        self.reflecting_spheres.set_centers(centers);
    }

    /// Separates the overlaps of `free` particles among `pairs`, and returns their number.
    pub fn resolve(
        &self,
        particles: &mut Particles,
        pairs: &[Pair],
        free: impl Fn(u32) -> bool + Sync,
        now: StepKey,
    ) -> u64 {
        let mut resolved = 0;
        for pass in 0..PASSES {
            let pushes = self.pushes(particles, pairs, &free, now);
            if pass == 0 {
                resolved = pushes.len() as u64 / 2;
            }
            if pushes.is_empty() {
                break;
            }
            self.displace(particles, pushes);
        }
        resolved
    }

    pub(crate) fn pushes(
        &self,
        particles: &Particles,
        pairs: &[Pair],
        free: impl Fn(u32) -> bool + Sync,
        now: StepKey,
    ) -> Vec<Push> {
        let kind = |at: u32| particles.species[at as usize];
        let separates =
            |&Pair { i, j }: &Pair| free(i) && free(j) && !self.reactive.contain(kind(i), kind(j));
        let push = |pair: &Pair| separates(pair).then(|| self.push(particles, *pair, now)).flatten();
        let chunks: Vec<Vec<[Push; 2]>> =
            pairs.par_chunks(CHUNK).map(|pairs| pairs.iter().filter_map(push).collect()).collect();
        chunks.into_iter().flatten().flatten().collect()
    }

    pub(crate) fn displace(&self, particles: &mut Particles, mut pushes: Vec<Push>) {
        pushes.par_sort_unstable();
        let shift = |of_one: &[Push]| {
            let unit = self.quantum / of_one.len() as f64;
            let at = of_one[0].0 as usize;
            let (species, from) = (particles.species[at], particles.position_of(at));
            let to = std::array::from_fn(|k| {
                let sum: i64 = of_one.iter().map(|(_, push)| push[k]).sum();
                (f64::from(from[k]) + sum as f64 * unit) as f32
            });
            Shift { at, species, from, to: self.center_domains[species as usize].confine(to) }
        };
        let mut shifts: Vec<Shift> = pushes.chunk_by(|a, b| a.0 == b.0).map(shift).collect();
        self.reflecting_spheres.retain_outside(&mut shifts);
        shifts.iter().for_each(|shift| particles.set_position(shift.at, shift.to));
    }

    fn push(&self, particles: &Particles, pair: Pair, now: StepKey) -> Option<[Push; 2]> {
        let [mut a, mut b] = [pair.i, pair.j];
        if particles.id[a as usize] > particles.id[b as usize] {
            (a, b) = (b, a);
        }
        let [i, j] = [a, b].map(|at| at as usize);
        let touch = particles.radius[i] + particles.radius[j];
        let distance = distance_squared(particles, Pair::new(a, b), &self.boundary).sqrt();
        let overlap = f64::from(touch) - distance;
        let [p, q] = [i, j].map(|at| particles.position_of(at));
        if overlap <= f64::from(rounding(p, touch)) {
            return None;
        }
        let normal: [f64; 3] = if distance > 0.0 {
            std::array::from_fn(|k| {
                self.boundary.axes[k].displacement_exact(f64::from(q[k]) - f64::from(p[k])) / distance
            })
        } else {
            let [_, _, first, second] =
                now.for_particle(particles.id[i]).draw(particles.id[j], Purpose::Pair);
            self.boundary.direction_within(direction(first, second)).map(f64::from)
        };
        let [da, db] = [i, j].map(|at| self.diffusion[particles.species[at] as usize]);
        let fraction = if da + db > 0.0 { da / (da + db) } else { 0.5 };
        let units = |by: f64| normal.map(|c| (by * c / self.quantum).round() as i64);
        Some([(a, units(-fraction * overlap)), (b, units((1.0 - fraction) * overlap))])
    }
}

#[cfg(test)]
mod tests;
