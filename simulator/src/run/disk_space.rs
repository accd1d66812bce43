use super::{ReplicaSlot, Run};
use crate::output::options::Output;
use crate::output::{self, DiskEstimate, LOGGED_ARRIVALS, LOGGED_STEPS, occupancy};
use crate::scenario::Scenario;
use crate::{Error, RunView};

/// Rows of the series between checks.
const ROWS_PER_CHECK: u32 = 4096;

impl Run {
    /// Includes files of later replicas.
    pub(crate) fn check_disk_space(&self, simulation: &impl RunView, slot: ReplicaSlot) -> Result<(), Error> {
        if !self.space_check {
            return Ok(());
        }
        self.check_fits(self.disk_estimate(simulation).times(slot.count - slot.index))
    }

    pub(super) fn disk_estimate(&self, simulation: &impl RunView) -> DiskEstimate {
        let Scenario { steps, output, text, .. } = &self.scenario;
        DiskEstimate::new(simulation, *output, *steps, text)
    }

    /// Warns if the output may exceed the disk, refuses if it does.
    pub(super) fn check_fits(&self, estimate: DiskEstimate) -> Result<(), Error> {
        let DiskEstimate { min_bytes, max_bytes, checkpoint } = estimate;
        let free = self.free_disk_bytes()?;
        let [needed, enough] =
            [min_bytes.saturating_add(checkpoint[0]), max_bytes.saturating_add(checkpoint[1])];
        if needed <= free && enough > free {
            log::warn!(
                "the run writes up to about {} MB, and the disk has {} MB left; it stops with a checkpoint before the disk \
                 is full",
                max_bytes >> 20,
                free >> 20
            );
        }
        if needed <= free {
            return Ok(());
        }
        Err(self.disk_full_error(format!(
            "the run is going to write about {} MB and the disk has {} MB left; write frames less often, choose another \
             directory, or try all the same with --no-space-check",
            min_bytes >> 20,
            free >> 20
        )))
    }

    fn free_disk_bytes(&self) -> Result<u64, Error> {
        let write = |source| Error::Write { path: self.directory.clone(), source };
        fs4::available_space(&self.directory).map_err(write)
    }

    pub(crate) fn stopped_early(&self, steps: u32) -> Error {
        self.disk_full_error(format!(
            "it stopped after {steps} steps with a checkpoint, before the disk is full; make room and continue with --resume \
             (--no-space-check continues until the disk is full)"
        ))
    }

    fn disk_full_error(&self, message: String) -> Error {
        let source = std::io::Error::new(std::io::ErrorKind::StorageFull, message);
        Error::Write { path: self.directory.clone(), source }
    }

    /// Returns `true` if the next output and a checkpoint may exceed the disk.
    pub(crate) fn is_disk_full(&self, simulation: &impl RunView, slot: ReplicaSlot) -> Result<bool, Error> {
        let output = self.scenario.output;
        if !self.space_check || !is_check_due(simulation, output) {
            return Ok(false);
        }
        Ok(self.free_disk_bytes()? < 2 * u64::from(slot.at_once) * output::next_bytes(simulation, output))
    }
}

fn is_check_due(simulation: &impl RunView, output: Output) -> bool {
    let (step, model) = (simulation.step_count(), simulation.model());
    if output.has_frame(step) || output.animated(step).is_some() {
        return true;
    }
    step.is_multiple_of(output.every.saturating_mul(ROWS_PER_CHECK))
        || model.logs_arrivals && (step.is_multiple_of(LOGGED_STEPS) || has_logged_many(simulation))
        || occupancy::is_logged(model) && step.is_multiple_of(output.every)
}

/// Returns `true` once per [`LOGGED_ARRIVALS`] arrivals.
fn has_logged_many(simulation: &impl RunView) -> bool {
    let receivers = simulation.model().receivers.iter().zip(&simulation.totals().arrived);
    let counts = receivers.filter(|(receiver, _)| !receiver.is_momentary()).flat_map(|(_, counts)| counts);
    let [logged, last] = [counts.sum(), simulation.arrivals().len() as u64];
    logged / LOGGED_ARRIVALS != logged.saturating_sub(last) / LOGGED_ARRIVALS
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::path::Path;

    use super::*;
    use crate::run::RunEnd;
    use crate::scenario::Scenario;

    fn run(steps: u32, output: &str, directory: &Path) -> Run {
        let text = format!(
            "time-step = 0.01\nsteps = {steps}\n[[species]]\nname = 'A'\n\
             [[transmitter]]\nname = 'tx'\nrelease = [{{ species = 'A', rate = 1e5 }}]\n\
             [[receiver]]\nname = 'rx'\nradius = 1\ncenter = [0, 0, 0]\nkind = 'endpoint'\n[output]\n{output}"
        );
        Run::new(Scenario::parse(Path::new("s.toml"), text).unwrap(), "s.toml", directory.join("out"))
    }

    #[test]
    fn disk_is_checked_after_many_arrivals() {
        let directory = tempfile::tempdir().unwrap();
        let run = run(40, "every = 100000\narrivals = true\n", directory.path());
        let (mut checked, mut reserved) = (Vec::new(), 0);
        run.run(|simulation| {
            if is_check_due(simulation, run.scenario.output) {
                checked.push((simulation.step_count(), simulation.totals().arrived[0][0]));
            }
            reserved = output::next_bytes(simulation, run.scenario.output);
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(checked[0], (0, 0));
        let arrived: Vec<u64> = checked[1..].iter().map(|&(_, arrived)| arrived / 1000).collect();
        assert_eq!(arrived, [16, 32]);
        let written = std::fs::metadata(run.directory.join("arrivals.csv")).unwrap().len();
        let until_next = written * (LOGGED_ARRIVALS + 1000) / 40_000;
        assert!(reserved > until_next && reserved < 3 * until_next, "{reserved}, {until_next} needed");
    }

    #[test]
    fn run_that_loses_its_particles_needs_no_space_for_all() {
        let directory = tempfile::tempdir().unwrap();
        let run = run(4_000_000_000, "every = 4000000000\n", directory.path());
        let (end, simulation) = run
            .run(|simulation| match simulation.step_count() < 3 {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            })
            .unwrap();
        assert_eq!((end, simulation.totals().present[0]), (RunEnd::Stopped, 1));
    }

    /// No disk is large enough for `u32::MAX` simultaneous runs.
    #[test]
    fn run_that_stops_for_the_disk_resumes_with_the_same_files() {
        let directory = tempfile::tempdir().unwrap();
        let whole = run(30, "every = 9\nframes = ['xyz']\narrivals = true\n", directory.path());
        whole.run(|_| ControlFlow::Continue(())).unwrap();
        let mut stopped = Run { directory: directory.path().join("stopped"), ..whole.clone() };
        let slot = ReplicaSlot { at_once: u32::MAX, ..ReplicaSlot::NONE };
        let error = stopped.run_here(slot, |_| ControlFlow::Continue(())).unwrap_err().to_string();
        assert!(error.contains("stopped after 9 steps"), "{error}");
        stopped.resume = true;
        stopped.run(|_| ControlFlow::Continue(())).unwrap();
        for name in ["series.csv", "frames.xyz", "arrivals.csv", "releases.csv"] {
            let [expected, found] =
                [&whole, &stopped].map(|run| std::fs::read_to_string(run.directory.join(name)).unwrap());
            assert!(found == expected, "{name}: {} and {} bytes", found.len(), expected.len());
        }
    }
}
