use std::borrow::Cow;

use bytemuck::{Pod, Zeroable};
use lazygrid::{Backend, Config};
use lazygrid_ranks::{Communicator, Settings, gather};

use super::cpu_run::CpuRun;
use super::rank_run::{RankRun, agree_on_gpus, moves_on_gpus};
use super::{Gathered, agree, rows};
use crate::release::rank_slice::RankSlice;
use crate::state::RankStart;
use crate::{Arrival, Error, Model, State, Totals};

/// The run of one rank.
///
/// Methods that change it are collective: every rank calls them in the same order, in its rayon pool.
#[derive(Debug)]
pub struct RankSimulation<C> {
    communicator: C,
    run: RankRun,
    totals: Totals,
    /// An error left the ranks at different steps.
    has_failed: bool,
}

/// Data requested of [`RankSimulation::gather`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GatherFields {
    pub received: bool,
    pub particles: bool,
}

/// The origin follows from the id.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct ArrivalMessage {
    receiver: u32,
    species: u32,
    id: u32,
    step: u32,
}

impl<C: Communicator> RankSimulation<C> {
    /// Begins a run. `detector` selects this rank's backend and algorithm; the model gives the space and the
    /// interactions.
    ///
    /// Particles move on GPUs if every `detector` [requires one](Config::requires_gpu), and the model has kernels, no
    /// reactions and contacts, and exceeds no device.
    ///
    /// # Errors
    /// Every rank returns those of the first that fails: as [`Simulation::new`](crate::Simulation::new),
    /// [`Detector::new`](lazygrid::Detector::new), and failures of devices. [`Communicator::difference`] if models,
    /// seeds or steps differ.
    pub fn new(communicator: C, model: Model, seed: u64, detector: Config) -> Result<Self, C::Error> {
        let state = State::new_slice(&model, seed, RankSlice::new(communicator.rank(), communicator.ranks()));
        Self::begin(communicator, model, seed, detector, state)
    }

    /// Resumes a run from a state of the same model and seed, with the counts of all ranks and this rank's particles.
    ///
    /// # Errors
    /// See [`new`](Self::new).
    pub fn resume(
        communicator: C,
        model: Model,
        seed: u64,
        detector: Config,
        state: State,
    ) -> Result<Self, C::Error> {
        let state = match state.belongs_to(&model) {
            true => Ok(state.into_rank_state(&model, communicator.rank() == 0)),
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
        let state = agree(&communicator, state)?;
        shared(&model, seed, state.step).agree(&mut communicator)?;
        agree(&communicator, model.check())?;
        let start = RankStart { seed, state: &state, slice: RankSlice::new(rank, ranks) };
        let on_gpus = match moves_on_gpus(&mut communicator, &model, &detector) {
            true => {
                let run = RankRun::on_gpu(model.clone(), &detector, start, communicator.ranks_on_machine());
                agree_on_gpus(&mut communicator, run)?
            }
            false => None,
        };
        let on_cpu = || CpuRun::new(model, seed, detector, state, [rank, ranks]);
        let run = match on_gpus {
            Some(run) => run,
            None => RankRun::Cpu(Box::new(agree(&communicator, on_cpu())?)),
        };
        let totals = run.view().totals().clone();
        let mut all = Self { communicator, run, totals, has_failed: false };
        all.add_up();
        Ok(all)
    }

    pub fn model(&self) -> &Model {
        self.run.view().model()
    }

    pub fn step_count(&self) -> u32 {
        self.run.view().step_count()
    }

    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// Returns the backend on which particles move, equal on all ranks.
    pub fn backend(&self) -> Backend {
        self.run.backend()
    }

    /// Returns this rank's state, read back if necessary. Not collective.
    ///
    /// # Errors
    /// [`Error::Detection`] if the device fails.
    pub fn rank_state(&self) -> Result<Cow<'_, State>, Error> {
        self.run.view().state()
    }

    pub(super) fn without_particles(&self) -> State {
        self.run.without_particles(self.totals.clone())
    }

    pub(super) fn request_warnings(&self) -> Vec<String> {
        self.run.request_warnings()
    }

    pub fn communicator(&mut self) -> &mut C {
        &mut self.communicator
    }

    pub(super) fn agree<T>(&self, result: Result<T, Error>) -> Result<T, C::Error> {
        agree(&self.communicator, result)
    }

    /// Does a step as [`Simulation::step`](crate::Simulation::step).
    ///
    /// # Errors
    /// See [`advance`](Self::advance).
    pub fn step(&mut self) -> Result<(), C::Error> {
        self.advance(1)
    }

    pub(super) fn steps_at_once(&self) -> u32 {
        self.run.steps_at_once()
    }

    /// Does up to `max_steps` steps: several on GPUs, but one on the CPU or if particles dissociate or bind.
    ///
    /// # Errors
    /// Returns the error of one rank on all: as [`AnySimulation::advance`](crate::AnySimulation::advance), and the
    /// communicator's. Later calls of this and of [`gather`](Self::gather) fail.
    pub fn advance(&mut self, max_steps: u32) -> Result<(), C::Error> {
        self.check_state()?;
        if max_steps == 0 {
            return Ok(());
        }
        let Self { communicator, run, totals, .. } = self;
        let advanced = match run {
            RankRun::Cpu(run) => run.step(communicator, &totals.occupied),
            #[cfg(feature = "gpu")]
            RankRun::Gpu(run) => run.advance(communicator, max_steps, &totals.occupied),
        };
        self.has_failed = advanced.is_err();
        advanced?;
        self.add_up();
        Ok(())
    }

    fn check_state(&self) -> Result<(), C::Error> {
        if !self.has_failed {
            return Ok(());
        }
        let message = "an earlier step failed; resume from an earlier state".to_owned();
        self.communicator.agree(Err(self.communicator.failure(message)))
    }

    fn add_up(&mut self) {
        let counts: Vec<u64> = self.run.view().totals().counts().copied().collect();
        let all = self.communicator.all_reduce_sum(&counts);
        self.totals.counts_mut().zip(all).for_each(|(count, all)| *count = all);
    }

    /// Gathers the state on rank 0.
    pub fn gather(&mut self, fields: GatherFields) -> Result<Gathered<'_>, C::Error> {
        self.check_state()?;
        let Self { communicator, run, totals, .. } = self;
        let view = run.view();
        let model = view.model();
        let mut state = run.without_particles(totals.clone());
        let mut arrivals = Vec::new();
        if model.logs_arrivals {
            let arrived = |&Arrival { receiver, species, id, step, .. }: &Arrival| ArrivalMessage {
                receiver,
                species,
                id,
                step,
            };
            let own_arrivals: Vec<_> = view.arrivals().iter().map(arrived).collect();
            let all = gather(communicator, "arrivals", &own_arrivals)?.into_iter();
            let origins = &state.origins;
            arrivals.extend(all.map(|ArrivalMessage { receiver, species, id, step }| Arrival {
                receiver,
                species,
                id,
                step,
                origin: origins.origin_of(id),
            }));
            arrivals.sort_unstable_by_key(|arrival| (arrival.step, arrival.id));
        }
        let mut received = Vec::new();
        if fields.received {
            let species = model.species.len();
            let all = communicator.all_reduce_sum(&view.received().concat());
            received = all.chunks(species.max(1)).map(<[u64]>::to_vec).collect();
            received.resize(model.receivers.len(), Vec::new());
        }
        if fields.particles {
            let rank_state = agree(communicator, view.state())?;
            let rows: Vec<_> = (0..rank_state.particles.len() as u32)
                .map(|at| rows::row(&rank_state.particles, at))
                .collect();
            let all = gather(communicator, "particles", &rows)?;
            state.particles = rows::particles(&all, model.has_velocity());
            state.bound = gather(communicator, "what is bound", &rank_state.bound)?;
        }
        Ok(Gathered { model, totals, received, arrivals, state })
    }
}

fn shared(model: &Model, seed: u64, step: u32) -> Settings {
    Settings::new(env!("CARGO_PKG_VERSION"))
        // The text has every number exactly.
        .with_long("model", "a model", format_args!("{model:?}"))
        .with("seed", seed)
        .with("steps done", step)
}
