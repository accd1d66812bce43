//! The independent part of a step: motion, walls, receivers, decays.
//!
//! A coordinate becomes `x + (s·z + d)` with `s` = √(2DΔt), a standard normal `z`, and `d` the drift per step plus
//! own velocity, each operation rounded to `f32`.

mod flight;

use rayon::prelude::*;

use crate::Error;
use crate::model::boundary::Boundary;
use crate::model::membrane::{Membrane, MembraneStep, StepEnds};
use crate::model::particles::Particles;
use crate::model::{Model, Species};
use crate::motion::collisions::Flight;
use crate::motion::path_hit::{BEND, DrawContext};
use crate::motion::receiver_search::{ReceiverSearch, StepBounds};
use crate::motion::receiver_state::{ActiveReceivers, ReceiverState};
use crate::motion::step_normals::{BLOCK, draw};
use crate::motion::surface_events::ParticleMove;
use crate::motion::tumble::TumbleStep;
use crate::motion::vessel_flow::{FieldStep, FlowStep, StepDrift};
use crate::motion::wall::AbsorbingWall;
use crate::random::philox::Key;
use crate::reaction::decay::Decays;

pub use crate::motion::surface_events::Event;

/// Constants of the independent part of a step.
#[derive(Clone, Debug)]
pub struct Propagator {
    pub(crate) steps: Vec<SpeciesStep>,
    tumbles: Vec<Option<TumbleStep>>,
    pub(crate) time_step: f32,
    with_velocity: bool,
    bounded: bool,
    whole: Boundary,
    stream: Option<FlowStep>,
    field: Option<FieldStep>,
    pub(crate) bodies: ActiveReceivers,
    walls: Vec<AbsorbingWall>,
    membranes: Vec<Membrane>,
    pub(crate) decays: Decays,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct SpeciesStep {
    /// √(2DΔt) in µm.
    pub(crate) length: f32,
    /// √(2DΔt) along each axis.
    lengths: [f32; 3],
    /// DΔt in µm².
    pub(crate) diffusion: f32,
    pub(crate) drift: StepDrift,
    pub(crate) domain: Boundary,
    /// Largest bending of the path by the diffusion of particle and receiver, in µm.
    pub(crate) bend: f32,
}

const CHUNK: usize = 4096;
pub(crate) const ROUNDED: f32 = 1e-6;

impl Propagator {
    pub fn new(model: &Model) -> Self {
        let time_step = model.time_step;
        let bodies = ActiveReceivers::new(model);
        let walls = AbsorbingWall::all(model);
        let step = |(species, drift): (&Species, StepDrift)| SpeciesStep {
            bend: BEND * (2.0 * ((species.diffusion * time_step) as f32 + bodies.diffusion)).sqrt(),
            length: (2.0 * species.diffusion * time_step).sqrt() as f32,
            lengths: model.boundary.flattened([(2.0 * species.diffusion * time_step).sqrt() as f32; 3]),
            diffusion: (species.diffusion * time_step) as f32,
            drift,
            domain: model.boundary.inset(species.radius),
        };
        Self {
            steps: model.species.iter().zip(StepDrift::all(model, 1.0)).map(step).collect(),
            tumbles: (0..model.species.len()).map(|species| TumbleStep::new(model, species)).collect(),
            time_step: time_step as f32,
            with_velocity: model.has_velocity(),
            bounded: !model.boundary.is_unbounded(),
            whole: model.boundary,
            stream: FlowStep::new(model),
            field: FieldStep::new(model),
            bodies,
            walls,
            membranes: model.membranes.clone(),
            decays: Decays::new(model),
        }
    }

    pub(crate) fn set_flow(&mut self, model: &Model, step: u32) {
        if model.flow_pulse.is_none() {
            return;
        }
        let part = model.flow_part_of_step(step);
        for (step, drift) in self.steps.iter_mut().zip(StepDrift::all(model, part)) {
            step.drift = drift;
        }
        if let Some(stream) = &mut self.stream {
            stream.set(model, part);
        }
        if let Some(field) = &mut self.field {
            field.set(model, part);
        }
    }

    #[cold]
    #[inline(never)]
    fn hold_back(&self, moved: &mut ParticleMove) {
        let ParticleMove { species, who: DrawContext { key, id, step }, path, free_end, .. } = moved;
        let mut ends = StepEnds { end: path.end, free: *free_end, after: path.after };
        self.among_membranes(*species).hold_back(path.before, &mut ends, (*key, *id, *step));
        (path.end, *free_end, path.after) = (ends.end, ends.free, ends.after);
    }

    #[cold]
    #[inline(never)]
    fn among_membranes(&self, species: u32) -> MembraneStep<'_> {
        let SpeciesStep { ref domain, length, diffusion, .. } = self.steps[species as usize];
        let diffusion = f64::from(diffusion) / f64::from(self.time_step);
        MembraneStep {
            membranes: &self.membranes,
            domain,
            species: species as usize,
            diffusion,
            spread: length,
        }
    }

    /// `flights` are the paths after collisions.
    pub(crate) fn advance(
        &self,
        particles: &mut Particles,
        mut receiver_search: Option<&mut ReceiverSearch>,
        flights: Option<&[Flight]>,
        (key, step): (Key, u32),
    ) -> Result<Vec<Event>, Error> {
        let begin =
            |receiver_search: &mut &mut ReceiverSearch| receiver_search.begin(particles.len(), &self.bodies);
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
        let (events, unsure): (Vec<Vec<Event>>, Vec<Vec<ParticleMove>>) = chunks
            .into_par_iter()
            .enumerate()
            .map(|(chunk, (x, y, z, velocity, id, species))| {
                let chunk = Chunk { base: chunk * CHUNK, position: [x, y, z], velocity, id, species };
                self.advance_chunk(chunk, (seen, flights), (key, step))
            })
            .unzip();
        let mut events = events.concat();
        if let Some(receiver_search) = receiver_search {
            if searches {
                events.extend(self.search(particles, receiver_search, unsure.concat(), step)?);
                events.sort_by_key(Event::at);
            }
            receiver_search.end(&self.bodies);
        }
        Ok(events)
    }

    fn advance_chunk(
        &self,
        chunk: Chunk<'_>,
        (receiver_search, flights): (Option<&ReceiverSearch>, Option<&[Flight]>),
        (key, step): (Key, u32),
    ) -> (Vec<Event>, Vec<ParticleMove>) {
        let Chunk { base, position: [x, y, z], velocity, id, species } = chunk;
        let has_membranes = !self.membranes.is_empty();
        let watches =
            has_membranes || !self.bodies.all.is_empty() || !self.decays.is_empty() || !self.walls.is_empty();
        let (mut events, mut unsure) = (Vec::new(), Vec::new());
        let mut random = [[0.0; BLOCK]; 3];
        for (block, ids) in id.chunks(BLOCK).enumerate() {
            if flights.is_none() {
                draw(key, ids, step, &mut random);
            }
            let first = block * BLOCK;
            for (k, &id) in ids.iter().enumerate() {
                let at = first + k;
                let flight = match flights {
                    Some(flights) => flights[base + at],
                    None => {
                        let own =
                            velocity.each_ref().map(|column| column.get(at).copied().unwrap_or_default());
                        let normal = [0, 1, 2].map(|axis: usize| random[axis][k]);
                        let who = DrawContext { key, id, step };
                        self.flight(species[at], ([x[at], y[at], z[at]], own), normal, who)
                    }
                };
                let mut path = flight.path;
                let mut own = self.with_velocity.then_some(flight.velocity);
                if watches {
                    let place = base + at;
                    let who = DrawContext { key, id, step };
                    let (at, species) = (place as u32, species[at]);
                    let mut moved = ParticleMove {
                        at,
                        species,
                        who,
                        path,
                        free_end: flight.free_end,
                        gone: 0.0,
                        turns: None,
                        velocity: own,
                    };
                    if has_membranes {
                        self.hold_back(&mut moved);
                    }
                    match receiver_search {
                        None => self.resolve_events(&mut moved, self.bodies.all.iter(), &mut events),
                        Some(receiver_search) if receiver_search.is_clear(place, &self.reach(&moved)) => {
                            self.absorb_or_decay(&moved, &mut events);
                        }
                        Some(_) => unsure.push(moved),
                    }
                    (path, own) = (moved.path, moved.velocity);
                }
                [x[at], y[at], z[at]] = path.after;
                if let Some(own) = own {
                    (0..3).for_each(|axis| velocity[axis][at] = own[axis]);
                }
            }
        }
        (events, unsure)
    }

    #[inline(always)]
    fn reach(&self, moved: &ParticleMove) -> StepBounds {
        StepBounds::new(&moved.path, self.more(moved))
    }

    #[inline]
    fn resolve_events<'a>(
        &self,
        moved: &mut ParticleMove,
        receivers: impl Iterator<Item = &'a ReceiverState>,
        events: &mut Vec<Event>,
    ) {
        let space = (&self.steps[moved.species as usize].domain, self.time_step, &self.walls[..]);
        let (species, after) = (moved.species, moved.path.after);
        let is_near_side = |body: &&ReceiverState| {
            self.membranes.is_empty() || !self.among_membranes(species).separates([after, body.center])
        };
        match self.bodies.resolve(moved, space, receivers.filter(is_near_side)) {
            Some(event) => events.push(event),
            None => self.absorb_or_decay(moved, events),
        }
    }

    #[inline]
    fn absorb_or_decay(&self, moved: &ParticleMove, events: &mut Vec<Event>) {
        let ParticleMove { at, species, who, path, .. } = *moved;
        let domain = &self.steps[species as usize].domain;
        let is_near_side = |wall: &&AbsorbingWall| {
            self.membranes.is_empty()
                || !self.among_membranes(species).separates([path.after, wall.foot(domain, path.after)])
        };
        let seen = self.walls.iter().filter(|wall| wall.sees[species as usize]);
        let mut walls = seen.filter(is_near_side);
        if let Some(wall) = walls.find(|wall| wall.absorbs(domain, moved)) {
            return events.push(Event::Arrived { at, receiver: wall.receiver });
        }
        let DrawContext { key, id, step } = who;
        self.decays.for_each_decay(species, (key, id, step), |decay, product| {
            events.push(Event::Decayed { at, decay, product });
        });
    }

    /// Bounds diffusion and approaching receivers, in µm.
    #[inline(always)]
    fn more(&self, moved: &ParticleMove) -> f32 {
        self.steps[moved.species as usize].bend + self.bodies.max_displacement
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
        let around_beginning = |moved: &ParticleMove| self.reach(moved).around_beginning();
        let begins = unsure.iter().map(|moved| (moved.path.before, around_beginning(moved)));
        let failed = |source| Error::Step { step, source };
        let found = receiver_search.find(begins, &self.bodies).map_err(failed)?;
        let resolve = |(k, moved): (usize, &mut ParticleMove)| {
            let (mut events, begun) = (Vec::new(), *moved);
            let reach = around_beginning(moved);
            let (near, ball) = found.of(k, reach, (&self.bodies, &self.whole));
            self.resolve_events(moved, near.iter().map(|&k| &self.bodies.all[k as usize]), &mut events);
            if self.more(moved) + moved.gone > reach * (1.0 + ROUNDED) {
                *moved = begun;
                events.clear();
                self.resolve_events(moved, self.bodies.all.iter(), &mut events);
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

struct Chunk<'a> {
    base: usize,
    position: [&'a mut [f32]; 3],
    velocity: [&'a mut [f32]; 3],
    id: &'a [u32],
    species: &'a [u32],
}

#[cfg(test)]
mod tests;
