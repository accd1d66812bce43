//! A run of one rank among others.

use bytemuck::{Pod, Zeroable};
use lazygrid::{Algorithm, Config};
use lazygrid_ranks::{Communicator, Settings, SphereWrapper, gather};

use super::halo::RankHalo;
use super::pair_search::RankPairSearch;
use super::{Gathered, rows};
use crate::motion::binding::{self, BindingRequest};
use crate::reaction::dissociation::Dissociated;
use crate::release::rank_slice::RankSlice;
use crate::run::simulation::Moved;
use crate::{Arrival, Error, Model, Simulation, State, Totals};

/// One rank's part of a run.
///
/// Methods that change it are collective: every rank calls them in the same order, in its rayon pool.
#[derive(Debug)]
pub struct RankSimulation<C> {
    communicator: C,
    run: Simulation,
    totals: Totals,
    pair_search: Option<RankPairSearch>,
    wrapper: SphereWrapper,
}

/// Data requested of [`RankSimulation::gather`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GatherFields {
    pub received: bool,
    pub particles: bool,
}

/// Every rank knows the origin from the id.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Arrived {
    receiver: u32,
    species: u32,
    id: u32,
}

impl<C: Communicator> RankSimulation<C> {
    /// Begins a run. `detector` selects the backend and the algorithm by which this rank finds pairs, each rank its own;
    /// the model gives the space and the interactions. Particles move on the CPU.
    ///
    /// # Errors
    /// On every rank, those of the first that fails: as [`Simulation::new`] and [`Detector::new`](lazygrid::Detector::new).
    /// [`Communicator::difference`] if models, seeds or steps differ.
    pub fn new(communicator: C, model: Model, seed: u64, detector: Config) -> Result<Self, C::Error> {
        let state = State::new_slice(&model, seed, RankSlice::new(communicator.rank(), communicator.ranks()));
        Self::begin(communicator, model, seed, detector, state)
    }

    /// Resumes a run from a state of the same model and seed, with the counts of all ranks and this rank's particles.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn resume(
        communicator: C,
        model: Model,
        seed: u64,
        detector: Config,
        state: State,
    ) -> Result<Self, C::Error> {
        let state = match state.belongs_to(&model) {
            true => Ok(state.part(&model, communicator.rank() == 0)),
            false => Err(Error::Model("the state is one of another model".to_owned())),
        };
        Self::begin(communicator, model, seed, detector, state)
    }

    fn begin(
        mut communicator: C,
        model: Model,
        seed: u64,
        detector: Config,
        state: Result<State, Error>,
    ) -> Result<Self, C::Error> {
        let (rank, ranks) = (communicator.rank(), communicator.ranks());
        let state = communicator.agree(state.map_err(|error| communicator.failure(error.to_string())))?;
        shared(&model, seed, state.step).agree(&mut communicator)?;
        let made = || {
            let wrapper = SphereWrapper::new(model.boundary.space()?, None);
            let run = Simulation::resume(model, seed, Algorithm::Auto, state)?;
            let pair_search = RankPairSearch::of(&run.model, detector, rank, ranks)?;
            Ok((run, pair_search, wrapper))
        };
        let made = made().map_err(|error: Error| communicator.failure(error.to_string()));
        let (run, pair_search, wrapper) = communicator.agree(made)?;
        let totals = run.state.totals.clone();
        let mut all = Self { communicator, run, totals, pair_search, wrapper };
        all.add_up();
        Ok(all)
    }

    pub fn model(&self) -> &Model {
        &self.run.model
    }

    pub fn step_count(&self) -> u32 {
        self.run.state.step
    }

    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    pub fn part(&self) -> &State {
        &self.run.state
    }

    /// Returns warnings of refused requests for receptors.
    pub(super) fn request_warnings(&self) -> Vec<String> {
        self.run.requests.warnings(&self.run.model)
    }

    pub fn communicator(&mut self) -> &mut C {
        &mut self.communicator
    }

    pub(super) fn agree<T>(&self, result: Result<T, Error>) -> Result<T, C::Error> {
        self.communicator.agree(result.map_err(|error| self.communicator.failure(error.to_string())))
    }

    /// Does a step as [`Simulation::step`].
    ///
    /// # Errors
    /// Returns the error of one rank on all: as [`Simulation::step`], and the communicator's.
    pub fn step(&mut self) -> Result<(), C::Error> {
        let free = binding::free(&self.run.model, &self.totals.occupied);
        let moved = self.advance(&free)?;
        let bids = self.all_bids(&moved)?;
        let rejected = self.run.requests.reject(bids, &free);
        self.run.apply_events(&moved, &rejected);
        let Self { communicator, run, pair_search, .. } = self;
        let interact = |search: &mut RankPairSearch| search.interact(communicator, run);
        let outcomes = pair_search.as_mut().map_or_else(|| Ok(Vec::new()), interact)?;
        let splits = self.run.splits();
        let parents = self.all_parents(&splits)?;
        let share = RankSlice::new(self.communicator.rank(), self.communicator.ranks());
        let done =
            self.run.conclude(&outcomes, &splits, &parents).and_then(|()| self.run.finish(&moved, share));
        self.agree(done)?;
        self.add_up();
        Ok(())
    }

    fn advance(&mut self, free: &[u32]) -> Result<Moved, C::Error> {
        let Self { communicator, run, pair_search, wrapper, .. } = self;
        if run.collisions.is_some()
            && let Some(search) = pair_search
        {
            // Ranks exchange fewer particles in motion between compact parts of space.
            search.migrate(communicator, run)?;
        }
        let moved = run.advance(free, &mut RankHalo::new(communicator, wrapper))?;
        if communicator.rank() > 0 {
            // Every rank knows the collisions of all.
            run.state.totals.contacts = 0;
        }
        Ok(moved)
    }

    fn add_up(&mut self) {
        let own: Vec<u64> = self.run.state.totals.counts().copied().collect();
        let all = self.communicator.all_reduce_sum(&own);
        self.totals.counts_mut().zip(all).for_each(|(count, all)| *count = all);
    }

    fn all_bids(&mut self, moved: &Moved) -> Result<Vec<BindingRequest>, C::Error> {
        if self.totals.occupied.is_empty() {
            return Ok(Vec::new());
        }
        Ok(self.communicator.all_gather("bids for receptors", &self.run.bids(moved))?.0)
    }

    fn all_parents(&mut self, splits: &[Dissociated]) -> Result<Vec<u32>, C::Error> {
        if self.run.dissociation.is_empty() {
            return Ok(Vec::new());
        }
        let own = splits.iter().filter(|split| split.is_parent()).map(|split| split.id);
        let (mut parents, _) =
            self.communicator.all_gather("ids of what comes apart", &own.collect::<Vec<_>>())?;
        parents.sort_unstable();
        Ok(parents)
    }

    /// Gathers the state on rank 0.
    pub fn gather(&mut self, fields: GatherFields) -> Result<Gathered<'_>, C::Error> {
        let Self { communicator, run, totals, .. } = self;
        let mut arrivals = Vec::new();
        if run.model.logs_arrivals {
            let own = run.arrivals().iter();
            let own: Vec<_> =
                own.map(|&Arrival { receiver, species, id, .. }| Arrived { receiver, species, id }).collect();
            let all = gather(communicator, "arrivals", &own)?.into_iter();
            let origins = &run.state.origins;
            arrivals.extend(all.map(|Arrived { receiver, species, id }| Arrival {
                receiver,
                species,
                id,
                step: run.state.step,
                origin: origins.of(id),
            }));
            arrivals.sort_unstable_by_key(|arrival| arrival.id);
        }
        let mut received = Vec::new();
        if fields.received {
            let species = run.model.species.len();
            let all = communicator.all_reduce_sum(&run.received().concat());
            received = all.chunks(species.max(1)).map(<[u64]>::to_vec).collect();
            received.resize(run.model.receivers.len(), Vec::new());
        }
        let mut state = run.state.without_particles(totals.clone());
        if fields.particles {
            let own: Vec<_> =
                (0..run.state.particles.len() as u32).map(|at| rows::row(&run.state.particles, at)).collect();
            let all = gather(communicator, "particles", &own)?;
            state.particles = rows::particles(&all, run.model.has_velocity());
            state.bound = gather(communicator, "what is bound", &run.state.bound)?;
        }
        Ok(Gathered { model: &run.model, totals, received, arrivals, state })
    }
}

fn shared(model: &Model, seed: u64, step: u32) -> Settings {
    Settings::new(env!("CARGO_PKG_VERSION"))
        // The text has every number exactly, and all ranks have the same version.
        .with_long("model", "a model", format_args!("{model:?}"))
        .with("seed", seed)
        .with("steps done", step)
}
