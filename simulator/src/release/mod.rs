//! Releases: a pure function of the model, the seed and the step.
//!
//! Bursts appear at the beginning of a step, particles of steady release within it.

pub mod origins;

mod partial_step;
pub(crate) mod rank_slice;

use rand_distr::{Distribution, Poisson};

use crate::error::Error;
use crate::model::Model;
use crate::model::particles::{Particle, Particles};
use crate::model::transmitter::{CountDistribution, Schedule, Shape, Transmitter};
use crate::motion::receiver_state::ReceiverMove;
use crate::motion::surfaces::Surfaces;
use crate::random::philox::{Draws, Key, Purpose, open_unit};
use crate::reaction::decay::Decays;
use crate::release::origins::Arrival;
use crate::release::rank_slice::RankSlice;

/// Draws of a point within a vessel.
const MAX_ATTEMPTS: u32 = 64;

#[derive(Clone, Debug, Default)]
pub(crate) struct ReleasedParticles {
    /// Particles that neither arrived nor decayed without products.
    pub(crate) particles: Particles,
    /// Equal on all ranks.
    pub(crate) next_id: u32,
    pub(crate) released: Vec<u64>,
    pub(crate) decayed: Vec<u64>,
    pub(crate) arrivals: Vec<Arrival>,
}

#[derive(Clone, Debug)]
pub(crate) struct PartialEvents {
    decays: Decays,
    surfaces: Surfaces,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct ReleaseStep<'a> {
    pub(crate) events: &'a PartialEvents,
    pub(crate) key: Key,
    pub(crate) step: u32,
    /// Equal on all ranks.
    pub(crate) next_id: u32,
    /// Receivers at the beginning of the step, with displacements in the step before.
    pub(crate) receiver_moves: &'a [ReceiverMove],
}

/// Particles of one species from a burst, or from the steady release of a step.
pub(crate) struct Batch<'a> {
    transmitter: u32,
    from: &'a Transmitter,
    /// Center of the transmitter at the beginning of the step, in µm.
    center: [f32; 3],
    /// Beginning of the step, in s; 0 for bursts, whose particles have no age.
    now: f64,
    species: u32,
    count: u32,
    /// Lattice site of the first particle, unless `continues`.
    site: u32,
    /// Sites continue those of the previous batch.
    continues: bool,
    ages: Ages,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Emission {
    pub(crate) transmitter: u32,
    pub(crate) species: u32,
    pub(crate) count: u32,
}

#[derive(Clone, Copy, Debug)]
struct AgedParticle {
    particle: Particle,
    age: f64,
}

/// Times since the release, at the beginning of a step.
#[derive(Clone, Copy)]
enum Ages {
    None,
    /// Uniform between two ages.
    Between(f64, f64),
    /// The largest age, and the difference of successive ones.
    Spaced(f64, f64),
}

impl PartialEvents {
    pub(crate) fn new(model: &Model) -> Self {
        Self { decays: Decays::new(model), surfaces: Surfaces::new(model) }
    }
}

impl ReleasedParticles {
    fn new(model: &Model, next_id: u32) -> Self {
        Self {
            next_id,
            released: vec![0; model.species.len()],
            decayed: vec![0; model.decays.len()],
            ..Self::default()
        }
    }
}

impl Model {
    /// Returns the releases at the beginning of a step.
    ///
    /// # Errors
    /// [`Error::OutOfIds`] if ids would exceed the largest one. Those of [`Particles::reserve`].
    pub(crate) fn release(&self, at: ReleaseStep<'_>, slice: RankSlice) -> Result<ReleasedParticles, Error> {
        let ReleaseStep { key, step, next_id, receiver_moves, .. } = at;
        let mut batches: Vec<_> = self.all_batches(step, key).collect();
        batches.iter_mut().for_each(|batch| batch.center = center_among(receiver_moves, batch.from));
        let released = u64::from(next_id) + batches.iter().map(|batch| u64::from(batch.count)).sum::<u64>();
        if released > lazygrid::MAX_SPHERES {
            return Err(Error::OutOfIds { released });
        }
        let mut out = ReleasedParticles::new(self, released as u32);
        // Frequent releases of few particles fill all ranks equally.
        let range = slice.range(released - u64::from(next_id), next_id);
        out.particles.reserve(range.end - range.start, self.has_velocity())?;
        let (mut before, mut site) = (0, 0);
        for batch in &batches {
            site = if batch.continues { site } else { batch.site };
            let [first, last] =
                [range.start, range.end].map(|at| at.saturating_sub(before).min(batch.count.into()) as u32);
            out.released[batch.species as usize] += u64::from(last - first);
            let born = (first..last).map(|nth| {
                let id = next_id + before as u32 + nth;
                let age = batch.age(nth, key.draw(id, 0, 0, Purpose::PartialStep)[0]);
                AgedParticle { particle: self.create_particle(batch, (id, site.wrapping_add(nth)), key), age }
            });
            match batch.ages {
                Ages::None => born.for_each(|born| self.add(born.particle, &mut out)),
                Ages::Between(..) | Ages::Spaced(..) => {
                    self.add_later(batch, born, at, &mut out);
                }
            }
            before += u64::from(batch.count);
            site = site.wrapping_add(batch.count);
        }
        Ok(out)
    }

    /// Releases a [`Batch::from_ids`].
    ///
    /// # Errors
    /// See [`Particles::reserve`].
    pub(crate) fn burst(&self, batch: &Batch<'_>, key: Key) -> Result<ReleasedParticles, Error> {
        let ids = batch.site..batch.site + batch.count;
        let mut out = ReleasedParticles::new(self, ids.end);
        out.particles.reserve(batch.count.into(), self.has_velocity())?;
        out.released[batch.species as usize] += u64::from(batch.count);
        ids.for_each(|id| self.add(self.create_particle(batch, (id, id), key), &mut out));
        Ok(out)
    }

    /// Transmitters, species and numbers, in the order of ids.
    pub fn releases(&self, step: u32, key: Key) -> impl Iterator<Item = (u32, u32, u32)> + '_ {
        self.all_batches(step, key).map(|batch| (batch.transmitter, batch.species, batch.count))
    }

    fn all_batches(&self, step: u32, key: Key) -> impl Iterator<Item = Batch<'_>> {
        let batches = move |(index, transmitter)| self.batches(transmitter, index, step, key);
        (0..).zip(&self.transmitters).flat_map(batches)
    }

    fn batches<'a>(&self, from: &'a Transmitter, index: u32, step: u32, key: Key) -> Vec<Batch<'a>> {
        let mut words = Draws::new(key, index, step, Purpose::Count);
        // The sampler refuses greater means, which exceed all ids anyway.
        let mut poisson = |mean: f64| match Poisson::new(mean.min(Poisson::<f64>::MAX_LAMBDA)) {
            Ok(distribution) => distribution.sample(&mut words).min(f64::from(u32::MAX)) as u32,
            Err(_) => 0,
        };
        let Schedule::Steady { from: begin, until, rates } = &from.schedule else {
            let bursts = from.bursts(index, step, self.time_step, key);
            let entries = bursts.into_iter().flat_map(|burst| burst.into_iter().enumerate());
            let batch = |(entry, (species, count))| {
                let count = if from.numbers == CountDistribution::Poisson {
                    poisson(f64::from(count))
                } else {
                    count
                };
                Batch::from_burst(from, Emission { transmitter: index, species, count }, entry > 0)
            };
            return entries.map(batch).collect();
        };
        let end_of = |step: u32| f64::from(step) * self.time_step;
        let now = end_of(step);
        let [first, last] = [begin.max(end_of(step.saturating_sub(1))), until.min(now)];
        if first >= last {
            return Vec::new();
        }
        let before = |rate: f64| released_until(first, rate, *begin);
        let site = rates.iter().map(|&(_, rate)| before(rate)).sum::<f64>() as u64 as u32;
        let batch = |(entry, &(species, rate)): (usize, &(u32, f64))| {
            let (count, ages) = match from.numbers {
                CountDistribution::Poisson => {
                    (poisson(rate * (last - first)), Ages::Between(now - last, now - first))
                }
                CountDistribution::Fixed => {
                    let [before, after] = [before(rate), released_until(last, rate, *begin)];
                    let oldest = now - begin - (before + 1.0) / rate;
                    ((after - before) as u32, Ages::Spaced(oldest, 1.0 / rate))
                }
            };
            Batch {
                now,
                site,
                ages,
                ..Batch::from_burst(from, Emission { transmitter: index, species, count }, entry > 0)
            }
        };
        rates.iter().enumerate().map(batch).collect()
    }

    fn create_particle(&self, batch: &Batch<'_>, (id, site): (u32, u32), key: Key) -> Particle {
        let species = batch.species;
        let velocity = self.own_velocity(species, key.draw(id, 0, 0, Purpose::Velocity));
        let words = key.draw(id, 0, 0, Purpose::Release);
        let site = match batch.ages {
            // In a Poisson process the number of earlier particles is unknown, so each site is random.
            Ages::Between(..) => batch.from.shape.random_site(words[0]),
            Ages::None | Ages::Spaced(..) => site,
        };
        let position = self.position_at_site(batch, words, site);
        let position = self
            .drawn_within_vessel(batch, position, |part| key.draw_part([id, 0], part, 0, Purpose::Release));
        Particle { position, velocity, radius: 0.0, species, id }
    }

    fn position_at_site(&self, batch: &Batch<'_>, words: [u32; 4], site: u32) -> [f32; 3] {
        let offset = batch.from.shape.offset(words, site, &self.boundary);
        std::array::from_fn(|k| batch.center[k] + offset[k])
    }

    /// Returns `position`, or another point of the transmitter if a vessel excludes it. A far larger shape fills the
    /// vessel uniformly.
    fn drawn_within_vessel(
        &self,
        batch: &Batch<'_>,
        position: [f32; 3],
        words: impl Fn(u32) -> [u32; 4],
    ) -> [f32; 3] {
        let shape = batch.from.shape;
        let inset = || Some(self.boundary.vessel?.inset(self.species[batch.species as usize].radius));
        let Some(vessel) = inset().filter(|_| shape != Shape::Point) else { return position };
        let is_inside = |position: &[f32; 3]| vessel.distance(*position) <= f64::from(vessel.radius);
        if is_inside(&position) {
            return position;
        }
        let draw = |part: u32| {
            let words = words(part);
            self.position_at_site(batch, words, shape.random_site(words[0]))
        };
        let drawn = (1..=MAX_ATTEMPTS).map(draw).find(is_inside);
        drawn.unwrap_or_else(|| vessel.uniform_point(position, words(MAX_ATTEMPTS + 1)))
    }

    fn add(&self, particle: Particle, out: &mut ReleasedParticles) {
        let radius = self.species[particle.species as usize].radius;
        let position = self.boundary.inset(radius).confine(particle.position);
        out.particles.push(Particle { position, radius, ..particle }, self.has_velocity());
    }
}

impl<'a> Batch<'a> {
    fn from_burst(from: &'a Transmitter, emission: Emission, continues: bool) -> Self {
        let Emission { transmitter, species, count } = emission;
        let (center, now, site, ages) = (from.center, 0.0, 0, Ages::None);
        Self { transmitter, from, center, now, species, count, site, continues, ages }
    }

    /// Creates a batch outside the schedule. Ids ascend from `first_id`, and also select lattice sites.
    pub(crate) fn from_ids(
        from: &'a Transmitter,
        emission: Emission,
        first_id: u32,
        receiver_moves: &[ReceiverMove],
    ) -> Self {
        let batch = Self::from_burst(from, emission, false);
        Self { center: center_among(receiver_moves, from), site: first_id, ..batch }
    }

    fn age(&self, nth: u32, word: u32) -> f64 {
        match self.ages {
            Ages::None => 0.0,
            Ages::Between(youngest, oldest) => youngest + f64::from(open_unit(word)) * (oldest - youngest),
            Ages::Spaced(oldest, less) => (oldest - f64::from(nth) * less).max(0.0),
        }
    }
}

fn center_among(receiver_moves: &[ReceiverMove], from: &Transmitter) -> [f32; 3] {
    let receiver_move = from.carrier.and_then(|carrier| receiver_moves.get(carrier as usize));
    receiver_move.map_or(from.center, |receiver_move| receiver_move.center)
}

/// Returns the evenly spaced particles released until `time`. Numbers of successive steps add up exactly: each begins
/// at the end of the previous.
fn released_until(time: f64, rate: f64, begin: f64) -> f64 {
    // Rounding of the time must not delay a particle that is due at the end of a step.
    let rounding = (4.0 * f64::EPSILON * rate * time).max(1e-9);
    (rate * (time - begin) + rounding).floor()
}

#[cfg(test)]
mod tests;
