use crate::model::Model;
use crate::model::membrane::{Membrane, MembraneStep, StepEnds};
use crate::motion::receiver_state::{ActiveReceivers, ReceiverState};
use crate::motion::species_step::SpeciesStep;
use crate::motion::surface_events::{Capture, Event, FirstHit, ParticleMove, PathSurroundings};
use crate::motion::wall::AbsorbingWall;

#[derive(Clone, Debug)]
pub(crate) struct Surfaces {
    pub(crate) active_receivers: ActiveReceivers,
    walls: Vec<AbsorbingWall>,
    membranes: Vec<Membrane>,
    /// Indexed by receiver and species.
    sees: Vec<Vec<bool>>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct SpeciesSurfaces<'a> {
    pub(crate) surfaces: &'a Surfaces,
    pub(crate) step: &'a SpeciesStep,
    pub(crate) duration: f32,
}

impl Surfaces {
    pub(crate) fn new(model: &Model) -> Self {
        Self {
            active_receivers: ActiveReceivers::new(model),
            walls: AbsorbingWall::all(model),
            membranes: model.membranes.clone(),
            sees: model.receivers.iter().map(|receiver| receiver.sees.clone()).collect(),
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.active_receivers.all.is_empty() && self.walls.is_empty() && self.membranes.is_empty()
    }

    pub(crate) fn has_membranes(&self) -> bool {
        !self.membranes.is_empty()
    }

    /// Returns `true` if an event applies to a species. Receptors bind no product in the step of its decay, because the
    /// request depends on the species.
    pub(crate) fn captures(&self, event: &Event, (species, is_product): (u32, bool)) -> bool {
        match *event {
            Event::Arrived { receiver, .. } => self.sees[receiver as usize][species as usize],
            _ => !is_product,
        }
    }
}

impl SpeciesSurfaces<'_> {
    #[cold]
    #[inline(never)]
    pub(crate) fn hold_back(&self, moved: &mut ParticleMove) {
        let ParticleMove { species, context, path, free_end, .. } = moved;
        let mut ends = StepEnds { end: path.end, free: *free_end, after: path.after };
        self.among_membranes(*species).hold_back(path.before, &mut ends, *context);
        (path.end, *free_end, path.after) = (ends.end, ends.free, ends.after);
    }

    #[inline]
    pub(crate) fn resolve<'b>(
        &self,
        moved: &mut ParticleMove,
        receivers: impl Iterator<Item = &'b ReceiverState>,
    ) -> Option<Capture> {
        let Self { surfaces: Surfaces { active_receivers, walls, .. }, step, duration } = self;
        let (species, after) = (moved.species, moved.path.after);
        let near_side = receivers.filter(|state| !self.separates(species, [after, state.center]));
        let surroundings = PathSurroundings { domain: &step.domain, duration: *duration, walls };
        let capture = active_receivers.resolve(moved, surroundings, near_side);
        // Reflecting receivers are so far from membranes that they carry at most one step in 16 000 across one.
        if moved.reflection.is_some() && self.separates(species, [after, moved.path.after]) {
            moved.stay();
        }
        self.first_with_walls(moved, capture)
    }

    #[inline(always)]
    pub(crate) fn absorb(&self, moved: &ParticleMove) -> Option<Capture> {
        self.first_with_walls(moved, None)
    }

    #[inline(always)]
    fn first_with_walls(&self, moved: &ParticleMove, capture: Option<Capture>) -> Option<Capture> {
        if self.surfaces.walls.is_empty() { capture } else { self.absorb_at_walls(moved, capture) }
    }

    #[inline(never)]
    fn absorb_at_walls(&self, moved: &ParticleMove, capture: Option<Capture>) -> Option<Capture> {
        let ParticleMove { at, species, context, path, .. } = *moved;
        let domain = &self.step.domain;
        let seen = self.surfaces.walls.iter().filter(|wall| wall.sees[species as usize]);
        let near_side =
            seen.filter(|wall| !self.separates(species, [path.after, wall.foot_point(domain, path.after)]));
        let mut first = FirstHit(capture);
        for wall in near_side {
            if let Some(hit) = wall.hit(domain, moved) {
                first.update(context, Capture { hit, event: Event::Arrived { at, receiver: wall.receiver } });
            }
        }
        first.0
    }

    #[inline(always)]
    fn separates(&self, species: u32, ends: [[f32; 3]; 2]) -> bool {
        self.surfaces.has_membranes() && self.among_membranes(species).separates(ends)
    }

    #[cold]
    #[inline(never)]
    fn among_membranes(&self, species: u32) -> MembraneStep<'_> {
        let SpeciesStep { ref domain, length, coefficient, gaps, .. } = *self.step;
        MembraneStep {
            membranes: &self.surfaces.membranes,
            domain,
            species: species as usize,
            diffusion: coefficient,
            spread: length,
            gaps,
        }
    }
}
