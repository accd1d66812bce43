use lazygrid::Backend;

use crate::output::{self, Files, WrittenRun};
use crate::run::checkpoint::Checkpoint;
use crate::run::memory_estimate::{Sharing, check_largest_release};
use crate::run::step_loop::OpenRun;
use crate::run::{ReplicaSlot, Run};
use crate::scenario::Scenario;
use crate::{AnySimulation, Error, Model, RunView, Totals};

/// A run of one process.
#[derive(Debug)]
pub(super) struct SingleRun<'a> {
    run: &'a Run,
    slot: ReplicaSlot,
    pub(super) simulation: AnySimulation,
    pub(super) files: Files,
}

impl<'a> SingleRun<'a> {
    pub(super) fn begin(run: &'a Run, slot: ReplicaSlot) -> Result<Self, Error> {
        let Scenario { model, seed, .. } = &run.scenario;
        check_largest_release(model, run.scenario.steps, slot.sharing())?;
        let simulation = AnySimulation::begin(model, *seed, run.backend, run.algorithm, None)?;
        let mut files = run.create_files(&simulation, slot)?;
        files.record(&simulation)?;
        let mut begun = Self { run, slot, simulation, files };
        begun.save()?;
        Ok(begun)
    }

    pub(super) fn resume(run: &'a Run, slot: ReplicaSlot) -> Result<Self, Error> {
        let path = run.checkpoint_path();
        let lock = run.lock()?;
        let checkpoint = Checkpoint::read(&path)?;
        run.check_continues(&path, &checkpoint)?;
        let Scenario { model, seed, steps, output, .. } = &run.scenario;
        let (backend, records) = (checkpoint.backend.clone(), checkpoint.files.clone());
        let state = checkpoint.into_state(&path)?;
        let step_count = state.step;
        let simulation = AnySimulation::begin(model, *seed, run.backend, run.algorithm, Some(state))?;
        if backend != simulation.backend().name() {
            run.warn_of_backends(step_count, &backend, simulation.backend());
        }
        run.check_disk_space(&simulation, slot)?;
        if let Some(plots) = run.report.filter(|_| step_count < *steps) {
            let former = output::refuse_foreign_page(&run.directory)?;
            output::refuse_foreign_files(&run.directory, &former, plots, &output::TABLES)?;
        }
        let written = WrittenRun { model, seed: *seed, records: &records, step_count };
        let files = Files::reopen(&run.directory, *output, written, lock)?;
        Ok(Self { run, slot, simulation, files })
    }

    /// Saves the steps before a failed one if a GPU still has their state, and returns the error with the remedy. On
    /// the CPU, a failed step leaves particles half moved.
    fn after_failed_step(&mut self, error: Error, recorded: u32, saved: u32) -> Error {
        if self.simulation.backend() == Backend::Cpu {
            return error;
        }
        let step_count = self.step_count();
        let mut last_saved = saved;
        if step_count > saved {
            match self.record_and_save(step_count > recorded) {
                Ok(()) => last_saved = step_count,
                Err(unsaved) => log::warn!("the {step_count} steps done have no checkpoint: {unsaved}"),
            }
        }
        match error {
            Error::Step { .. } => Error::StoppedOnGpu { step: last_saved, source: Box::new(error) },
            other => other,
        }
    }

    fn record_and_save(&mut self, is_unrecorded: bool) -> Result<(), Error> {
        if is_unrecorded {
            self.files.record(&self.simulation)?;
        }
        self.save()
    }
}

impl OpenRun for SingleRun<'_> {
    type Error = Error;

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
        self.slot.sharing()
    }

    fn request_warnings(&self) -> Vec<String> {
        self.simulation.request_warnings()
    }

    fn logs(&self) -> bool {
        self.slot.index == 0
    }

    fn is_any(&mut self, own: bool) -> bool {
        own
    }

    fn agree<T>(&self, result: Result<T, Error>) -> Result<T, Error> {
        result
    }

    fn advance(&mut self, max_steps: u32, saved: u32) -> Result<(), Error> {
        let recorded = self.step_count();
        let advanced = self.simulation.advance(max_steps);
        advanced.map_err(|error| self.after_failed_step(error, recorded, saved))
    }

    fn record(&mut self) -> Result<bool, Error> {
        // This output and a checkpoint need at most half of the required free space.
        let is_full = self.run.is_disk_full(&self.simulation, self.slot)?;
        self.files.record(&self.simulation)?;
        Ok(is_full)
    }

    fn save(&mut self) -> Result<(), Error> {
        let state = self.simulation.state()?.into_owned();
        let checkpoint = self.run.checkpoint(self.simulation.backend(), self.files.sync()?, state);
        checkpoint.write(&self.run.checkpoint_path())
    }
}
