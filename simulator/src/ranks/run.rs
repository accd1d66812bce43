use std::ops::ControlFlow;

use lazygrid::Config;
use lazygrid_ranks::{Communicator, Settings, gather};

use super::{GatherFields, RankSimulation, agree};
use crate::output::{Files, Lock, WrittenRun, occupancy};
use crate::release::rank_slice::RankSlice;
use crate::run::checkpoint::Checkpoint;
use crate::run::memory_estimate::{Sharing, check_largest_release};
use crate::run::step_loop::OpenRun;
use crate::run::{ReplicaSlot, Run, RunEnd};
use crate::scenario::Scenario;
use crate::{Error, Model, RunView, Totals};

impl Run {
    /// Does all steps like [`run`](Self::run), together with all ranks. All must see the directory: the first writes
    /// common files, every rank its particles. After each step (several on GPUs), every rank calls `watch`, which can
    /// stop all. Uses the caller's rayon pool. `detector` selects this rank's backend, instead of
    /// [`backend`](Self::backend).
    ///
    /// # Errors
    /// Every rank returns the errors of one: as [`run`](Self::run), [`RankSimulation::new`], and the communicator's.
    /// [`Communicator::difference`] if ranks have different runs; detector, algorithm and [`threads`](Self::threads)
    /// may differ.
    pub fn run_distributed<C: Communicator>(
        &self,
        mut communicator: C,
        detector: Config,
        mut watch: impl FnMut(u32) -> ControlFlow<()>,
    ) -> Result<(RunEnd, RankSimulation<C>), C::Error> {
        self.shared().agree(&mut communicator)?;
        let detector = detector.algorithm(self.algorithm);
        agree(&communicator, self.check_formats())?;
        if communicator.rank() == 0 {
            self.log_warnings();
        }
        let mut run = match self.resume {
            true => DistributedRun::resume(self, communicator, detector)?,
            false => DistributedRun::begin(self, communicator, detector)?,
        };
        let end = self.do_steps(&mut run, |run| watch(run.simulation.step_count()))?;
        let converted = run.files.as_ref().map_or(Ok(()), |files| files.convert(run.model()));
        run.agree(converted)?;
        Ok((end, run.simulation))
    }

    fn shared(&self) -> Settings {
        let Scenario { steps, output, .. } = &self.scenario;
        Settings::new(env!("CARGO_PKG_VERSION"))
            .with("resume", self.resume)
            .with("steps", steps)
            .with("output", format_args!("{output:?}"))
            .with("directory", self.directory.display())
    }
}

/// The run of one rank.
struct DistributedRun<'a, C> {
    run: &'a Run,
    simulation: RankSimulation<C>,
    sharing: Sharing,
    /// On rank 0.
    files: Option<Files>,
}

impl<'a, C: Communicator> DistributedRun<'a, C> {
    fn begin(run: &'a Run, communicator: C, detector: Config) -> Result<Self, C::Error> {
        let Scenario { model, seed, steps, .. } = &run.scenario;
        let is_first = communicator.rank() == 0;
        let sharing = Sharing::over_ranks(&communicator);
        agree(&communicator, check_largest_release(model, *steps, sharing))?;
        let mut simulation = RankSimulation::new(communicator, model.clone(), *seed, detector)?;
        let gathered = simulation.gather(GatherFields::default())?;
        let files = is_first.then(|| run.create_files(&gathered, ReplicaSlot::NONE)).transpose();
        let files = simulation.agree(files)?;
        let mut begun = Self { run, simulation, sharing, files };
        begun.record()?;
        begun.save()?;
        Ok(begun)
    }

    fn resume(run: &'a Run, communicator: C, detector: Config) -> Result<Self, C::Error> {
        let Scenario { model, seed, output, .. } = &run.scenario;
        let path = run.checkpoint_path();
        let slice = RankSlice::new(communicator.rank(), communicator.ranks());
        let is_first = communicator.rank() == 0;
        let sharing = Sharing::over_ranks(&communicator);
        let lock = agree(&communicator, is_first.then(|| run.lock()).transpose())?;
        let read = || {
            let checkpoint = Checkpoint::read(&path)?;
            run.check_continues(&path, &checkpoint)?;
            let (records, backend) = (checkpoint.files.clone(), checkpoint.backend.clone());
            Ok((records, backend, checkpoint.into_slice(&path, slice)?))
        };
        let (records, backend, state) = agree(&communicator, read())?;
        let mut simulation = RankSimulation::resume(communicator, model.clone(), *seed, detector, state)?;
        if is_first && backend != simulation.backend().name() {
            run.warn_of_backends(simulation.step_count(), &backend, simulation.backend());
        }
        let gathered = simulation.gather(GatherFields::default())?;
        let reopen = |lock: Lock| {
            run.check_disk_space(&gathered, ReplicaSlot::NONE)?;
            let step_count = gathered.step_count();
            let written = WrittenRun { model, seed: *seed, records: &records, step_count };
            Files::reopen(&run.directory, *output, written, lock)
        };
        let files = lock.map(reopen).transpose();
        let files = simulation.agree(files)?;
        Ok(Self { run, simulation, sharing, files })
    }
}

impl<C: Communicator> OpenRun for DistributedRun<'_, C> {
    type Error = C::Error;

    fn model(&self) -> &Model {
        self.simulation.model()
    }

    fn step_count(&self) -> u32 {
        self.simulation.step_count()
    }

    fn totals(&self) -> &Totals {
        self.simulation.totals()
    }

    fn steps_at_once(&self) -> u32 {
        self.simulation.steps_at_once()
    }

    fn sharing(&self) -> Sharing {
        self.sharing
    }

    fn request_warnings(&self) -> Vec<String> {
        self.simulation.request_warnings()
    }

    fn logs(&self) -> bool {
        self.files.is_some()
    }

    fn is_any(&mut self, own: bool) -> bool {
        self.simulation.communicator().all_reduce_sum(&[own.into()])[0] > 0
    }

    fn agree<T>(&self, result: Result<T, Error>) -> Result<T, C::Error> {
        self.simulation.agree(result)
    }

    fn advance(&mut self, max_steps: u32, _: u32) -> Result<(), C::Error> {
        self.simulation.advance(max_steps)
    }

    fn record(&mut self) -> Result<bool, C::Error> {
        let (step, output) = (self.step_count(), self.run.scenario.output);
        let fields = GatherFields {
            received: step.is_multiple_of(output.every),
            particles: output.has_frame(step)
                || output.animated(step).is_some()
                || step.is_multiple_of(output.every) && occupancy::is_logged(self.model()),
        };
        if fields == GatherFields::default() && !self.model().logs_arrivals {
            return Ok(false);
        }
        let Self { run, simulation, files, .. } = &mut *self;
        let gathered = simulation.gather(fields)?;
        let record = |files: &mut Files| {
            // The checkpoint includes this step.
            let is_full = step > 0 && run.is_disk_full(&gathered, ReplicaSlot::NONE)?;
            files.record(&gathered).map(|()| is_full)
        };
        let written = files.as_mut().map(record).transpose();
        let is_full = simulation.agree(written)?.unwrap_or(false);
        Ok(self.is_any(is_full))
    }

    fn save(&mut self) -> Result<(), C::Error> {
        let Self { run, simulation, files, .. } = self;
        let (path, seed) = (run.checkpoint_path(), run.scenario.seed);
        let (rank, ranks) = (simulation.communicator().rank(), simulation.communicator().ranks());
        let written = simulation
            .rank_state()
            .and_then(|state| Checkpoint::write_part(&path, seed, rank, ranks, &state));
        let record = simulation.agree(written)?;
        let parts = gather(simulation.communicator(), "the records of checkpoints", &[record])?;
        let (backend, state) = (simulation.backend(), simulation.without_particles());
        let write = |files: &mut Files| {
            let mut checkpoint = run.checkpoint(backend, files.sync()?, state);
            checkpoint.parts = parts;
            checkpoint.write(&path)
        };
        let written = files.as_mut().map_or(Ok(()), write);
        simulation.agree(written)
    }
}
