//! The part of a step in which particles are independent.

mod flight;

use rayon::prelude::*;

use crate::Error;
use crate::model::Model;
use crate::model::boundary::Boundary;
use crate::model::particles::{Particles, non_finite};
use crate::motion::collisions::Flight;
use crate::motion::receiver_search::{ReceiverSearch, StepBounds};
use crate::motion::receiver_state::ReceiverState;
use crate::motion::species_step::{FreePaths, SpeciesStep};
use crate::motion::step_normals::{BLOCK, draw};
use crate::motion::surface_events::{Capture, ParticleMove};
use crate::motion::surfaces::{SpeciesSurfaces, Surfaces};
use crate::motion::tumble::TumbleStep;
use crate::motion::vessel_flow::{StepDrift, StepTime};
use crate::random::philox::{DrawContext, StepKey};
use crate::reaction::decay::{CaptureOrder, ChainedDecay, Decays};
use flight::FlightStart;

pub use crate::motion::surface_events::Event;

#[derive(Clone, Debug)]
pub struct Propagator {
    pub(crate) steps: Vec<SpeciesStep>,
    paths: FreePaths,
    tumbles: Vec<Option<TumbleStep>>,
    with_velocity: bool,
    whole: Boundary,
    pub(crate) surfaces: Surfaces,
    pub(crate) decays: Decays,
}

const CHUNK: usize = 4096;
/// Relative rounding error of a path's length.
pub(crate) const PATH_ROUNDING: f32 = 1e-6;

impl Propagator {
    pub fn new(model: &Model) -> Self {
        let (surfaces, time) = (Surfaces::new(model), StepTime::new(model, 1.0));
        let species = 0..model.species.len();
        let step = |species| SpeciesStep::new(model, species, time, surfaces.active_receivers.diffusion);
        Self {
            steps: species.clone().map(step).collect(),
            paths: FreePaths::new(model, time),
            tumbles: species.map(|species| TumbleStep::new(model, species)).collect(),
            with_velocity: model.has_velocity(),
            whole: model.boundary,
            surfaces,
            decays: Decays::new(model),
        }
    }

    pub(crate) fn set_flow(&mut self, model: &Model, step: u32) {
        if model.flow_pulse.is_none() {
            return;
        }
        let time = StepTime::new(model, model.flow_fraction_of_step(step));
        for (species, step) in self.steps.iter_mut().enumerate() {
            step.drift = StepDrift::new(model, species, time);
        }
        self.paths = FreePaths::new(model, time);
    }

    #[inline(always)]
    fn surfaces_of(&self, species: u32) -> SpeciesSurfaces<'_> {
        let step = &self.steps[species as usize];
        SpeciesSurfaces { surfaces: &self.surfaces, step, duration: self.paths.duration }
    }

    /// Moves all particles and returns their events, in order. `flights` are the paths after collisions.
    ///
    /// # Errors
    /// [`Error::NotFinite`] if positions exceed the range of `f32`. [`Error::Step`] from the search for receivers.
    pub(crate) fn advance(
        &self,
        particles: &mut Particles,
        mut receiver_search: Option<&mut ReceiverSearch>,
        flights: Option<&[Flight]>,
        now: StepKey,
    ) -> Result<Vec<Event>, Error> {
        let begin = |receiver_search: &mut &mut ReceiverSearch| {
            receiver_search.begin(particles.len(), &self.surfaces.active_receivers)
        };
        let searches = receiver_search.as_mut().is_some_and(begin);
        let seen = receiver_search.as_deref().filter(|_| searches);
        let Particles { position: [x, y, z], velocity, species, id, .. } = &mut *particles;
        let mut columns = velocity.each_mut().map(|column| column.chunks_mut(CHUNK));
        let velocities: Vec<[&mut [f32]; 3]> = (0..id.len().div_ceil(CHUNK))
            .map(|_| columns.each_mut().map(|chunks| chunks.next().unwrap_or_default()))
            .collect();
        let chunks = (
            x.par_chunks_mut(CHUNK),
            y.par_chunks_mut(CHUNK),
            z.par_chunks_mut(CHUNK),
            velocities,
            id.par_chunks(CHUNK),
            species.par_chunks(CHUNK),
        );
        let moved: Vec<MovedChunk> = chunks
            .into_par_iter()
            .enumerate()
            .map(|(chunk, (x, y, z, velocity, id, species))| {
                let chunk = Chunk { base: chunk * CHUNK, position: [x, y, z], velocity, id, species };
                self.advance_chunk(chunk, seen, flights, now)
            })
            .collect();
        let lost = moved.iter().map(|chunk| chunk.lost as u64).sum();
        if lost > 0 {
            return Err(Error::NotFinite { step: now.step, particles: lost });
        }
        let split = |chunk: MovedChunk| (chunk.events, chunk.unsure);
        let (events, unsure): (Vec<_>, Vec<_>) = moved.into_iter().map(split).unzip();
        let mut events = events.concat();
        if let Some(receiver_search) = receiver_search {
            if searches {
                events.extend(self.search(particles, receiver_search, unsure.concat(), now.step)?);
                events.sort_by_key(Event::at);
            }
            receiver_search.end(&self.surfaces.active_receivers);
        }
        Ok(events)
    }

    fn advance_chunk(
        &self,
        chunk: Chunk<'_>,
        receiver_search: Option<&ReceiverSearch>,
        flights: Option<&[Flight]>,
        now: StepKey,
    ) -> MovedChunk {
        let Chunk { base, position: [x, y, z], velocity, id, species } = chunk;
        let has_membranes = self.surfaces.has_membranes();
        let watches = !self.surfaces.is_empty() || !self.decays.is_empty();
        let (mut events, mut unsure) = (Vec::new(), Vec::new());
        let mut random = [[0.0; BLOCK]; 3];
        for (block, ids) in id.chunks(BLOCK).enumerate() {
            if flights.is_none() {
                draw(now, ids, &mut random);
            }
            let first = block * BLOCK;
            for (k, &id) in ids.iter().enumerate() {
                let at = first + k;
                let flight = match flights {
                    Some(flights) => flights[base + at],
                    None => {
                        let particle_velocity =
                            velocity.each_ref().map(|column| column.get(at).copied().unwrap_or_default());
                        let normal = [0, 1, 2].map(|axis: usize| random[axis][k]);
                        let start = FlightStart {
                            species: species[at],
                            position: [x[at], y[at], z[at]],
                            velocity: particle_velocity,
                        };
                        self.flight(start, normal, now.for_particle(id))
                    }
                };
                let mut path = flight.path;
                let mut particle_velocity = self.with_velocity.then_some(flight.velocity);
                if watches {
                    let index = base + at;
                    let (at, species) = (index as u32, species[at]);
                    let mut moved = ParticleMove {
                        at,
                        species,
                        context: now.for_particle(id),
                        path,
                        free_end: flight.free_end,
                        path_length: 0.0,
                        reflection: None,
                        velocity: particle_velocity,
                    };
                    if has_membranes {
                        self.surfaces_of(moved.species).hold_back(&mut moved);
                    }
                    match receiver_search {
                        None => self.resolve_events(
                            &mut moved,
                            self.surfaces.active_receivers.all.iter(),
                            &mut events,
                        ),
                        Some(receiver_search)
                            if receiver_search.is_clear(index, &self.step_bounds(&moved)) =>
                        {
                            self.absorb_or_decay(&moved, &mut events);
                        }
                        Some(_) => unsure.push(moved),
                    }
                    (path, particle_velocity) = (moved.path, moved.velocity);
                }
                [x[at], y[at], z[at]] = path.after;
                if let Some(particle_velocity) = particle_velocity {
                    (0..3).for_each(|axis| velocity[axis][at] = particle_velocity[axis]);
                }
            }
        }
        MovedChunk { events, unsure, lost: non_finite([x, y, z]) }
    }

    #[inline(always)]
    fn step_bounds(&self, moved: &ParticleMove) -> StepBounds {
        StepBounds::new(&moved.path, self.margin(moved))
    }

    #[inline]
    fn resolve_events<'a>(
        &self,
        moved: &mut ParticleMove,
        receivers: impl Iterator<Item = &'a ReceiverState>,
        events: &mut Vec<Event>,
    ) {
        let capture = self.surfaces_of(moved.species).resolve(moved, receivers);
        self.capture_or_decay(moved, capture, events);
    }

    #[inline(always)]
    fn absorb_or_decay(&self, moved: &ParticleMove, events: &mut Vec<Event>) {
        let capture = self.surfaces_of(moved.species).absorb(moved);
        self.capture_or_decay(moved, capture, events);
    }

    #[inline(always)]
    fn capture_or_decay(&self, moved: &ParticleMove, capture: Option<Capture>, events: &mut Vec<Event>) {
        match capture {
            Some(capture) if self.decays.has(moved.species) => self.decay_to(moved, capture, events),
            Some(capture) if self.dissociates_before(moved, &capture) => {}
            Some(capture) => events.push(capture.event),
            None => self.decay(moved, events),
        }
    }

    #[inline(always)]
    fn dissociates_before(&self, moved: &ParticleMove, capture: &Capture) -> bool {
        self.decays.dissociates_before(moved.species, moved.context, || capture.time(moved.context))
    }

    /// Adds the decays before the capture, or all if the receiver does not take the species at the hit.
    #[cold]
    #[inline(never)]
    fn decay_to(&self, moved: &ParticleMove, capture: Capture, events: &mut Vec<Event>) {
        let ParticleMove { at, species: first, context, .. } = *moved;
        let captures = |species| self.surfaces.captures(&capture.event, species);
        let mut order = CaptureOrder::new(first, (capture.time(context), self.decays.time_step));
        let mut last = None;
        self.decays.for_each_decay(first, context, |decay| {
            if order.decays(&decay, captures) {
                events.push(self.decayed(at, &decay, context));
                last = Some(decay);
            }
        });
        let exists = || !self.decays.product_dissociates_before(last.as_ref(), &order, context);
        events.extend(order.captured(|species| captures(species) && exists()).map(|_| capture.event));
    }

    fn decayed(&self, at: u32, decay: &ChainedDecay, context: DrawContext) -> Event {
        let ChainedDecay { decay: index, product, .. } = *decay;
        Event::Decayed { at, decay: index, product, spared: self.decays.spares_product(decay, context) }
    }

    #[inline(always)]
    fn decay(&self, moved: &ParticleMove, events: &mut Vec<Event>) {
        if self.decays.is_empty() {
            return;
        }
        let ParticleMove { at, species, context, .. } = *moved;
        self.decays.for_each_decay(species, context, |decay| events.push(self.decayed(at, &decay, context)));
    }

    /// Bounds the path's distance from its chord plus the displacement of any receiver.
    #[inline(always)]
    fn margin(&self, moved: &ParticleMove) -> f32 {
        self.steps[moved.species as usize].bend_of(&moved.path)
            + self.surfaces.active_receivers.max_displacement
    }

    fn search(
        &self,
        particles: &mut Particles,
        receiver_search: &mut ReceiverSearch,
        mut unsure: Vec<ParticleMove>,
        step: u32,
    ) -> Result<Vec<Event>, Error> {
        if unsure.is_empty() {
            return Ok(Vec::new());
        }
        let around_beginning = |moved: &ParticleMove| self.step_bounds(moved).around_beginning();
        let begins = unsure.iter().map(|moved| (moved.path.before, around_beginning(moved)));
        let failed = |source| Error::Step { step, source };
        let found = receiver_search.find(begins, &self.surfaces.active_receivers).map_err(failed)?;
        let resolve = |(k, moved): (usize, &mut ParticleMove)| {
            let (mut events, unresolved) = (Vec::new(), *moved);
            let search_radius = around_beginning(moved);
            let (near, ball) =
                found.receivers_near(k, search_radius, (&self.surfaces.active_receivers, &self.whole));
            self.resolve_events(
                moved,
                near.iter().map(|&k| &self.surfaces.active_receivers.all[k as usize]),
                &mut events,
            );
            if self.margin(moved) + moved.path_length > search_radius * (1.0 + PATH_ROUNDING) {
                *moved = unresolved;
                events.clear();
                self.resolve_events(moved, self.surfaces.active_receivers.all.iter(), &mut events);
            }
            (events, ball)
        };
        let resolved: Vec<_> = unsure.par_iter_mut().enumerate().with_min_len(BLOCK).map(resolve).collect();
        let mut events = Vec::new();
        for (moved, (own_events, ball)) in unsure.iter().zip(resolved) {
            let at = moved.at as usize;
            events.extend(own_events);
            receiver_search.clear_spheres[at] = ball;
            particles.set_position(at, moved.path.after);
            if let Some(velocity) = moved.velocity {
                (0..3).for_each(|axis| particles.velocity[axis][at] = velocity[axis]);
            }
        }
        Ok(events)
    }
}

struct MovedChunk {
    events: Vec<Event>,
    /// Their near receivers are not yet known.
    unsure: Vec<ParticleMove>,
    /// Non-finite positions.
    lost: usize,
}

struct Chunk<'a> {
    base: usize,
    position: [&'a mut [f32]; 3],
    velocity: [&'a mut [f32]; 3],
    id: &'a [u32],
    species: &'a [u32],
}

#[cfg(test)]
mod tests;
