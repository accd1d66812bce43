//! The part of a step after a release, with the surfaces that a particle meets in it.
//!
//! It is a shorter step, in which receivers go the same fraction of their way. Receptors only reflect, because free
//! ones are counted when a step begins.

use crate::model::Model;
use crate::model::boundary::{Axis, Boundary};
use crate::model::membrane::{MembraneStep, StepEnds};
use crate::model::receiver::{rounding, signed_distance};
use crate::motion::path_hit::{BEND, DrawContext, Path, length};
use crate::motion::propagate::{Event, ROUNDED};
use crate::motion::receiver_state::{ActiveReceivers, Place, ReceiverState};
use crate::motion::surface_events::ParticleMove;
use crate::motion::wall::AbsorbingWall;

#[derive(Clone, Debug)]
pub(crate) struct Surfaces {
    bodies: ActiveReceivers,
    walls: Vec<AbsorbingWall>,
}

impl Surfaces {
    pub(crate) fn new(model: &Model) -> Self {
        Self { bodies: ActiveReceivers::new(model), walls: AbsorbingWall::all(model) }
    }

    fn is_empty(&self) -> bool {
        self.bodies.all.is_empty() && self.walls.is_empty()
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct PartialStep<'a> {
    model: &'a Model,
    surfaces: &'a Surfaces,
    /// Receivers at the end of the step in which the particle was released, with their displacements in it.
    places: &'a [Place],
    species: u32,
    /// Boundary of the center.
    domain: Boundary,
    /// In s.
    age: f64,
    /// `age` over the time step.
    part: f32,
}

impl<'a> PartialStep<'a> {
    pub(super) fn new(
        model: &'a Model,
        (surfaces, places): (&'a Surfaces, &'a [Place]),
        (species, age): (u32, f64),
    ) -> Self {
        let domain = model.boundary.inset(model.species[species as usize].radius);
        Self { model, surfaces, places, species, domain, age, part: (age / model.time_step) as f32 }
    }

    /// Moves a particle along a free path. Returns the receiver at which it arrives.
    pub(super) fn advance(&self, moved: &mut ParticleMove) -> Option<u32> {
        if self.model.membranes.is_empty() && self.surfaces.is_empty() {
            return None;
        }
        self.confine(moved);
        let Path { before, end, diffusion, .. } = moved.path;
        let length = length(std::array::from_fn(|k| end[k] - before[k]));
        let bend = BEND * (2.0 * (diffusion + self.part * self.surfaces.bodies.diffusion)).sqrt();
        let begun = *moved;
        let mut event = self.resolve(moved, length + bend);
        if moved.gone > length * (1.0 + ROUNDED) {
            *moved = begun;
            event = self.resolve(moved, f32::INFINITY);
        }
        match event {
            Some(Event::Arrived { receiver, .. }) => Some(receiver),
            _ => self.absorb(moved),
        }
    }

    fn confine(&self, moved: &mut ParticleMove) {
        let Self { domain, .. } = self;
        let DrawContext { key, id, .. } = moved.who;
        let [from, to] = [moved.path.before, moved.path.end];
        let before = domain.confine(from);
        let free = std::array::from_fn(|k| before[k] + (to[k] - from[k]));
        let mut ends = StepEnds { end: free, free, after: domain.confine(to) };
        if !self.model.membranes.is_empty() {
            self.among_membranes().hold_back(before, &mut ends, (key, id, 0));
        }
        for axis in 0..3 {
            let is_across = domain.vessel.is_some_and(|vessel| vessel.along != Some(axis));
            if is_across || domain.axes[axis] == Axis::Frozen {
                ends.end[axis] = ends.after[axis];
            }
        }
        moved.path = Path { before, end: ends.end, after: ends.after, ..moved.path };
        moved.free_end = ends.free;
    }

    /// Bodies farther than `reach` from the beginning, in µm, are not hit.
    fn resolve(&self, moved: &mut ParticleMove, reach: f32) -> Option<Event> {
        let Path { before, after, .. } = moved.path;
        let bodies = &self.surfaces.bodies;
        let near = |body: &ReceiverState| {
            let place = self.places[body.place as usize];
            let displacement = place.displacement.map(|w| self.part * w);
            let center = std::array::from_fn(|k| place.center[k] - displacement[k]);
            let radius = body.receiver.radius;
            let height = signed_distance(radius, center, &self.domain, before);
            let slack = rounding(before, 2.0 * radius + height.abs());
            let is_near =
                height <= reach + length(displacement) + slack && !self.is_held_back([after, center]);
            is_near.then(|| ReceiverState {
                center,
                displacement,
                drift: body.drift.map(|w| self.part * w),
                diffusion: self.part * body.diffusion,
                ..body.clone()
            })
        };
        let near: Vec<ReceiverState> = bodies.all.iter().filter_map(near).collect();
        bodies.resolve(moved, (&self.domain, self.age as f32, &self.surfaces.walls), near.iter())
    }

    fn absorb(&self, moved: &ParticleMove) -> Option<u32> {
        let (domain, after) = (&self.domain, moved.path.after);
        let seen = self.surfaces.walls.iter().filter(|wall| wall.sees[self.species as usize]);
        let mut walls = seen.filter(|wall| !self.is_held_back([after, wall.foot(domain, after)]));
        walls.find(|wall| wall.absorbs(domain, moved)).map(|wall| wall.receiver)
    }

    fn is_held_back(&self, ends: [[f32; 3]; 2]) -> bool {
        !self.model.membranes.is_empty() && self.among_membranes().separates(ends)
    }

    fn among_membranes(&self) -> MembraneStep<'_> {
        let diffusion = self.model.species[self.species as usize].diffusion;
        MembraneStep {
            membranes: &self.model.membranes,
            domain: &self.domain,
            species: self.species as usize,
            diffusion,
            spread: (2.0 * diffusion * self.age).sqrt() as f32,
        }
    }
}
