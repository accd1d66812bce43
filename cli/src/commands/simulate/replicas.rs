use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Mutex;

use indicatif::ProgressBar;
use lazygrid_results::animation;
use lazygrid_results::mean::MeanSeries;
use lazygrid_sim::run::RunEnd;
use lazygrid_sim::run::replicas::{ReplicaResults, Replicas, seed_of};
use lazygrid_sim::{AnySimulation, RunView};

use super::command;
use super::report::{self, ReportInput};
use crate::args::Simulate;
use crate::error::CliError;
use crate::signals::StopSignal;
use crate::{print, progress, signals};

pub(crate) fn run(replicas: &Replicas, args: &Simulate) -> Result<(), CliError> {
    let stop_signal = signals::install_stop_handler()?;
    let count = replicas.count.get();
    let step_progress =
        StepProgress::new(progress::running(u64::from(count) * u64::from(replicas.run.scenario.steps)));
    let is_cancelled = || stop_signal.signal().is_some();
    let replicated = replicas.run_unless(is_cancelled, |replica, simulation| {
        step_progress.see(0, replica, simulation);
        if is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    step_progress.bar.finish_and_clear();
    let stopped = |done: usize| {
        let signal = stop_signal.signal().unwrap_or(StopSignal::CTRL_C);
        let command = command::resume_command(args, &replicas.run.directory, replicas.is_begun());
        Err(CliError::StoppedRuns { done, count: count.into(), runs: "replicas", command, signal })
    };
    let Some(mut replicated) = replicated else { return stopped(0) };
    let mean = MeanSeries::from_replicas(replicas, &mut replicated)?;
    if replicas.directory_of(0).exists() {
        animation::write(&replicas.replica(0))?;
    }
    if args.report && !replicated.finished.is_empty() {
        report::write(&report_input(args, replicas, &replicas.run.path, &replicated, &mean))?;
    }
    let printed = print(summary(replicas, &replicated, &mean));
    match replicated.end {
        RunEnd::Finished => printed,
        RunEnd::Stopped => stopped(replicated.finished.len()),
    }
}

pub(crate) fn report_input<'a>(
    args: &Simulate,
    replicas: &'a Replicas,
    scenario: &Path,
    results: &ReplicaResults,
    mean: &'a MeanSeries,
) -> ReportInput<'a> {
    let run = &replicas.run;
    let seed_and_directory =
        |&replica: &u32| (seed_of(run.scenario.seed, replica), replicas.directory_of(replica));
    let command = command::report_command(args, run, scenario, Some(replicas.count));
    ReportInput { run, mean, runs: results.finished.iter().map(seed_and_directory).collect(), command }
}

pub(crate) struct StepProgress {
    pub(crate) bar: ProgressBar,
    steps: Mutex<BTreeMap<(usize, u32), u32>>,
}

impl StepProgress {
    pub(crate) fn new(bar: ProgressBar) -> Self {
        Self { bar, steps: Mutex::default() }
    }

    pub(crate) fn see(&self, point: usize, replica: u32, simulation: &AnySimulation) {
        let step = simulation.step_count();
        let Ok(mut steps) = self.steps.lock() else { return };
        match steps.insert((point, replica), step) {
            Some(before) => self.bar.inc(u64::from(step - before)),
            None if step > 0 => {
                self.bar.inc(step.into());
                self.bar.reset_eta();
            }
            None => self.bar.set_message(format!("replica {replica}")),
        }
    }
}

fn summary(replicas: &Replicas, replicated: &ReplicaResults, mean: &MeanSeries) -> String {
    let run = &replicas.run;
    let mut lines = vec![
        format!("replicas   {} of {} done", replicated.finished.len(), replicas.count),
        format!("seed       {}", run.scenario.seed),
    ];
    if let (Some(row), Some(step), Some(time)) =
        (mean.steps.len().checked_sub(1), mean.steps.last(), mean.times.last())
    {
        lines.push(format!("steps      {step} ({time} s)"));
        for (name, sample) in mean.names.iter().zip(mean.row(row)) {
            let error = sample.standard_error().map_or(String::new(), |error| format!(" ± {error:.3}"));
            lines.push(format!("mean       {name}: {:.3}{error}", sample.mean()));
        }
    }
    lines.push(format!("output     {}", run.directory.display()));
    lines.join("\n") + "\n"
}
