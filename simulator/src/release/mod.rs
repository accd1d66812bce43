//! Releases: a pure function of the model, the seed and the step.
//!
//! Bursts appear at the beginning of a step, particles of continuous release within it: they move and decay for the
//! rest, so numbers are right at any step length.

pub mod origins;

pub(crate) mod rank_slice;

use std::ops::Range;

use rand_distr::{Distribution, Poisson};

use crate::error::Error;
use crate::model::Model;
use crate::model::membrane::{MembraneStep, StepEnds};
use crate::model::particles::{Particle, Particles};
use crate::model::transmitter::{CountDistribution, Schedule, Transmitter};
use crate::random::gaussian;
use crate::random::philox::{Draws, Key, Purpose, open_unit};
use crate::reaction::decay::Decays;
use crate::release::rank_slice::RankSlice;

#[derive(Clone, Debug, Default)]
pub struct Released {
    /// Remaining particles.
    pub particles: Particles,
    /// Common to all ranks.
    pub next_id: u32,
    /// Released numbers, by species.
    pub released: Vec<u64>,
    /// Decays since the release, in the order of the model.
    pub decayed: Vec<u64>,
}

/// The step that a release begins, and its random numbers.
#[derive(Clone, Copy, Debug)]
pub struct ReleaseStep<'a> {
    pub decays: &'a Decays,
    pub key: Key,
    pub step: u32,
    /// Common to all ranks.
    pub next_id: u32,
    /// Centers of receivers at the beginning of the step, in µm.
    pub centers: &'a [[f32; 3]],
}

struct Batch<'a> {
    from: &'a Transmitter,
    center: [f32; 3],
    /// Time of the release or later, in s.
    now: f64,
    species: u32,
    count: u32,
    /// Lattice site of the first particle.
    site: u32,
    ages: Ages,
}

/// At the beginning of a step, in s.
#[derive(Clone, Copy)]
enum Ages {
    None,
    Between(f64, f64),
    Spaced(f64, f64),
}

impl Model {
    /// Returns the releases at the beginning of a step, with ids from `next_id`.
    ///
    /// # Errors
    /// [`Error::OutOfIds`].
    pub fn release(&self, at: ReleaseStep<'_>) -> Result<Released, Error> {
        self.release_slice(at, RankSlice::WHOLE)
    }

    pub(crate) fn release_slice(&self, at: ReleaseStep<'_>, slice: RankSlice) -> Result<Released, Error> {
        let ReleaseStep { decays, key, step, next_id, centers } = at;
        let mut batches: Vec<_> = self.all_batches(step, key).map(|(_, batch)| batch).collect();
        batches.iter_mut().for_each(|batch| batch.center = batch.from.center_among(centers));
        let released = u64::from(next_id) + batches.iter().map(|batch| u64::from(batch.count)).sum::<u64>();
        if released > lazygrid::MAX_SPHERES {
            return Err(Error::OutOfIds { released });
        }
        let mut out = Released {
            particles: Particles::default(),
            next_id: released as u32,
            released: vec![0; self.species.len()],
            decayed: vec![0; self.decays.len()],
        };
        let own = slice.of(released - u64::from(next_id));
        let (mut before, mut site) = (0, 0);
        for (k, batch) in batches.iter().enumerate() {
            let goes_on = k > 0 && std::ptr::eq(batches[k - 1].from, batch.from);
            site = if goes_on { site } else { batch.site };
            let [first, last] =
                [own.start, own.end].map(|at| at.saturating_sub(before).min(batch.count.into()) as u32);
            for nth in first..last {
                let id = next_id + before as u32 + nth;
                self.add(batch, (id, site.wrapping_add(nth), nth), (decays, key), &mut out);
            }
            before += u64::from(batch.count);
            site = site.wrapping_add(batch.count);
        }
        Ok(out)
    }

    /// Releases outside the schedule, with these ids, from which lattice sites follow. `at` has the centers and the
    /// key.
    pub(crate) fn burst(
        &self,
        from: &Transmitter,
        species: u32,
        ids: Range<u32>,
        at: ReleaseStep<'_>,
    ) -> Released {
        let ReleaseStep { decays, key, centers, .. } = at;
        let center = from.center_among(centers);
        let mut out = Released {
            particles: Particles::default(),
            next_id: ids.end,
            released: vec![0; self.species.len()],
            decayed: vec![0; self.decays.len()],
        };
        let [site, count] = [ids.start, ids.end - ids.start];
        let batch = Batch { from, center, now: 0.0, species, count, site, ages: Ages::None };
        for (nth, id) in (0..).zip(ids) {
            self.add(&batch, (id, id, nth), (decays, key), &mut out);
        }
        out
    }

    /// Returns transmitter, species and number of the releases at the beginning of a step, by id.
    pub fn releases(&self, step: u32, key: Key) -> impl Iterator<Item = (u32, u32, u32)> + '_ {
        self.all_batches(step, key).map(|(place, batch)| (place, batch.species, batch.count))
    }

    fn all_batches(&self, step: u32, key: Key) -> impl Iterator<Item = (u32, Batch<'_>)> {
        let of = move |(place, transmitter)| {
            self.batches(transmitter, place, step, key).into_iter().map(move |batch| (place, batch))
        };
        (0..).zip(&self.transmitters).flat_map(of)
    }

    fn batches<'a>(&self, from: &'a Transmitter, place: u32, step: u32, key: Key) -> Vec<Batch<'a>> {
        let mut words = Draws::new(key, place, step, Purpose::Count);
        let mut poisson = |mean: f64| match Poisson::new(mean) {
            Ok(distribution) => distribution.sample(&mut words).min(f64::from(u32::MAX)) as u32,
            Err(_) => 0,
        };
        let Schedule::Steady { from: begin, until, rates } = &from.schedule else {
            let bursts = from.bursts(place, step, self.time_step, key);
            let counts = bursts.into_iter().flatten();
            let batch = |(species, count)| {
                let count = if from.numbers == CountDistribution::Poisson {
                    poisson(f64::from(count))
                } else {
                    count
                };
                Batch { from, center: from.center, now: 0.0, species, count, site: 0, ages: Ages::None }
            };
            return counts.map(batch).collect();
        };
        let end_of = |step: u32| f64::from(step) * self.time_step;
        let now = end_of(step);
        let [first, last] = [begin.max(end_of(step.saturating_sub(1))), until.min(now)];
        if first >= last {
            return Vec::new();
        }
        let before = |rate: f64| released_until(first, rate, *begin);
        let site = rates.iter().map(|&(_, rate)| before(rate)).sum::<f64>() as u64 as u32;
        let batch = |&(species, rate): &(u32, f64)| match from.numbers {
            CountDistribution::Poisson => {
                let count = poisson(rate * (last - first));
                let ages = Ages::Between(now - last, now - first);
                Batch { from, center: from.center, now, species, count, site, ages }
            }
            CountDistribution::Fixed => {
                let [before, after] = [before(rate), released_until(last, rate, *begin)];
                let oldest = now - begin - (before + 1.0) / rate;
                let ages = Ages::Spaced(oldest, 1.0 / rate);
                Batch { from, center: from.center, now, species, count: (after - before) as u32, site, ages }
            }
        };
        rates.iter().map(batch).collect()
    }

    fn hold_back(
        &self,
        species: u32,
        [from, to]: [[f32; 3]; 2],
        spread: f32,
        (key, id): (Key, u32),
    ) -> [f32; 3] {
        let (species, kind) = (species as usize, &self.species[species as usize]);
        let domain = self.boundary.inset(kind.radius);
        let (membranes, diffusion) = (&self.membranes, kind.diffusion);
        let step = MembraneStep { membranes, domain: &domain, species, diffusion, spread };
        let before = domain.confine(from);
        let free = std::array::from_fn(|k| before[k] + (to[k] - from[k]));
        let mut ends = StepEnds { end: free, free, after: domain.confine(to) };
        step.hold_back(before, &mut ends, (key, id, 0));
        ends.after
    }

    fn add(
        &self,
        batch: &Batch<'_>,
        (id, site, nth): (u32, u32, u32),
        (decays, key): (&Decays, Key),
        out: &mut Released,
    ) {
        out.released[batch.species as usize] += 1;
        let kind = &self.species[batch.species as usize];
        let mut velocity = self.own_velocity(batch.species, key.draw(id, 0, 0, Purpose::Velocity));
        let words = key.draw(id, 0, 0, Purpose::Release);
        let site = match batch.ages {
            // A Poisson process at each site: the number of earlier particles is unknown.
            Ages::Between(..) => batch.from.shape.random_site(words[0]),
            Ages::None | Ages::Spaced(..) => site,
        };
        let offset = batch.from.shape.offset(words, site, &self.boundary);
        let mut from: [f32; 3] = std::array::from_fn(|k| batch.center[k] + offset[k]);
        let [word, ..] = key.draw(id, 0, 0, Purpose::PartialStep);
        let age = match batch.ages {
            Ages::None => 0.0,
            Ages::Between(least, most) => least + f64::from(open_unit(word)) * (most - least),
            Ages::Spaced(oldest, less) => (oldest - f64::from(nth) * less).max(0.0),
        };
        let mut species = Some(batch.species);
        let mut position = from;
        if age > 0.0 {
            if let Some(carrier) = batch.from.carrier {
                // It was elsewhere at the time of release.
                let velocity = self.receivers[carrier as usize].velocity;
                from = std::array::from_fn(|k| from[k] - (velocity[k] * age) as f32);
            }
            let z = gaussian::normals(key.draw(id, 1, 0, Purpose::PartialStep));
            let length = (2.0 * kind.diffusion * age).sqrt() as f32;
            let part = self.flow_part([batch.now - age, batch.now]);
            let flow = self.flow_at(from).map(|v| part * v);
            let drift = |k: usize| ((kind.drift[k] + flow[k] + f64::from(velocity[k])) * age) as f32;
            position = std::array::from_fn(|k| from[k] + (length * z[k] + drift(k)));
            if !self.membranes.is_empty() {
                position = self.hold_back(batch.species, [from, position], length, (key, id));
            }
            let words = |generation| key.draw(id, 1 + generation, 0, Purpose::PartialStep);
            let turned = || key.draw(id, 1, 0, Purpose::Velocity);
            decays.continue_chain(batch.species, age, words, |decay, product| {
                out.decayed[decay as usize] += 1;
                if let (Some(from), Some(to)) = (species, product) {
                    velocity = self.converted_velocity(velocity, [from, to], turned);
                }
                species = product;
            });
        }
        let Some(species) = species else { return };
        let radius = self.species[species as usize].radius;
        let position = self.boundary.inset(radius).confine(position);
        out.particles.push(Particle { position, velocity, radius, species, id }, self.has_velocity());
    }
}

/// Returns the number of evenly spaced particles from `begin` until `time`, in s. Numbers of successive steps add up
/// exactly, since the end of each is the beginning of the next.
fn released_until(time: f64, rate: f64, begin: f64) -> f64 {
    // A few roundings of the time, for instance a particle that is due at the end of a step.
    let rounding = (4.0 * f64::EPSILON * rate * time).max(1e-9);
    (rate * (time - begin) + rounding).floor()
}

#[cfg(test)]
mod tests;
