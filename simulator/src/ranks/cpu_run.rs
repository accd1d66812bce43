use lazygrid::{Algorithm, Config};
use lazygrid_ranks::{Communicator, SphereWrapper};

use super::agree;
use super::halo::RankHalo;
use super::pair_search::RankPairSearch;
use crate::motion::binding::{self, BindingRequest};
use crate::motion::collisions::Collisions;
use crate::reaction::dissociation::Dissociated;
use crate::release::rank_slice::RankSlice;
use crate::run::simulation::StepMoves;
use crate::{Error, Model, Simulation, State};

#[derive(Debug)]
pub(super) struct CpuRun {
    pub(super) simulation: Simulation,
    pair_search: Option<RankPairSearch>,
    /// For collisions.
    wrapper: SphereWrapper,
}

impl CpuRun {
    pub(super) fn new(
        model: Model,
        seed: u64,
        detector: Config,
        state: State,
        [rank, ranks]: [u32; 2],
    ) -> Result<Self, Error> {
        let simulation = Simulation::resume(model, seed, Algorithm::Auto, state)?;
        let may_collide = simulation.collisions.as_ref().and_then(Collisions::interactions);
        let wrapper = SphereWrapper::new(simulation.model.boundary.space()?, may_collide);
        let pair_search = RankPairSearch::new(&simulation.model, detector, rank, ranks)?;
        Ok(Self { simulation, pair_search, wrapper })
    }

    /// `occupied` counts the receptors of all ranks.
    pub(super) fn step<C: Communicator>(
        &mut self,
        communicator: &mut C,
        occupied: &[u64],
    ) -> Result<(), C::Error> {
        let free = binding::free_receptors(&self.simulation.model, occupied);
        let moved = self.advance(communicator, &free)?;
        let requests = self.requests(communicator, &moved)?;
        let rejected = self.simulation.requests.reject(requests, &free);
        self.simulation.apply_events(&moved, &rejected);
        self.gather_spared(communicator)?;
        let Self { simulation, pair_search, .. } = self;
        let interact = |search: &mut RankPairSearch| search.interact(communicator, simulation);
        let outcomes = pair_search.as_mut().map_or_else(|| Ok(Vec::new()), interact)?;
        let splits = self.simulation.splits();
        let parents = self.parents(communicator, &splits)?;
        let slice = RankSlice::new(communicator.rank(), communicator.ranks());
        let concluded = self.simulation.conclude(&outcomes, &splits, &parents);
        agree(communicator, concluded.and_then(|()| self.simulation.finish(&moved, slice)))
    }

    fn advance<C: Communicator>(
        &mut self,
        communicator: &mut C,
        free: &[u32],
    ) -> Result<StepMoves, C::Error> {
        let Self { simulation, pair_search, wrapper } = self;
        if simulation.collisions.is_some()
            && let Some(search) = pair_search
        {
            // Ranks exchange fewer particles in motion between compact domains.
            search.migrate(communicator, simulation)?;
        }
        let moved = simulation.advance(free, &mut RankHalo::new(communicator, wrapper))?;
        if communicator.rank() > 0 {
            // Every rank knows the collisions of all.
            simulation.state.totals.contacts = 0;
        }
        Ok(moved)
    }

    fn requests<C: Communicator>(
        &self,
        communicator: &mut C,
        moved: &StepMoves,
    ) -> Result<Vec<BindingRequest>, C::Error> {
        if self.simulation.state.totals.occupied.is_empty() {
            return Ok(Vec::new());
        }
        all_requests(communicator, &self.simulation.binding_requests(moved))
    }

    /// Adds the spared particles of all ranks, which may migrate or become ghosts in the search for pairs.
    fn gather_spared<C: Communicator>(&mut self, communicator: &mut C) -> Result<(), C::Error> {
        let Simulation { dissociation, model, spared, .. } = &mut self.simulation;
        if dissociation.is_empty() || self.pair_search.is_none() || !model.forms_dissociating() {
            return Ok(());
        }
        let (mut all, _) = communicator.all_gather("ids of particles that do not dissociate", &spared[..])?;
        all.sort_unstable();
        *spared = all;
        Ok(())
    }

    fn parents<C: Communicator>(
        &self,
        communicator: &mut C,
        splits: &[Dissociated],
    ) -> Result<Vec<u32>, C::Error> {
        if self.simulation.dissociation.is_empty() {
            return Ok(Vec::new());
        }
        let parents = splits.iter().filter(|split| split.is_parent()).map(|split| split.id);
        all_parents(communicator, &parents.collect::<Vec<_>>())
    }
}

/// Returns the requests of all ranks for receptors. Collective.
pub(super) fn all_requests<C: Communicator>(
    communicator: &mut C,
    requests: &[BindingRequest],
) -> Result<Vec<BindingRequest>, C::Error> {
    Ok(communicator.all_gather("requests for receptors", requests)?.0)
}

/// Returns ascending ids of particles that dissociate into two. Collective.
pub(super) fn all_parents<C: Communicator>(
    communicator: &mut C,
    own_parents: &[u32],
) -> Result<Vec<u32>, C::Error> {
    let (mut parents, _) = communicator.all_gather("ids of particles that dissociate", own_parents)?;
    parents.sort_unstable();
    Ok(parents)
}

#[cfg(test)]
mod tests {
    use lazygrid::Sphere;
    use lazygrid_ranks::ClassBounds;

    use super::*;
    use crate::model::Contact;
    use crate::model::boundary::Axis;
    use crate::motion::collisions::tests::model;

    #[test]
    fn ghosts_in_motion_are_of_species_that_may_collide() {
        let mut model = model(Contact::Separate, Axis::Open);
        for (radius, expected) in [(0.0, [true, true, false]), (0.3, [true; 3])] {
            model.species[1].radius = radius;
            let state = State::new(&model, 1).expect("a state");
            let run = CpuRun::new(model.clone(), 1, Config::default(), state, [0, 2]).expect("a run");
            let bounds = |species| ClassBounds::around(&run.wrapper.wrap(Sphere::default(), species));
            let can_pair = |[a, b]: [u32; 2]| bounds(a).can_pair(&bounds(b), &run.wrapper);
            assert_eq!([[0, 0], [0, 1], [1, 1]].map(can_pair), expected, "{radius}");
        }
    }
}
