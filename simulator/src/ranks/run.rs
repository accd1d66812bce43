use std::ops::ControlFlow;

use lazygrid::Config;
use lazygrid_ranks::{Communicator, Settings, gather};

use super::{GatherFields, RankSimulation, agree};
use crate::RunView;
use crate::output::{Files, Lock, WrittenRun, occupancy};
use crate::release::rank_slice::RankSlice;
use crate::run::checkpoint::Checkpoint;
use crate::run::memory_estimate::{MemoryGuard, Sharing, check_largest_release};
use crate::run::time_step_monitor::TimeStepMonitor;
use crate::run::{ReplicaSlot, Run, RunEnd};
use crate::scenario::Scenario;

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
        let is_first = communicator.rank() == 0;
        if is_first {
            self.scenario.run_warnings().iter().for_each(|message| log::warn!("{message}"));
        }
        let (mut simulation, mut files) = if self.resume {
            self.resume_distributed(communicator, detector)?
        } else {
            self.begin_distributed(communicator, detector)?
        };
        let first = simulation.step_count();
        let mut pace = TimeStepMonitor::default();
        let mut memory = MemoryGuard::default();
        let mut asks = |simulation: &mut RankSimulation<C>| {
            let is_stopped = watch(simulation.step_count()).is_break();
            simulation.communicator().all_reduce_sum(&[is_stopped.into()])[0] > 0
        };
        let mut stops = asks(&mut simulation);
        while !stops && simulation.step_count() < self.scenario.steps {
            let before = TimeStepMonitor::reaction_totals(simulation.totals());
            let step = simulation.step_count();
            let next = self.steps_to_next(step).min(simulation.steps_at_once());
            let present = simulation.totals().present.iter().sum();
            let sharing = Sharing::over_ranks(simulation.communicator());
            let fits = memory.check(simulation.model(), present, step..step.saturating_add(next), sharing);
            let refused = simulation.communicator().all_reduce_sum(&[fits.is_err().into()])[0] > 0;
            if refused && step > first {
                self.save_distributed(&mut simulation, &mut files)?;
            }
            simulation.agree(fits)?;
            simulation.advance(next)?;
            pace.add_steps(simulation.model(), [&before, simulation.totals()], step..simulation.step_count());
            self.record_distributed(&mut simulation, &mut files)?;
            let due = |every: u32| simulation.step_count().is_multiple_of(every);
            if self.scenario.output.checkpoint_every.is_some_and(due) {
                self.save_distributed(&mut simulation, &mut files)?;
            }
            stops = asks(&mut simulation);
        }
        if simulation.step_count() > first {
            self.save_distributed(&mut simulation, &mut files)?;
        }
        let converted = files.as_ref().map_or(Ok(()), |files| files.convert(simulation.model()));
        simulation.agree(converted)?;
        if is_first {
            let warnings = pace.warnings(simulation.model()).into_iter().chain(simulation.request_warnings());
            warnings.for_each(|message| log::warn!("{message}"));
        }
        let is_finished = simulation.step_count() >= self.scenario.steps;
        Ok((if is_finished { RunEnd::Finished } else { RunEnd::Stopped }, simulation))
    }

    fn shared(&self) -> Settings {
        let Scenario { steps, output, .. } = &self.scenario;
        Settings::new(env!("CARGO_PKG_VERSION"))
            .with("resume", self.resume)
            .with("steps", steps)
            .with("output", format_args!("{output:?}"))
            .with("directory", self.directory.display())
    }

    fn begin_distributed<C: Communicator>(
        &self,
        communicator: C,
        detector: Config,
    ) -> Result<(RankSimulation<C>, Option<Files>), C::Error> {
        let Scenario { model, seed, .. } = &self.scenario;
        let is_first = communicator.rank() == 0;
        let sharing = Sharing::over_ranks(&communicator);
        agree(&communicator, check_largest_release(model, self.scenario.steps, sharing))?;
        let mut simulation = RankSimulation::new(communicator, model.clone(), *seed, detector)?;
        let standing = simulation.gather(GatherFields::default())?;
        let files = is_first.then(|| self.create_files(&standing, ReplicaSlot::NONE)).transpose();
        let mut files = simulation.agree(files)?;
        self.record_distributed(&mut simulation, &mut files)?;
        self.save_distributed(&mut simulation, &mut files)?;
        Ok((simulation, files))
    }

    fn resume_distributed<C: Communicator>(
        &self,
        communicator: C,
        detector: Config,
    ) -> Result<(RankSimulation<C>, Option<Files>), C::Error> {
        let scenario = &self.scenario;
        let path = self.checkpoint_path();
        let slice = RankSlice::new(communicator.rank(), communicator.ranks());
        let is_first = communicator.rank() == 0;
        let lock = agree(&communicator, is_first.then(|| self.lock()).transpose())?;
        let read = || {
            let checkpoint = Checkpoint::read(&path)?;
            self.check_continues(&path, &checkpoint)?;
            let (records, backend) = (checkpoint.files.clone(), checkpoint.backend.clone());
            Ok((records, backend, checkpoint.into_slice(&path, slice)?))
        };
        let (records, backend, state) = agree(&communicator, read())?;
        let mut simulation =
            RankSimulation::resume(communicator, scenario.model.clone(), scenario.seed, detector, state)?;
        if is_first && backend != simulation.backend().name() {
            self.warn_of_backends(simulation.step_count(), &backend, simulation.backend());
        }
        let standing = simulation.gather(GatherFields::default())?;
        let reopen = |lock: Lock| {
            self.check_disk_space(&standing, ReplicaSlot::NONE)?;
            let step_count = standing.step_count();
            let run =
                WrittenRun { model: &scenario.model, seed: scenario.seed, records: &records, step_count };
            Files::reopen(&self.directory, scenario.output, run, lock)
        };
        let files = lock.map(reopen).transpose();
        let files = simulation.agree(files)?;
        Ok((simulation, files))
    }

    fn record_distributed<C: Communicator>(
        &self,
        simulation: &mut RankSimulation<C>,
        files: &mut Option<Files>,
    ) -> Result<(), C::Error> {
        let (step, output) = (simulation.step_count(), self.scenario.output);
        let fields = GatherFields {
            received: step.is_multiple_of(output.every),
            particles: output.has_frame(step)
                || output.animated(step).is_some()
                || step.is_multiple_of(output.every) && occupancy::is_logged(simulation.model()),
        };
        if fields == GatherFields::default() && !simulation.model().logs_arrivals {
            return Ok(());
        }
        let standing = simulation.gather(fields)?;
        let record = |files: &mut Files| {
            // The checkpoint includes this step.
            let is_full = step > 0 && self.is_disk_full(&standing, ReplicaSlot::NONE)?;
            files.record(&standing).map(|()| !is_full)
        };
        let written = files.as_mut().map(record).transpose();
        let is_full = simulation.agree(written)? == Some(false);
        if simulation.communicator().all_reduce_sum(&[is_full.into()])[0] == 0 {
            return Ok(());
        }
        self.save_distributed(simulation, files)?;
        simulation.agree(Err(self.stopped_early(step)))
    }

    fn save_distributed<C: Communicator>(
        &self,
        simulation: &mut RankSimulation<C>,
        files: &mut Option<Files>,
    ) -> Result<(), C::Error> {
        let path = self.checkpoint_path();
        let (rank, ranks) = (simulation.communicator().rank(), simulation.communicator().ranks());
        let written = simulation
            .rank_state()
            .and_then(|state| Checkpoint::write_part(&path, self.scenario.seed, rank, ranks, &state));
        let record = simulation.agree(written)?;
        let parts = gather(simulation.communicator(), "the records of checkpoints", &[record])?;
        let (backend, state) = (simulation.backend(), simulation.without_particles());
        let write = |files: &mut Files| {
            let mut checkpoint = self.checkpoint(backend, files.sync()?, state);
            checkpoint.parts = parts;
            checkpoint.write(&path)
        };
        let written = files.as_mut().map_or(Ok(()), write);
        simulation.agree(written)
    }
}
