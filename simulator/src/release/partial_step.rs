//! The part of a step after a release, in which a particle moves, meets surfaces and decays.
//!
//! It is a shorter step, in which receivers go the same fraction of their way. Receptors only reflect, because free
//! ones are counted when a step begins.

use rayon::prelude::*;

use super::{Batch, ReleaseStep, Released};
use crate::model::Model;
use crate::model::boundary::Boundary;
use crate::model::particles::Particle;
use crate::model::receiver::{rounding, signed_distance};
use crate::motion::path_hit::{DrawContext, length};
use crate::motion::propagate::{Event, ROUNDED};
use crate::motion::receiver_state::{Place, ReceiverState};
use crate::motion::species_step::{FreePaths, SpeciesStep};
use crate::motion::surface_events::ParticleMove;
use crate::motion::surfaces::{SpeciesSurfaces, Surfaces};
use crate::motion::vessel_flow::StepTime;
use crate::random::gaussian;
use crate::random::philox::Purpose;
use crate::release::origins::{Arrival, Origin};

/// Particles that are moved together.
const CHUNK: usize = 1 << 16;
/// Below this number a thread has less work than its start takes.
const MIN_PER_THREAD: usize = 64;

#[derive(Clone, Debug)]
struct PartialStep<'a> {
    surfaces: &'a Surfaces,
    /// Receivers at the end of the step in which the particle was released, with their displacements in it.
    places: &'a [Place],
    step: SpeciesStep,
    paths: FreePaths,
    /// Duration over the time step.
    part: f32,
}

/// The state of a particle at the end of the step.
#[derive(Debug, PartialEq)]
enum Fate {
    Arrived { receiver: u32 },
    Aged { particle: Option<Particle>, decays: Vec<u32> },
}

impl Model {
    /// Adds the particles of a batch, which were released within the last step, with their ages in s.
    pub(super) fn add_later(
        &self,
        (transmitter, batch): (u32, &Batch<'_>),
        mut born: impl Iterator<Item = (Particle, f64)>,
        at: ReleaseStep<'_>,
        out: &mut Released,
    ) {
        loop {
            let born: Vec<_> = born.by_ref().take(CHUNK).collect();
            if born.is_empty() {
                return;
            }
            let moves: Vec<_> = born
                .par_iter()
                .with_min_len(MIN_PER_THREAD)
                .map(|&born| self.path(batch, born, at))
                .collect();
            let near = at.near(&self.boundary, &moves);
            let fates: Vec<_> = born
                .par_iter()
                .zip(moves)
                .with_min_len(MIN_PER_THREAD)
                .map(|(&born, moved)| match moved {
                    Some((moved, _)) => self.fate(batch, born, (moved, &near[..]), at),
                    None => Fate::Aged { particle: Some(born.0), decays: Vec::new() },
                })
                .collect();
            for ((Particle { species, id, .. }, _), fate) in born.into_iter().zip(fates) {
                match fate {
                    Fate::Arrived { receiver } => {
                        let origin = Some(Origin { transmitter, step: at.step });
                        out.arrivals.push(Arrival { receiver, species, id, step: at.step, origin });
                    }
                    Fate::Aged { particle, decays } => {
                        decays.into_iter().for_each(|decay| out.decayed[decay as usize] += 1);
                        particle.into_iter().for_each(|particle| self.add(particle, out));
                    }
                }
            }
        }
    }

    /// Returns the path since the release without receivers, and the reach of the particle from its beginning, in µm.
    /// A particle of age 0 has none.
    fn path(
        &self,
        batch: &Batch<'_>,
        (particle, age): (Particle, f64),
        at: ReleaseStep<'_>,
    ) -> Option<(ParticleMove, f32)> {
        if age == 0.0 {
            return None;
        }
        let Particle { mut position, mut velocity, species, id, .. } = particle;
        let partial = PartialStep::new(self, batch, (species, age), at);
        if let Some(carrier) = batch.from.carrier.and_then(|carrier| at.places.get(carrier as usize)) {
            // The transmitter was elsewhere at the time of release.
            position = std::array::from_fn(|k| position[k] - partial.part * carrier.displacement[k]);
        }
        let before = partial.step.domain.confine(position);
        let normal = gaussian::normals(at.key.draw(id, 1, 0, Purpose::PartialStep));
        // The particle drew nothing in the step in which it was released.
        let who = DrawContext { key: at.key, id, step: at.step - 1 };
        let own = self.has_velocity().then_some(&mut velocity);
        let (path, free_end) = partial.paths.path(&partial.step, [before, normal], own, who);
        let velocity = self.has_velocity().then_some(velocity);
        let mut moved =
            ParticleMove { at: 0, species, who, path, free_end, gone: 0.0, turns: None, velocity };
        if partial.surfaces.has_membranes() {
            partial.all_surfaces().hold_back(&mut moved);
        }
        Some((moved, moved.length() + partial.step.bend))
    }

    /// Moves a particle along its path, on which only the receivers `near` are within its reach.
    fn fate(
        &self,
        batch: &Batch<'_>,
        (mut particle, age): (Particle, f64),
        (mut moved, near): (ParticleMove, &[&ReceiverState]),
        at: ReleaseStep<'_>,
    ) -> Fate {
        let Particle { species: released, id, .. } = particle;
        let partial = PartialStep::new(self, batch, (released, age), at);
        if let Some(receiver) = partial.advance(&mut moved, near) {
            return Fate::Arrived { receiver };
        }
        particle.position = moved.path.after;
        particle.velocity = moved.velocity.unwrap_or(particle.velocity);
        let (mut species, mut decays) = (Some(released), Vec::new());
        let words = |generation| at.key.draw(id, 1 + generation, 0, Purpose::PartialStep);
        let turned = || at.key.draw(id, 1, 0, Purpose::Velocity);
        at.events.decays.continue_chain(released, age, words, |decay, product| {
            decays.push(decay);
            if let (Some(from), Some(to)) = (species, product) {
                particle.velocity = self.converted_velocity(particle.velocity, [from, to], turned);
            }
            species = product;
        });
        Fate::Aged { particle: species.map(|species| Particle { species, ..particle }), decays }
    }
}

impl<'a> PartialStep<'a> {
    fn new(model: &Model, batch: &Batch<'_>, (species, age): (u32, f64), at: ReleaseStep<'a>) -> Self {
        let (surfaces, places) = (&at.events.surfaces, at.places);
        let time = StepTime { duration: age, flow_part: model.flow_part([batch.now - age, batch.now]) };
        let part = (age / model.time_step) as f32;
        let step = SpeciesStep::new(model, species as usize, time, part * surfaces.bodies.diffusion);
        Self { surfaces, places, step, paths: FreePaths::new(model, time), part }
    }

    fn all_surfaces(&self) -> SpeciesSurfaces<'_> {
        SpeciesSurfaces { surfaces: self.surfaces, step: &self.step, duration: self.paths.duration }
    }

    /// Returns the receiver at which the particle arrives.
    fn advance(&self, moved: &mut ParticleMove, near: &[&ReceiverState]) -> Option<u32> {
        let (begun, length) = (*moved, moved.length());
        let mut event = self.resolve(moved, near.iter().copied(), length + self.step.bend);
        if moved.gone > length * (1.0 + ROUNDED) {
            *moved = begun;
            event = self.resolve(moved, self.surfaces.bodies.all.iter(), f32::INFINITY);
        }
        match event {
            Some(Event::Arrived { receiver, .. }) => Some(receiver),
            _ => None,
        }
    }

    /// Bodies farther than `reach` from the beginning, in µm, are not hit.
    fn resolve<'b>(
        &self,
        moved: &mut ParticleMove,
        bodies: impl Iterator<Item = &'b ReceiverState>,
        reach: f32,
    ) -> Option<Event> {
        let before = moved.path.before;
        let near = bodies.filter_map(|body| {
            let place = self.places[body.place as usize];
            let displacement = place.displacement.map(|w| self.part * w);
            let center = std::array::from_fn(|k| place.center[k] - displacement[k]);
            let radius = body.receiver.radius;
            let height = signed_distance(radius, center, &self.step.domain, before);
            let slack = rounding(before, 2.0 * radius + height.abs());
            (height <= reach + length(displacement) + slack).then(|| ReceiverState {
                center,
                displacement,
                drift: body.drift.map(|w| self.part * w),
                diffusion: self.part * body.diffusion,
                ..body.clone()
            })
        });
        let near: Vec<ReceiverState> = near.collect();
        self.all_surfaces().resolve(moved, near.iter())
    }
}

impl<'a> ReleaseStep<'a> {
    /// Returns the receivers that any of these paths may hit.
    fn near(&self, boundary: &Boundary, moves: &[Option<(ParticleMove, f32)>]) -> Vec<&'a ReceiverState> {
        let moves = || moves.iter().flatten();
        let Some((ParticleMove { path, .. }, _)) = moves().next() else { return Vec::new() };
        let center = path.before;
        let reach = |(moved, reach): &(ParticleMove, f32)| {
            length(boundary.displacement(center, moved.path.before)) + reach
        };
        let reach = moves().map(reach).fold(0.0, f32::max);
        let is_near = |body: &&ReceiverState| {
            let place = self.places[body.place as usize];
            let height = signed_distance(body.receiver.radius, place.center, boundary, center);
            let slack = rounding(center, 2.0 * body.receiver.radius + height.abs() + reach);
            // Covers the way from its beginning, and its motion since.
            height <= reach + 2.0 * length(place.displacement) + slack
        };
        self.events.surfaces.bodies.all.iter().filter(is_near).collect()
    }
}

#[cfg(test)]
mod tests;
