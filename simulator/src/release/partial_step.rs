//! The part of a step after a release.
//!
//! A shorter step with the same fraction of receivers' displacements. Receptors only reflect, because free receptors
//! are counted at the beginning of a step.

use rayon::prelude::*;

use super::{AgedParticle, Batch, ReleaseStep, ReleasedParticles};
use crate::model::Model;
use crate::model::boundary::Boundary;
use crate::model::particles::Particle;
use crate::model::receiver::{rounding, signed_distance};
use crate::motion::path_hit::length;
use crate::motion::propagate::{Event, PATH_ROUNDING};
use crate::motion::receiver_state::{ReceiverMove, ReceiverState};
use crate::motion::species_step::{FreePaths, SpeciesStep};
use crate::motion::surface_events::{Capture, ParticleMove};
use crate::motion::surfaces::{SpeciesSurfaces, Surfaces};
use crate::motion::vessel_flow::StepTime;
use crate::random::gaussian;
use crate::random::philox::{DrawContext, Purpose};
use crate::reaction::decay::{CaptureOrder, ChainedDecay};
use crate::release::origins::{Arrival, Origin};

/// Particles moved together, to bound memory.
const CHUNK: usize = 1 << 13;
/// Particles that a thread moves in about 100 µs (AMD EPYC).
const MIN_PER_THREAD: usize = 64;

#[derive(Clone, Debug)]
struct PartialStep<'a> {
    surfaces: &'a Surfaces,
    /// Receivers at the end of the step of the release.
    receiver_moves: &'a [ReceiverMove],
    constants: SpeciesStep,
    paths: FreePaths,
    /// Fraction of the time step.
    step_fraction: f32,
}

#[derive(Clone, Debug)]
struct PartialMove<'a> {
    step: PartialStep<'a>,
    moved: ParticleMove,
    /// Distance within which receivers are hit.
    hit_distance: f32,
}

#[derive(Debug, PartialEq)]
struct PartialOutcome {
    decays: Vec<u32>,
    end_state: EndState,
}

#[derive(Debug, PartialEq)]
enum EndState {
    Arrived { receiver: u32, species: u32 },
    Remains(Particle),
    Decayed,
}

impl Model {
    pub(super) fn add_later(
        &self,
        batch: &Batch<'_>,
        mut born: impl Iterator<Item = AgedParticle>,
        at: ReleaseStep<'_>,
        out: &mut ReleasedParticles,
    ) {
        loop {
            let born: Vec<_> = born.by_ref().take(CHUNK).collect();
            if born.is_empty() {
                return;
            }
            let moves: Vec<_> = born
                .par_iter()
                .with_min_len(MIN_PER_THREAD)
                .map(|&born| self.partial_move(batch, born, at))
                .collect();
            let near = at.receivers_near(&self.boundary, &moves);
            let outcomes: Vec<_> = born
                .par_iter()
                .zip(moves)
                .with_min_len(MIN_PER_THREAD)
                .map(|(&born, moved)| self.partial_outcome(born, moved, &near, at))
                .collect();
            for (AgedParticle { particle, .. }, PartialOutcome { decays, end_state }) in
                born.into_iter().zip(outcomes)
            {
                let id = particle.id;
                decays.into_iter().for_each(|decay| out.decayed[decay as usize] += 1);
                match end_state {
                    EndState::Arrived { receiver, species } => {
                        let origin = Some(Origin { transmitter: batch.transmitter, step: at.step });
                        out.arrivals.push(Arrival { receiver, species, id, step: at.step, origin });
                    }
                    EndState::Remains(particle) => self.add(particle, out),
                    EndState::Decayed => {}
                }
            }
        }
    }

    /// Returns the path without receivers, or `None` if the age is 0.
    fn partial_move<'a>(
        &self,
        batch: &Batch<'_>,
        AgedParticle { particle, age }: AgedParticle,
        at: ReleaseStep<'a>,
    ) -> Option<PartialMove<'a>> {
        if age == 0.0 {
            return None;
        }
        let Particle { mut position, mut velocity, species, id, .. } = particle;
        let step = PartialStep::new(self, batch, (species, age), at);
        if let Some(carrier) = batch.from.carrier.and_then(|carrier| at.receiver_moves.get(carrier as usize))
        {
            // The transmitter was elsewhere at the time of release.
            position = std::array::from_fn(|k| position[k] - step.step_fraction * carrier.displacement[k]);
        }
        let before = step.constants.domain.confine(position);
        let normal = gaussian::normals(at.key.draw(id, 1, 0, Purpose::PartialStep));
        let context = at.draws_of(id);
        let tracked_velocity = self.has_velocity().then_some(&mut velocity);
        let (path, free_end) = step.paths.path(&step.constants, [before, normal], tracked_velocity, context);
        let velocity = self.has_velocity().then_some(velocity);
        let mut moved = ParticleMove {
            at: 0,
            species,
            context,
            path,
            free_end,
            path_length: 0.0,
            reflection: None,
            velocity,
        };
        if step.surfaces.has_membranes() {
            step.all_surfaces().hold_back(&mut moved);
        }
        let hit_distance = moved.length() + step.constants.bend_of(&moved.path);
        Some(PartialMove { step, moved, hit_distance })
    }

    fn partial_outcome(
        &self,
        AgedParticle { mut particle, age }: AgedParticle,
        moved: Option<PartialMove<'_>>,
        near: &[&ReceiverState],
        at: ReleaseStep<'_>,
    ) -> PartialOutcome {
        let Some(PartialMove { step, mut moved, hit_distance }) = moved else {
            return PartialOutcome { decays: Vec::new(), end_state: EndState::Remains(particle) };
        };
        let capture = step.advance(&mut moved, near, hit_distance);
        particle.position = moved.path.after;
        particle.velocity = moved.velocity.unwrap_or(particle.velocity);
        if at.events.decays.has(particle.species) {
            return self.partial_decays(AgedParticle { particle, age }, capture, at);
        }
        let arrived = |Capture { event, .. }: Capture| EndState::from_event(&event, particle.species);
        PartialOutcome { decays: Vec::new(), end_state: capture.map_or(EndState::Remains(particle), arrived) }
    }

    fn partial_decays(
        &self,
        AgedParticle { mut particle, age }: AgedParticle,
        capture: Option<Capture>,
        at: ReleaseStep<'_>,
    ) -> PartialOutcome {
        let Particle { species: released, id, .. } = particle;
        let words = |generation| at.key.draw(id, 1 + generation, 0, Purpose::PartialStep);
        let velocity_words = || at.key.draw(id, 1, 0, Purpose::Velocity);
        let context = at.draws_of(id);
        let captures = |event: &Event, species| at.events.surfaces.captures(event, species);
        let ordered =
            |capture: Capture| (CaptureOrder::new(released, (capture.time(context), age)), capture.event);
        let (mut species, mut decays, mut order) = (Some(released), Vec::new(), capture.map(ordered));
        at.events.decays.continue_chain(released, age, words, |chained| {
            if let Some((order, event)) = &mut order
                && !order.decays(&chained, |species| captures(event, species))
            {
                return;
            }
            let ChainedDecay { decay, product, .. } = chained;
            decays.push(decay);
            if let (Some(from), Some(to)) = (species, product) {
                particle.velocity = self.converted_velocity(particle.velocity, [from, to], velocity_words);
            }
            species = product;
        });
        let arrived = order.and_then(|(order, event)| {
            Some(EndState::from_event(&event, order.captured(|species| captures(&event, species))?))
        });
        let remains = || species.map(|species| EndState::Remains(Particle { species, ..particle }));
        PartialOutcome { decays, end_state: arrived.or_else(remains).unwrap_or(EndState::Decayed) }
    }
}

impl EndState {
    /// Receptors only reflect in a partial step, so a capture is an arrival.
    fn from_event(event: &Event, species: u32) -> Self {
        Self::Arrived { receiver: event.receiver(), species }
    }
}

impl<'a> PartialStep<'a> {
    fn new(model: &Model, batch: &Batch<'_>, (species, age): (u32, f64), at: ReleaseStep<'a>) -> Self {
        let (surfaces, receiver_moves) = (&at.events.surfaces, at.receiver_moves);
        let time =
            StepTime { duration: age, flow_fraction: model.flow_fraction([batch.now - age, batch.now]) };
        let step_fraction = (age / model.time_step) as f32;
        let constants = SpeciesStep::new(
            model,
            species as usize,
            time,
            step_fraction * surfaces.active_receivers.diffusion,
        );
        Self { surfaces, receiver_moves, constants, paths: FreePaths::new(model, time), step_fraction }
    }

    fn all_surfaces(&self) -> SpeciesSurfaces<'_> {
        SpeciesSurfaces { surfaces: self.surfaces, step: &self.constants, duration: self.paths.duration }
    }

    fn advance(
        &self,
        moved: &mut ParticleMove,
        near: &[&ReceiverState],
        hit_distance: f32,
    ) -> Option<Capture> {
        let (unresolved, length) = (*moved, moved.length());
        let mut capture = self.resolve(moved, near.iter().copied(), hit_distance);
        if moved.path_length > length * (1.0 + PATH_ROUNDING) {
            *moved = unresolved;
            capture = self.resolve(moved, self.surfaces.active_receivers.all.iter(), f32::INFINITY);
        }
        capture
    }

    fn resolve<'b>(
        &self,
        moved: &mut ParticleMove,
        receivers: impl Iterator<Item = &'b ReceiverState>,
        hit_distance: f32,
    ) -> Option<Capture> {
        let before = moved.path.before;
        let near = receivers.filter_map(|state| {
            let receiver_move = self.receiver_moves[state.index as usize];
            let displacement = receiver_move.displacement.map(|w| self.step_fraction * w);
            let center = std::array::from_fn(|k| receiver_move.center[k] - displacement[k]);
            let radius = state.receiver.radius;
            let height = signed_distance(radius, center, &self.constants.domain, before);
            let slack = rounding(before, 2.0 * radius + height.abs());
            (height <= hit_distance + length(displacement) + slack).then(|| ReceiverState {
                center,
                displacement,
                drift: state.drift.map(|w| self.step_fraction * w),
                diffusion: self.step_fraction * state.diffusion,
                ..state.clone()
            })
        });
        let near: Vec<ReceiverState> = near.collect();
        self.all_surfaces().resolve(moved, near.iter())
    }
}

impl<'a> ReleaseStep<'a> {
    /// Returns the draws of the step of the release, of which the particle has used none.
    fn draws_of(&self, id: u32) -> DrawContext {
        DrawContext { key: self.key, id, step: self.step - 1 }
    }

    fn receivers_near(
        &self,
        boundary: &Boundary,
        moves: &[Option<PartialMove<'_>>],
    ) -> Vec<&'a ReceiverState> {
        let moves = || moves.iter().flatten();
        let Some(PartialMove { moved, .. }) = moves().next() else { return Vec::new() };
        let center = moved.path.before;
        let hit_distance = |PartialMove { moved, hit_distance, .. }: &PartialMove<'_>| {
            let before = moved.path.before;
            let hit_distance = length(boundary.displacement(center, before)) + hit_distance;
            hit_distance + rounding(before, hit_distance)
        };
        let hit_distance = moves().map(hit_distance).fold(0.0, f32::max);
        let is_near = |state: &&ReceiverState| {
            let receiver_move = self.receiver_moves[state.index as usize];
            let height = signed_distance(state.receiver.radius, receiver_move.center, boundary, center);
            let slack = rounding(center, 2.0 * state.receiver.radius + height.abs() + hit_distance);
            // One displacement from the end of the step to the release, and one in the path since.
            height <= hit_distance + 2.0 * length(receiver_move.displacement) + slack
        };
        self.events.surfaces.active_receivers.all.iter().filter(is_near).collect()
    }
}

#[cfg(test)]
mod tests;
