//! Checkpoints after failed steps of a GPU, which a CPU can resume.

use lazygrid::Backend;

use super::Run;
use crate::output::Files;
use crate::{AnySimulation, Error, RunView};

impl Run {
    /// Saves the steps before a failed one if a GPU still has their state, and returns the error with the remedy. On the
    /// CPU, a failed step leaves a state within it. `recorded` and `saved` are the steps of the last output and checkpoint.
    pub(super) fn after_failed_step(
        &self,
        error: Error,
        (simulation, files): (&AnySimulation, &mut Files),
        [recorded, mut saved]: [u32; 2],
    ) -> Error {
        if simulation.backend() == Backend::Cpu {
            return error;
        }
        let done = simulation.step_count();
        if done > saved {
            match self.record_and_save(simulation, files, done > recorded) {
                Ok(()) => saved = done,
                Err(unsaved) => log::warn!("the {done} steps done have no checkpoint: {unsaved}"),
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
