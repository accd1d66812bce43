use lazygrid::Backend;

use super::{LastSteps, Run};
use crate::output::Files;
use crate::{AnySimulation, Error, RunView};

impl Run {
    /// Saves the steps before a failed one if a GPU still has their state, and returns the error with the remedy. On
    /// the CPU, a failed step leaves particles half moved.
    pub(super) fn after_failed_step(
        &self,
        error: Error,
        simulation: &AnySimulation,
        files: &mut Files,
        last: LastSteps,
    ) -> Error {
        if simulation.backend() == Backend::Cpu {
            return error;
        }
        let step_count = simulation.step_count();
        let mut saved = last.saved;
        if step_count > saved {
            match self.record_and_save(simulation, files, step_count > last.recorded) {
                Ok(()) => saved = step_count,
                Err(unsaved) => log::warn!("the {step_count} steps done have no checkpoint: {unsaved}"),
            }
        }
        match error {
            Error::Step { .. } => Error::StoppedOnGpu { step: saved, source: Box::new(error) },
            other => other,
        }
    }

    fn record_and_save(
        &self,
        simulation: &AnySimulation,
        files: &mut Files,
        is_unrecorded: bool,
    ) -> Result<(), Error> {
        if is_unrecorded {
            files.record(simulation)?;
        }
        self.save(simulation, files)
    }
}
