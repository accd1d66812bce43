//! Collisions of particles on their paths within a step.
//!
//! Particles move along lines until they collide, so a step of any length leaves no new overlap. The contact sets the
//! result:
//!
//! - *Elastic*: the particles exchange momentum by their masses.
//! - *Separate*: diffusion is a thermal velocity, drawn per step, of a particle with the mass 1/D. Such collisions
//!   conserve volumes and energy, and so the uniform distribution over states without overlap (A. Scala, T. Voigtmann
//!   and C. De Michele, *Event-driven Brownian dynamics for hard spheres*, Journal of Chemical Physics 126 (2007)
//!   134109).
//!
//! # Correctness
//!
//! 1. A step consists of windows. A window's candidate list holds every pair of species that may collide whose surfaces
//!    are within twice an allowance. The window ends when its top speed, which no particle exceeds, has traveled the
//!    allowance, so no other pair collides.
//! 2. If a collision exceeds the top speed, the window begins again with a higher one.
//! 3. The events of a window happen in the order of times, then of ids (`rounds.rs`). A prediction uses only two
//!    particles, and candidates are tried in the order of ids. So neither threads nor the order of particles have an
//!    effect.
//! 4. Ranks do the same rounds together. The safety of an event depends on movers up to three candidate pairs away.
//!    With these ghosts, updated in every round, a rank decides on its events as one process does.

use bytemuck::{Pod, Zeroable};
use lazygrid::{Detector, Interactions, Spheres};
use rayon::prelude::*;

use crate::Error;
use crate::model::Model;
use crate::model::boundary::Axis;
use crate::model::particles::Particles;
use crate::model::receiver::{finder_with, rounding};
use crate::reaction::collision_interactions;

pub(crate) mod halo;
pub(crate) mod mover;
mod overlaps;
pub(crate) mod rounds;
pub(crate) mod rules;
#[cfg(test)]
pub(crate) mod tests;

use halo::Halo;
pub(crate) use mover::Flight;
use mover::{Mover, dot};
use overlaps::bounce_overlaps;
use rounds::{Adjacency, SLACK, Window, WindowEnd};
use rules::Rules;

#[derive(Debug)]
pub(crate) struct Collisions {
    detector: Detector,
    interactions: Option<Interactions>,
    rules: Rules,
    scratch: Scratch,
}

#[derive(Debug, Default)]
struct Scratch {
    movers: Vec<Mover>,
    movers_before: Vec<Mover>,
    rows: Vec<[f32; 4]>,
    species: Vec<u32>,
    neighbors: Adjacency,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Extent {
    count: u64,
    largest: f64,
    low: [f64; 3],
    high: [f64; 3],
}

/// Largest allowance: the larger of these fractions of the neighbors' mean distance and of the largest radius.
const ALLOWANCE: [f64; 2] = [0.25, 0.25];
/// Top speed of a window, relative to its fastest particle.
const TOP_SPEED: f64 = 1.15;
/// Largest mean number of collisions per particle and step.
const MAX_COLLISIONS: u64 = 1000;
/// Largest number of windows of a step at its top speed; each searches for candidates.
const MAX_WINDOWS: u32 = 100_000;
/// Additional collisions of a step, for runs of few particles.
const MIN_BUDGET: u64 = 1_000_000;

impl Collisions {
    /// Returns `None` if particles pass through each other.
    pub(crate) fn new(model: &Model) -> Result<Option<Self>, Error> {
        let Some(rules) = Rules::new(model) else { return Ok(None) };
        let interactions = collision_interactions(model)?;
        let detector = finder_with(&model.boundary, interactions.clone())?;
        Ok(Some(Self { detector, interactions, rules, scratch: Scratch::default() }))
    }

    pub(crate) fn interactions(&self) -> Option<&Interactions> {
        self.interactions.as_ref()
    }

    /// Changes the flights, and returns all ranks' collisions. Collective.
    ///
    /// # Errors
    /// [`Error::Step`] from the detector, [`Error::Collisions`] above [`MAX_COLLISIONS`], [`Error::LongPaths`] above
    /// [`MAX_WINDOWS`].
    pub(crate) fn resolve<H: Halo>(
        &mut self,
        particles: &Particles,
        flights: &mut [Flight],
        step: u32,
        halo: &mut H,
    ) -> Result<u64, H::Error> {
        let mut scratch = std::mem::take(&mut self.scratch);
        let mover = |(at, flight): (usize, &Flight)| Mover::new(particles, at, flight);
        scratch.movers.clear();
        scratch.movers.par_extend(flights.par_iter().enumerate().map(mover));
        let extent = Extent::from_ranks(halo.gather(Extent::new(&scratch.movers)));
        let result = if extent.largest > 0.0 { self.run(&mut scratch, extent, step, halo) } else { Ok(0) };
        let domains = &self.rules.domains;
        flights.par_iter_mut().zip(&scratch.movers).for_each(|(flight, mover)| {
            if mover.collided {
                mover.finish_flight(flight, &domains[mover.species as usize]);
            }
        });
        self.scratch = scratch;
        result
    }

    fn run<H: Halo>(
        &mut self,
        scratch: &mut Scratch,
        extent: Extent,
        step: u32,
        halo: &mut H,
    ) -> Result<u64, H::Error> {
        let own_count = scratch.movers.len();
        let (mut now, mut collisions, mut top_speed) = (0.0, 0, 0.0);
        let max_allowance = self.largest_allowance(&extent);
        let limit = MIN_BUDGET + MAX_COLLISIONS * extent.count;
        while now < 1.0 {
            top_speed = f64::max(top_speed, TOP_SPEED * fastest(&scratch.movers[..own_count], halo));
            if !(top_speed > 0.0 && top_speed.is_finite()) {
                break;
            }
            let path_length = top_speed * (1.0 - now);
            if path_length > f64::from(MAX_WINDOWS) * max_allowance {
                return halo.agree(Err(too_long(step, path_length, max_allowance)));
            }
            let allowance = max_allowance.min(path_length);
            scratch.movers.truncate(own_count);
            halo.add_ghosts(&mut scratch.movers, allowance)?;
            let candidates = self.candidates(scratch, allowance);
            let mut candidates = halo.agree(candidates.map_err(|source| Error::Step { step, source }))?;
            let Scratch { movers, movers_before, neighbors, .. } = &mut *scratch;
            if now == 0.0 && self.rules.is_elastic && collisions == 0 {
                collisions += bounce_overlaps(&self.rules, movers, own_count, &candidates, halo)?;
                top_speed = f64::max(top_speed, fastest(&movers[..own_count], halo));
            }
            candidates.retain(|pair| !self.rules.passes(pair.map(|at| &movers[at as usize])));
            neighbors.build(&candidates, movers.len());
            neighbors.sort_by_id(movers);
            movers_before.clone_from(movers);
            let horizon = f64::min(1.0, now + allowance / top_speed);
            let limit = limit.saturating_sub(collisions);
            let window =
                Window { rules: &self.rules, neighbors, own_count, horizon, top_speed, slack: SLACK, limit };
            match window.run(movers, halo)? {
                WindowEnd::Finished(hits) => collisions += hits,
                WindowEnd::TooFast(speed) => {
                    top_speed = TOP_SPEED * speed;
                    movers.clone_from(movers_before);
                    continue;
                }
                WindowEnd::TooMany(hits) => {
                    let collisions = collisions + hits;
                    return halo.agree(Err(Error::Collisions { step, particles: extent.count, collisions }));
                }
            }
            now = horizon;
            top_speed = 0.0;
            movers.par_iter_mut().for_each(|mover| mover.advance(now));
        }
        scratch.movers.truncate(own_count);
        Ok(collisions)
    }

    /// Returns the largest allowance, in µm.
    fn largest_allowance(&self, &Extent { count, largest, low, high }: &Extent) -> f64 {
        let axes = self.rules.boundary.axes;
        let extent = |k: usize| match axes[k] {
            Axis::Reflecting { low, high } | Axis::Periodic { low, high } => f64::from(high - low),
            _ => high[k] - low[k],
        };
        let present = (0..3).filter(|&k| axes[k] != Axis::Frozen);
        let space = present.map(|k| extent(k).max(largest)).product::<f64>() / count.max(1) as f64;
        let spacing = match self.rules.boundary.dimensions() {
            3 => space.cbrt(),
            2 => space.sqrt(),
            _ => space,
        };
        let image = axes.into_iter().filter_map(|axis| match axis {
            Axis::Periodic { low, high } => Some((f64::from(high - low) / 4.0 - largest).max(0.01 * largest)),
            _ => None,
        });
        image.fold((ALLOWANCE[0] * spacing).max(ALLOWANCE[1] * largest), f64::min)
    }

    fn candidates(
        &mut self,
        scratch: &mut Scratch,
        allowance: f64,
    ) -> Result<Vec<[u32; 2]>, lazygrid::Error> {
        let Scratch { movers, rows, species, .. } = scratch;
        let boundary = &self.rules.boundary;
        let row = |mover: &Mover| {
            let [x, y, z] = mover.position.map(|c| c as f32);
            let radius = mover.radius + allowance as f32;
            [x, y, z, radius + rounding([x, y, z], radius)]
        };
        rows.clear();
        rows.par_extend(movers.par_iter().map(row));
        let mut spheres = Spheres::from(rows.as_slice());
        if self.interactions.is_some() {
            species.clear();
            species.par_extend(movers.par_iter().map(|mover| mover.species));
            spheres = spheres.with_species(species)?;
        }
        let touches = |[a, b]: [u32; 2]| {
            let [a, b] = [&movers[a as usize], &movers[b as usize]];
            let cutoff = a.contact_distance(b) + 2.0 * allowance;
            let d = a.displacement(b, a.time, boundary);
            dot(d, d) <= cutoff * cutoff
        };
        let pairs = self.detector.pairs(spheres)?.par_iter().map(|pair| [pair.i, pair.j]);
        Ok(pairs.filter(|&pair| touches(pair)).collect())
    }
}

impl Extent {
    fn new(movers: &[Mover]) -> Self {
        let none = Self { count: 0, largest: 0.0, low: [f64::MAX; 3], high: [f64::MIN; 3] };
        movers.iter().fold(none, |all, mover| {
            all.union(Self {
                count: 1,
                largest: mover.radius.into(),
                low: mover.position,
                high: mover.position,
            })
        })
    }

    fn from_ranks(ranks: Vec<Self>) -> Self {
        ranks.into_iter().fold(Self::new(&[]), Self::union)
    }

    fn union(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            largest: self.largest.max(other.largest),
            low: std::array::from_fn(|k| self.low[k].min(other.low[k])),
            high: std::array::from_fn(|k| self.high[k].max(other.high[k])),
        }
    }
}

fn too_long(step: u32, path_length: f64, allowance: f64) -> Error {
    let limit = f64::from(MAX_WINDOWS) * allowance;
    Error::LongPaths { step, path_length, limit, searches: MAX_WINDOWS }
}

fn fastest<H: Halo>(movers: &[Mover], halo: &mut H) -> f64 {
    let own_speed = movers.par_iter().map(|mover| mover.speed).reduce(|| 0.0, f64::max);
    halo.gather(own_speed).into_iter().fold(0.0, f64::max)
}
