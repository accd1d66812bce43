use std::ops::ControlFlow;

use crate::run::memory_estimate::{MemoryGuard, Sharing};
use crate::run::time_step_monitor::TimeStepMonitor;
use crate::run::{Run, RunEnd};
use crate::{Error, Model, Totals};

/// A begun or resumed run with its files. Over ranks, methods with `&mut self` and [`agree`](Self::agree) are
/// collective.
pub(crate) trait OpenRun {
    type Error;

    fn model(&self) -> &Model;

    fn step_count(&self) -> u32;

    fn totals(&self) -> &Totals;

    fn steps_at_once(&self) -> u32;

    fn sharing(&self) -> Sharing;

    fn request_warnings(&self) -> Vec<String>;

    /// Returns `true` for the process that logs messages of all.
    fn logs(&self) -> bool;

    /// Returns `true` if `own` is `true` on any rank.
    fn is_any(&mut self, own: bool) -> bool;

    /// Returns the error of one rank on all.
    fn agree<T>(&self, result: Result<T, Error>) -> Result<T, Self::Error>;

    /// Does up to `max_steps` steps. `saved` is the step of the last checkpoint.
    fn advance(&mut self, max_steps: u32, saved: u32) -> Result<(), Self::Error>;

    /// Writes the output of this step. Returns `true` if the next output and a checkpoint may exceed the disk.
    fn record(&mut self) -> Result<bool, Self::Error>;

    /// Writes a checkpoint.
    fn save(&mut self) -> Result<(), Self::Error>;
}

impl Run {
    /// Logs warnings and does all remaining steps, until `watch` breaks on any rank. Ends with a checkpoint.
    pub(crate) fn do_steps<R: OpenRun>(
        &self,
        run: &mut R,
        mut watch: impl FnMut(&R) -> ControlFlow<()>,
    ) -> Result<RunEnd, R::Error> {
        let steps = self.scenario.steps;
        let mut saved = run.step_count();
        let mut monitor = TimeStepMonitor::default();
        let mut memory = MemoryGuard::default();
        let mut is_stopped = watch(run).is_break();
        while !run.is_any(is_stopped) && run.step_count() < steps {
            let step = run.step_count();
            let before = TimeStepMonitor::reaction_totals(run.totals());
            let next = self.steps_to_next(step).min(run.steps_at_once());
            let present = run.totals().present.iter().sum();
            let fits = memory.check(run.model(), present, step..step.saturating_add(next), run.sharing());
            if step > saved && run.is_any(fits.is_err()) {
                run.save()?;
            }
            run.agree(fits)?;
            run.advance(next, saved)?;
            monitor.add_steps(run.model(), [&before, run.totals()], step..run.step_count());
            if run.record()? {
                run.save()?;
                return run.agree(Err(self.stopped_early(run.step_count())));
            }
            let due = |every: u32| run.step_count().is_multiple_of(every);
            if self.scenario.output.checkpoint_every.is_some_and(due) {
                run.save()?;
                saved = run.step_count();
            }
            is_stopped = watch(run).is_break();
        }
        if run.step_count() > saved {
            run.save()?;
        }
        if run.logs() {
            let warnings = monitor.warnings(run.model()).into_iter().chain(run.request_warnings());
            warnings.for_each(|message| log::warn!("{message}"));
        }
        Ok(if run.step_count() < steps { RunEnd::Stopped } else { RunEnd::Finished })
    }
}
