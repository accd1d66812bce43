//! Collisions of particles on their paths within a step.
//!
//! Every particle moves along a line with a constant velocity until it collides with a wall or another particle. The next
//! collision of all is found from the times of impact of candidate pairs, so that a step of any length leaves no overlap that
//! was not there before. What a collision does depends on the contact of the model:
//!
//! - *Elastic*: the particles exchange momentum by their masses.
//! - *Separate*: a step of diffusion is a displacement whose variance is proportional to the diffusion coefficient D, as if the
//!   particle had the mass 1/D and a thermal velocity that each step draws again. Collisions by these masses keep the
//!   uniform distribution over all states without an overlap, because the motion conserves volumes and energy (A. Scala,
//!   T. Voigtmann and C. De Michele, *Event-driven Brownian dynamics for hard spheres*, Journal of Chemical Physics 126 (2007)
//!   134109).
//!
//! *Not detected* are collisions of two species that react with each other, which have to overlap in order to react, and of pairs
//! that overlap at the beginning. Elastic ones of these bounce at the beginning of the step if they approach each other.
//!
//! # Correctness
//!
//! 1. A candidate list holds every pair whose surfaces are within twice an allowance of each other. No pair that it lacks
//!    collides before one of its particles has traveled farther than the allowance.
//! 2. Events are processed in the order of their times, up to the horizon: the earliest time at which a particle may have
//!    traveled the allowance. Collisions that make a particle faster bring the horizon nearer. Then the list is rebuilt.
//! 3. Events are ordered by time, then by ids. A prediction uses only the two particles and the time of the event that caused it.
//!    So the result does not depend on the order of particles or candidates, nor on threads.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use lazygrid::Detector;
use rayon::prelude::*;

use crate::Error;
use crate::model::boundary::{Axis, Boundary};
use crate::model::particles::Particles;
use crate::model::receiver::{finder, rounding};
use crate::model::{Contact, Model};
use crate::motion::path_hit::Path;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Flight {
    pub(crate) path: Path,
    pub(crate) free_end: [f32; 3],
    /// Its velocity at the beginning, in µm/s.
    pub(crate) begun: [f32; 3],
    pub(crate) velocity: [f32; 3],
}

#[derive(Debug)]
pub(crate) struct Collisions {
    detector: Detector,
    contact: Contact,
    boundary: Boundary,
    domains: Vec<Boundary>,
    /// Reciprocal masses, by species: of momentum, or diffusion coefficients.
    mobility: Vec<f64>,
    /// `true` for two species that react with each other, by row and column.
    reacts: Vec<bool>,
    scratch: Scratch,
}

#[derive(Debug, Default)]
struct Scratch {
    movers: Vec<Mover>,
    rows: Vec<[f32; 4]>,
    neighbors: Adjacency,
}

#[derive(Clone, Copy, Debug)]
struct Mover {
    /// Its position at `time`, in µm, not wrapped at periodic boundaries.
    position: [f64; 3],
    time: f64,
    motion: [f64; 3],
    own: [f64; 3],
    /// The length of its path since the candidate list was built, in µm.
    traveled: f64,
    /// The number of events that changed its motion.
    stamp: u32,
    id: u32,
    species: u32,
    radius: f32,
    collided: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Event {
    time: f64,
    /// The ids of both particles, in ascending order; of a wall `u32::MAX`.
    ids: [u32; 2],
    at: [u32; 2],
    /// The stamps of both particles when the event was predicted; of a wall, its number.
    stamps: [u32; 2],
}

impl Eq for Event {}

impl Ord for Event {
    /// The earliest event is the greatest, as a [`BinaryHeap`] returns the greatest first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.time.total_cmp(&self.time).then_with(|| (other.ids, other.stamps).cmp(&(self.ids, self.stamps)))
    }
}

impl PartialOrd for Event {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

#[derive(Debug, Default)]
struct Adjacency {
    begins: Vec<u32>,
    neighbors: Vec<u32>,
}

const WALL: u32 = u32::MAX;
/// The number of the wall of a vessel, after those of the three axes.
const VESSEL_WALL: u32 = 6;
/// The allowance of candidates, as fractions of the mean distance between neighbors, of the largest radius, and of the
/// path of the fastest particle.
const ALLOWANCE: [f64; 3] = [0.25, 0.25, 1.25];
/// The largest number of collisions per particle and step, on average.
const MAX_COLLISIONS: u64 = 1000;
/// Collisions of few particles that are allowed beyond [`MAX_COLLISIONS`].
const MIN_BUDGET: u64 = 1_000_000;

impl Collisions {
    /// Creates the collisions of a model that [`Model::check`] accepts; `None` if its particles pass through each other.
    ///
    /// # Errors
    /// [`Error::Detection`] for a box without extent.
    pub(crate) fn new(model: &Model) -> Result<Option<Self>, Error> {
        let mobility = match model.contact {
            Contact::Separate => model.species.iter().map(|species| species.diffusion).collect(),
            Contact::Elastic => model.species.iter().map(|species| 1.0 / species.mass).collect(),
            _ => return Ok(None),
        };
        let species = model.species.len();
        let mut reacts = vec![false; species * species];
        for reaction in &model.reactions {
            let [a, b] = reaction.reactants.map(|species| species as usize);
            reacts[a * species + b] = true;
            reacts[b * species + a] = true;
        }
        Ok(Some(Self {
            detector: finder(&model.boundary)?,
            contact: model.contact,
            boundary: model.boundary,
            domains: model.center_domains(),
            mobility,
            reacts,
            scratch: Scratch::default(),
        }))
    }

    /// Lets particles collide on their flights, which change. Returns the number of collisions.
    ///
    /// # Errors
    /// [`Error::Step`] if the detector fails, and [`Error::Collisions`] if there are more than [`MAX_COLLISIONS`] per particle.
    pub(crate) fn resolve(
        &mut self,
        particles: &Particles,
        flights: &mut [Flight],
        step: u32,
    ) -> Result<u64, Error> {
        if particles.radius.iter().all(|&radius| radius == 0.0) {
            return Ok(0);
        }
        let mut scratch = std::mem::take(&mut self.scratch);
        let mover = |(at, flight): (usize, &Flight)| Mover::new(particles, at, flight);
        scratch.movers.clear();
        scratch.movers.par_extend(flights.par_iter().enumerate().map(mover));
        let result = self.run(&mut scratch, step);
        let domains = &self.domains;
        flights.par_iter_mut().zip(&scratch.movers).for_each(|(flight, mover)| {
            if mover.collided {
                mover.land(flight, &domains[mover.species as usize]);
            }
        });
        self.scratch = scratch;
        result
    }

    /// Moves particles from event to event through the step. Returns the number of collisions.
    fn run(&mut self, scratch: &mut Scratch, step: u32) -> Result<u64, Error> {
        let mut now = 0.0;
        let mut collisions = 0;
        let most = self.largest_allowance(&scratch.movers);
        let limit = MIN_BUDGET + MAX_COLLISIONS * scratch.movers.len() as u64;
        while now < 1.0 {
            let fastest =
                scratch.movers.par_iter().map(|m| dot(m.motion, m.motion)).reduce(|| 0.0, f64::max).sqrt();
            if !(fastest > 0.0 && fastest.is_finite()) {
                break;
            }
            let allowance = most.min(ALLOWANCE[2] * fastest * (1.0 - now));
            let mut candidates =
                self.candidates(scratch, allowance).map_err(|source| Error::Step { step, source })?;
            if now == 0.0 && self.contact == Contact::Elastic {
                collisions += self.bounce_overlaps(&mut scratch.movers, &candidates);
            }
            candidates.retain(|pair| !self.passes(pair.map(|at| &scratch.movers[at as usize])));
            scratch.neighbors.build(&candidates, scratch.movers.len());
            let mut horizon = f64::min(1.0, now + allowance / fastest);
            let movers = &scratch.movers;
            let pairs = candidates.par_iter().filter_map(|&pair| self.predict(movers, pair, now));
            let walls =
                (0..movers.len() as u32).into_par_iter().filter_map(|at| self.predict_wall(movers, at));
            let mut events: BinaryHeap<Event> =
                pairs.chain(walls).filter(|event| event.time <= horizon).collect::<Vec<_>>().into();
            while let Some(event) = events.pop() {
                if event.time > horizon {
                    break;
                }
                let movers = &mut scratch.movers;
                if !event.is_current(movers) {
                    continue;
                }
                now = event.time;
                let involved: &[u32] = if event.at[1] == WALL { &event.at[..1] } else { &event.at };
                involved.iter().for_each(|&at| movers[at as usize].advance(now));
                if event.at[1] == WALL {
                    self.reflect(&mut movers[event.at[0] as usize], event.stamps[1]);
                } else {
                    self.collide(movers, event.at);
                    collisions += 1;
                    if collisions > limit {
                        return Err(Error::Collisions { step, particles: movers.len() as u64, collisions });
                    }
                }
                for &at in involved {
                    let mover = &movers[at as usize];
                    let speed = dot(mover.motion, mover.motion).sqrt();
                    if speed > 0.0 {
                        horizon = horizon.min(now + (allowance - mover.traveled).max(0.0) / speed);
                    }
                    let others = scratch.neighbors.of(at).iter();
                    let next = others.filter_map(|&other| self.predict(movers, [at, other], now));
                    events.extend(
                        next.chain(self.predict_wall(movers, at)).filter(|event| event.time <= horizon),
                    );
                }
            }
            now = horizon;
            scratch.movers.par_iter_mut().for_each(|mover| {
                mover.advance(now);
                mover.traveled = 0.0;
            });
        }
        Ok(collisions)
    }

    fn largest_allowance(&self, movers: &[Mover]) -> f64 {
        let largest = f64::from(movers.iter().map(|m| m.radius).fold(0.0, f32::max));
        let extent = |k: usize| match self.boundary.axes[k] {
            Axis::Reflecting { low, high } | Axis::Periodic { low, high } => f64::from(high - low),
            Axis::Open => {
                let all = movers.iter().map(|m| m.position[k]);
                let (low, high) = all.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
                high - low
            }
        };
        let spacing =
            (0..3).map(extent).map(|x| x.max(largest)).product::<f64>() / movers.len().max(1) as f64;
        // A pair is tested at one image only.
        let image = self.boundary.axes.into_iter().filter_map(|axis| match axis {
            Axis::Periodic { low, high } => Some((f64::from(high - low) / 4.0 - largest).max(0.01 * largest)),
            _ => None,
        });
        image.fold((ALLOWANCE[0] * spacing.cbrt()).max(ALLOWANCE[1] * largest), f64::min)
    }

    fn candidates(
        &mut self,
        scratch: &mut Scratch,
        allowance: f64,
    ) -> Result<Vec<[u32; 2]>, lazygrid::Error> {
        let Scratch { movers, rows, .. } = scratch;
        let boundary = &self.boundary;
        let row = |mover: &Mover| {
            let [x, y, z] = mover.position.map(|c| c as f32);
            let radius = mover.radius + allowance as f32;
            [x, y, z, radius + rounding([x, y, z], radius)]
        };
        rows.clear();
        rows.par_extend(movers.par_iter().map(row));
        let touches = |[a, b]: [u32; 2]| {
            let [a, b] = [&movers[a as usize], &movers[b as usize]];
            a.radius + b.radius > 0.0 && {
                let reach = a.touch(b) + 2.0 * allowance;
                let d = a.displacement(b, boundary);
                dot(d, d) <= reach * reach
            }
        };
        let pairs = self.detector.pairs(rows.as_slice())?.par_iter().map(|pair| [pair.i, pair.j]);
        Ok(pairs.filter(|&pair| touches(pair)).collect())
    }

    fn passes(&self, [a, b]: [&Mover; 2]) -> bool {
        let reacts = self.reacts[a.species as usize * self.mobility.len() + b.species as usize];
        // The particle of the lower id, so that the order of particles has no effect.
        let first = if a.id < b.id { a } else { b };
        let tolerance = rounding(first.position.map(|c| c as f32), a.radius + b.radius);
        reacts || a.overlap(b, &self.boundary) > f64::from(tolerance)
    }

    /// Lets overlapping pairs that approach each other bounce, in the order of ids. Returns their number.
    fn bounce_overlaps(&self, movers: &mut [Mover], candidates: &[[u32; 2]]) -> u64 {
        let overlaps = |pair: &[u32; 2]| {
            let [a, b] = pair.map(|at| &movers[at as usize]);
            let ids = [a.id.min(b.id), a.id.max(b.id)];
            (self.passes([a, b]) && a.overlap(b, &self.boundary) > 0.0).then_some((ids, *pair))
        };
        let mut overlapping: Vec<_> = candidates.par_iter().filter_map(overlaps).collect();
        overlapping.sort_unstable();
        overlapping.iter().filter(|&&(_, pair)| self.collide(movers, pair)).count() as u64
    }

    fn predict(&self, movers: &[Mover], mut pair: [u32; 2], now: f64) -> Option<Event> {
        if movers[pair[0] as usize].id > movers[pair[1] as usize].id {
            pair.reverse();
        }
        let [a, b] = pair.map(|at| &movers[at as usize]);
        let [from, to] = [a, b].map(|mover| mover.position_at(now));
        let d: [f64; 3] = std::array::from_fn(|k| self.boundary.axes[k].displacement_exact(to[k] - from[k]));
        let relative: [f64; 3] = std::array::from_fn(|k| b.motion[k] - a.motion[k]);
        let approach = -dot(d, relative);
        if approach <= 0.0 {
            return None;
        }
        let apart = (dot(d, d) - a.touch(b).powi(2)).max(0.0);
        let root = approach * approach - dot(relative, relative) * apart;
        let time = now + apart / (approach + root.max(0.0).sqrt());
        (root >= 0.0).then_some(Event { time, ids: [a.id, b.id], at: pair, stamps: [a.stamp, b.stamp] })
    }

    fn predict_wall(&self, movers: &[Mover], at: u32) -> Option<Event> {
        let mover = &movers[at as usize];
        let domain = &self.domains[mover.species as usize];
        let Mover { position, motion, time, .. } = *mover;
        let plane = |k: usize| match domain.axes[k] {
            Axis::Reflecting { high, .. } if motion[k] > 0.0 => {
                Some(((f64::from(high) - position[k]) / motion[k], 2 * k as u32 + 1))
            }
            Axis::Reflecting { low, .. } if motion[k] < 0.0 => {
                Some(((f64::from(low) - position[k]) / motion[k], 2 * k as u32))
            }
            _ => None,
        };
        let cylinder = domain.vessel.and_then(|vessel| {
            let [p, w] = [vessel.offset(position), vessel.across().map(|k| motion[k])];
            let (a, b) = (w[0] * w[0] + w[1] * w[1], p[0] * w[0] + p[1] * w[1]);
            let c = (p[0] * p[0] + p[1] * p[1] - f64::from(vessel.radius).powi(2)).min(0.0);
            (a > 0.0).then(|| (((b * b - a * c).sqrt() - b) / a, VESSEL_WALL))
        });
        let (after, wall) = (0..3).filter_map(plane).chain(cylinder).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let ids = [mover.id, WALL];
        Some(Event { time: time + after.max(0.0), ids, at: [at, WALL], stamps: [mover.stamp, wall] })
    }

    fn reflect(&self, mover: &mut Mover, wall: u32) {
        mover.stamp += 1;
        match (wall, &self.domains[mover.species as usize].vessel) {
            (VESSEL_WALL, Some(vessel)) => {
                let out = vessel.offset(mover.position);
                let length = out[0].hypot(out[1]).max(f64::MIN_POSITIVE);
                let mut normal = [0.0; 3];
                vessel.across().into_iter().zip(out).for_each(|(k, c)| normal[k] = c / length);
                for velocity in [&mut mover.motion, &mut mover.own] {
                    let speed = dot(*velocity, normal);
                    (0..3).for_each(|k| velocity[k] -= 2.0 * speed * normal[k]);
                }
            }
            _ => {
                let axis = (wall / 2) as usize;
                mover.motion[axis] = -mover.motion[axis];
                mover.own[axis] = -mover.own[axis];
            }
        }
    }

    /// Exchanges momentum between two particles. Returns `false` if they do not approach each other.
    fn collide(&self, movers: &mut [Mover], mut pair: [u32; 2]) -> bool {
        if movers[pair[0] as usize].id > movers[pair[1] as usize].id {
            pair.reverse();
        }
        let [mut a, mut b] = pair.map(|at| movers[at as usize]);
        let d = a.displacement(&b, &self.boundary);
        let mut shares = [a.species, b.species].map(|species| self.mobility[species as usize]);
        if shares == [0.0; 2] {
            shares = [1.0; 2];
        }
        let exchange = |u: &mut [f64; 3], v: &mut [f64; 3]| {
            // The expression of a prediction, so both agree on the sign.
            let approach = -dot(d, std::array::from_fn(|k| v[k] - u[k]));
            if approach <= 0.0 {
                return false;
            }
            let impulse = 2.0 * approach / (dot(d, d) * (shares[0] + shares[1]));
            for k in 0..3 {
                u[k] -= impulse * shares[0] * d[k];
                v[k] += impulse * shares[1] * d[k];
            }
            true
        };
        let met = exchange(&mut a.motion, &mut b.motion);
        if self.contact == Contact::Elastic {
            exchange(&mut a.own, &mut b.own);
        }
        for (at, mut mover) in pair.into_iter().zip([a, b]) {
            mover.stamp += 1;
            mover.collided |= met;
            movers[at as usize] = mover;
        }
        met
    }
}

impl Mover {
    fn new(particles: &Particles, at: usize, flight: &Flight) -> Self {
        let position = flight.path.before.map(f64::from);
        Self {
            position,
            time: 0.0,
            motion: std::array::from_fn(|k| f64::from(flight.free_end[k]) - position[k]),
            own: flight.begun.map(f64::from),
            traveled: 0.0,
            stamp: 0,
            id: particles.id[at],
            species: particles.species[at],
            radius: particles.radius[at],
            collided: false,
        }
    }

    fn position_at(&self, time: f64) -> [f64; 3] {
        std::array::from_fn(|k| self.position[k] + (time - self.time) * self.motion[k])
    }

    fn advance(&mut self, time: f64) {
        self.traveled += (time - self.time) * dot(self.motion, self.motion).sqrt();
        self.position = self.position_at(time);
        self.time = time;
    }

    fn displacement(&self, other: &Self, boundary: &Boundary) -> [f64; 3] {
        std::array::from_fn(|k| boundary.axes[k].displacement_exact(other.position[k] - self.position[k]))
    }

    fn touch(&self, other: &Self) -> f64 {
        f64::from(self.radius) + f64::from(other.radius)
    }

    fn overlap(&self, other: &Self, boundary: &Boundary) -> f64 {
        let d = self.displacement(other, boundary);
        self.touch(other) - dot(d, d).sqrt()
    }

    fn land(&self, flight: &mut Flight, domain: &Boundary) {
        let end = self.position.map(|c| c as f32);
        let after = domain.confine(end);
        let end = std::array::from_fn(|k| match domain.axes[k] {
            Axis::Periodic { .. } => end[k],
            _ => after[k],
        });
        flight.path = Path { end, after, ..flight.path };
        if flight.path.diffusion == 0.0 {
            flight.path.drift = std::array::from_fn(|k| end[k] - flight.path.before[k]);
        }
        flight.velocity = self.own.map(|v| v as f32);
    }
}

impl Event {
    /// Returns `true` if neither particle has changed its motion since the event was predicted.
    fn is_current(&self, movers: &[Mover]) -> bool {
        let [a, b] = self.at;
        movers[a as usize].stamp == self.stamps[0]
            && (b == WALL || movers[b as usize].stamp == self.stamps[1])
    }
}

impl Adjacency {
    fn build(&mut self, pairs: &[[u32; 2]], particles: usize) {
        self.begins.clear();
        self.begins.resize(particles + 1, 0);
        pairs.iter().flatten().for_each(|&at| self.begins[at as usize + 1] += 1);
        (0..particles).for_each(|k| self.begins[k + 1] += self.begins[k]);
        self.neighbors.clear();
        self.neighbors.resize(2 * pairs.len(), 0);
        let mut next = self.begins.clone();
        for &[a, b] in pairs {
            for [at, other] in [[a, b], [b, a]] {
                let place = &mut next[at as usize];
                self.neighbors[*place as usize] = other;
                *place += 1;
            }
        }
    }

    fn of(&self, at: u32) -> &[u32] {
        let [begin, end] = [at, at + 1].map(|at| self.begins[at as usize] as usize);
        &self.neighbors[begin..end]
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
