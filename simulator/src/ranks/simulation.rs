//! A run of one rank among others.

use std::ops::ControlFlow;

use bytemuck::{Pod, Zeroable};
use lazygrid::Algorithm;
use lazygrid_ranks::{
    Communicator, Ghosts, PairKind, Partitioner, RankBounds, Search, Settings, SphereWrapper, gather,
    send_to_ranks,
};

use super::matching::DistributedMatching;
use super::{Gathered, check, rows};
use crate::motion::binding::{self, BindingRequest};
use crate::reaction::candidates::{BestCandidates, StepPairs};
use crate::reaction::dissociation::Dissociated;
use crate::reaction::{ReactantChange, interactions};
use crate::release::rank_slice::RankSlice;
use crate::run::simulation::{Moved, detector};
use crate::{Arrival, Error, Model, ReceiverKind, Simulation, State, Totals};

/// One rank's part of a run.
///
/// Methods that change it are collective: every rank calls them in the same order, in its rayon pool.
#[derive(Debug)]
pub struct RankSimulation<C> {
    communicator: C,
    run: Simulation,
    totals: Totals,
    pair_search: Option<RankPairSearch>,
}

#[derive(Debug)]
struct RankPairSearch {
    wrapper: SphereWrapper,
    search: Search,
    partitioner: Partitioner,
    matching: DistributedMatching,
}

/// Data that [`RankSimulation::gather`] gathers on rank 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GatherFields {
    /// Counts of receivers.
    pub received: bool,
    /// Free and bound particles.
    pub particles: bool,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct OutcomeMessage {
    at: u32,
    /// 1 plus the product's species; 0 removes the particle.
    product: u32,
    position: [f32; 3],
}

/// Every rank knows the origin from the id.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Arrived {
    receiver: u32,
    species: u32,
    id: u32,
}

/// Load limit over the mean, above which space is repartitioned.
const BOUND: f64 = 1.2;

impl<C: Communicator> RankSimulation<C> {
    /// Begins a run; `algorithm` does not change the result.
    ///
    /// # Errors
    /// On every rank, those of the first that fails: as [`Simulation::new`], and [`Error::NotOverRanks`].
    /// [`Communicator::difference`] if models, seeds or steps differ.
    pub fn new(communicator: C, model: Model, seed: u64, algorithm: Algorithm) -> Result<Self, C::Error> {
        let state = State::new_slice(&model, seed, RankSlice::new(communicator.rank(), communicator.ranks()));
        Self::begin(communicator, model, seed, algorithm, state)
    }

    /// Resumes a run from a state of the same model and seed, with the counts of all ranks and this rank's particles.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn resume(
        communicator: C,
        model: Model,
        seed: u64,
        algorithm: Algorithm,
        state: State,
    ) -> Result<Self, C::Error> {
        let state = match state.belongs_to(&model) {
            true => Ok(state.part(&model, communicator.rank() == 0)),
            false => Err(Error::Model("the state is one of another model".to_owned())),
        };
        Self::begin(communicator, model, seed, algorithm, state)
    }

    fn begin(
        mut communicator: C,
        model: Model,
        seed: u64,
        algorithm: Algorithm,
        state: Result<State, Error>,
    ) -> Result<Self, C::Error> {
        let (rank, ranks) = (communicator.rank(), communicator.ranks());
        let state = communicator.agree(state.map_err(|error| communicator.failure(error.to_string())))?;
        shared(&model, seed, state.step).agree(&mut communicator)?;
        let made = check(&model).and_then(|()| {
            let mut run = Simulation::resume(model, seed, algorithm, state)?;
            let pair_search = RankPairSearch::of(&mut run, algorithm, rank, ranks)?;
            Ok((run, pair_search))
        });
        let made = made.map_err(|error| communicator.failure(error.to_string()));
        let (run, pair_search) = communicator.agree(made)?;
        let totals = run.state.totals.clone();
        let mut all = Self { communicator, run, totals, pair_search };
        all.add_up();
        Ok(all)
    }

    /// Returns the model.
    pub fn model(&self) -> &Model {
        &self.run.model
    }

    /// Returns the finished steps.
    pub fn step_count(&self) -> u32 {
        self.run.state.step
    }

    /// Returns the counts of all ranks.
    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// Returns this rank's particles and part of the counts.
    pub fn part(&self) -> &State {
        &self.run.state
    }

    /// Returns the communicator.
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
        let free = binding::free(&self.run.model, &self.totals.arrived);
        let moved = self.run.advance(&free);
        let moved = self.agree(moved)?;
        let bids = self.all_bids(&moved)?;
        self.run.apply_events(&moved, &binding::rejected(bids, &free));
        let outcomes = self.interact()?;
        let splits = self.run.splits(&outcomes);
        let parents = self.all_parents(&splits)?;
        let share = RankSlice::new(self.communicator.rank(), self.communicator.ranks());
        let done = self.run.conclude(&outcomes, &splits, &parents).and_then(|()| self.run.finish(share));
        self.agree(done)?;
        self.add_up();
        Ok(())
    }

    fn add_up(&mut self) {
        let own: Vec<u64> = self.run.state.totals.counts().copied().collect();
        let all = self.communicator.all_reduce_sum(&own);
        self.totals.counts_mut().zip(all).for_each(|(count, all)| *count = all);
    }

    fn all_bids(&mut self, moved: &Moved) -> Result<Vec<BindingRequest>, C::Error> {
        let has_receptors = |receiver: &crate::Receiver| matches!(receiver.kind, ReceiverKind::Receptors(_));
        if !self.run.model.receivers.iter().any(has_receptors) {
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

    fn interact(&mut self) -> Result<Vec<ReactantChange>, C::Error> {
        let Self { communicator, run, pair_search, .. } = self;
        let Some(pair_search) = pair_search else { return Ok(Vec::new()) };
        pair_search.migrate(communicator, run)?;
        let ghosts = pair_search.ghosts(communicator, run)?;
        let own = run.state.particles.len();
        if run.reactions.is_empty() {
            let counted = pair_search.count(run, &ghosts);
            communicator.agree(counted.map_err(|error| communicator.failure(error.to_string())))?;
            return Ok(Vec::new());
        }
        for ghost in ghosts.particles() {
            run.state.particles.push(rows::of_ghost(ghost), run.model.has_velocity());
        }
        let RankPairSearch { search, matching, .. } = pair_search;
        let sample = |taken: &[bool], best: &mut BestCandidates| sample(search, run, &ghosts, taken, best);
        let chosen = matching.greedy(communicator, own, &ghosts, sample)?;
        let outcomes = run.reactions.all_outcomes(&run.state.particles, &chosen, run.key, run.state.step);
        chosen.iter().for_each(|c| run.state.totals.reacted[c.rule as usize] += 1);
        run.state.particles.truncate(own);
        deliver_outcomes(communicator, outcomes, own, &ghosts)
    }

    /// Gathers the state on rank 0.
    ///
    /// # Errors
    /// Fails if the communicator fails.
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

impl RankPairSearch {
    fn of(run: &mut Simulation, algorithm: Algorithm, rank: u32, ranks: u32) -> Result<Option<Self>, Error> {
        let Some(within) = run.detector.take() else { return Ok(None) };
        // The paper's grids take one set, and ghosts are a second.
        let of_two = matches!(algorithm, Algorithm::Auto | Algorithm::CellList | Algorithm::Naive);
        let across = if of_two { None } else { detector(&run.model, Algorithm::Auto)? };
        let wrapper = SphereWrapper::new(run.model.boundary.space()?, interactions(&run.model)?.as_ref());
        let search = Search::new(within, across, wrapper.clone(), rank, ranks);
        Ok(Some(Self {
            wrapper,
            search,
            partitioner: Partitioner::default(),
            matching: DistributedMatching::default(),
        }))
    }

    fn migrate<C: Communicator>(
        &mut self,
        communicator: &mut C,
        run: &mut Simulation,
    ) -> Result<(), C::Error> {
        let State { particles, totals, .. } = &mut run.state;
        let wrapped = rows::wrapped(&self.wrapper, particles);
        let ids: Vec<u64> = particles.id.iter().map(|&id| id.into()).collect();
        let ranks = self.partitioner.assign(communicator, &wrapped, &ids, BOUND)?.ranks;
        let own = communicator.rank();
        let mut leaving: Vec<u32> =
            (0..).zip(&ranks).filter(|&(_, &rank)| rank != own).map(|(at, _)| at).collect();
        let send = leaving.iter().map(|&at| (ranks[at as usize], rows::row(particles, at))).collect();
        let (came, _) = send_to_ranks(communicator, "particles that change rank", send)?;
        leaving.iter().for_each(|&at| totals.present[particles.species[at as usize] as usize] -= 1);
        particles.remove(&mut leaving);
        let came = rows::particles(&came, run.model.has_velocity());
        came.species.iter().for_each(|&species| totals.present[species as usize] += 1);
        particles.append(came);
        Ok(())
    }

    fn ghosts<C: Communicator>(&self, communicator: &mut C, run: &Simulation) -> Result<Ghosts, C::Error> {
        let particles = &run.state.particles;
        let wrapped = rows::wrapped(&self.wrapper, particles);
        let bounds = RankBounds::gather(communicator, &wrapped)?;
        let leaving = bounds.ghosts(communicator.rank(), &wrapped, &self.wrapper);
        let leaving = communicator.agree(leaving.map_err(|error| communicator.detector_failure(error)))?;
        Ghosts::exchange(communicator, &leaving, |at| rows::ghost(particles, at))
    }

    fn count(&mut self, run: &mut Simulation, ghosts: &Ghosts) -> Result<(), Error> {
        let State { particles, totals, step, .. } = &mut run.state;
        let failed = |source| Error::Step { step: *step, source };
        totals.pairs = self.search.count(particles.spheres()?, ghosts).map_err(failed)?.reported();
        Ok(())
    }
}

/// Counts the pairs that this rank reports, and adds their reaction candidates to `best`, without `taken` particles.
/// Ghosts are the last particles.
fn sample(
    search: &mut Search,
    run: &mut Simulation,
    ghosts: &Ghosts,
    taken: &[bool],
    best: &mut BestCandidates,
) -> Result<(), Error> {
    let Simulation { key, state: State { particles, totals, step, .. }, reactions, .. } = run;
    let (particles, key, step) = (&*particles, *key, *step);
    let own = particles.len() - ghosts.particles().len();
    let (mut across, mut sampled) = (Vec::new(), Ok(()));
    let counts = search.run(particles.first_spheres(own)?, ghosts, |found, pairs| {
        let pairs = match found {
            PairKind::Local => pairs,
            PairKind::WithGhost => {
                across.clear();
                across.extend(pairs.iter().map(|&[i, j]| [i, own as u32 + j]));
                &across
            }
        };
        let pairs = StepPairs { particles, pairs: bytemuck::cast_slice(pairs), key, step };
        sampled = reactions.sample(pairs, |particle| taken[particle as usize], best);
        if sampled.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    totals.pairs = counts.map_err(|source| Error::Step { step, source })?.reported();
    sampled
}

fn deliver_outcomes<C: Communicator>(
    communicator: &mut C,
    mut outcomes: Vec<ReactantChange>,
    own: usize,
    ghosts: &Ghosts,
) -> Result<Vec<ReactantChange>, C::Error> {
    let ghost_of =
        |outcome: &ReactantChange| (outcome.at as usize).checked_sub(own).map(|ghost| ghost as u32);
    let message = |outcome: &ReactantChange| {
        let ghost = ghost_of(outcome)?;
        let at = ghosts.particles()[ghost as usize].index;
        let product = outcome.product.map_or(0, |species| species + 1);
        Some((ghosts.rank_of(ghost), OutcomeMessage { at, product, position: outcome.position }))
    };
    let send = outcomes.iter().filter_map(message).collect();
    let (came, _) = send_to_ranks(communicator, "outcomes of ghosts", send)?;
    outcomes.retain(|outcome| ghost_of(outcome).is_none());
    outcomes.extend(came.into_iter().map(|OutcomeMessage { at, product, position }| ReactantChange {
        at,
        product: product.checked_sub(1),
        position,
    }));
    Ok(outcomes)
}
