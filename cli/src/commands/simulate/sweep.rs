use std::ops::ControlFlow;

use lazygrid_results::animation;
use lazygrid_results::mean::MeanSeries;
use lazygrid_results::sweep::{SweepRow, write};
use lazygrid_sim::run::RunEnd;
use lazygrid_sim::run::sweep::SweepRuns;

use super::replicas::{StepProgress, report_input};
use super::{command, report};
use crate::args::Simulate;
use crate::error::CliError;
use crate::signals::StopSignal;
use crate::{print, progress, signals};

pub(crate) fn run(sweep: &SweepRuns, args: &Simulate) -> Result<(), CliError> {
    let stop_signal = signals::install_stop_handler()?;
    let runs = || sweep.points.iter().map(|point| u64::from(point.count.get()));
    let steps =
        sweep.points.iter().zip(runs()).map(|(point, runs)| runs * u64::from(point.run.scenario.steps));
    let step_progress = StepProgress::new(progress::running(steps.fold(0, u64::saturating_add)));
    let is_cancelled = || stop_signal.signal().is_some();
    let results = sweep.run(is_cancelled, |point, replica, simulation| {
        step_progress.see(point, replica, simulation);
        if is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    step_progress.bar.finish_and_clear();
    let stopped = |done: usize| {
        let signal = stop_signal.signal().unwrap_or(StopSignal::CTRL_C);
        let command = command::resume_command(args, &sweep.directory, true);
        Err(CliError::StoppedRuns { done, count: runs().sum(), runs: "runs", command, signal })
    };
    let Some(mut results) = results else { return stopped(0) };
    let (mut rows, mut responses) = (Vec::new(), Vec::new());
    for ((point, values), results) in sweep.points.iter().zip(&sweep.values).zip(&mut results) {
        let mean = MeanSeries::from_replicas(point, results)?;
        if point.directory_of(0).exists() {
            animation::write(&point.replica(0))?;
        }
        let scenario = point.run.directory.join("scenario.toml");
        let input = report_input(args, point, &scenario, results, &mean);
        let channels = match args.report && !input.runs.is_empty() {
            true => report::write(&input)?,
            false => report::channels(&input)?,
        };
        rows.push(SweepRow::new(values.clone(), &point.run.scenario.model, &mean, &channels));
        responses.push(channels.responses);
    }
    let keys: Vec<String> = sweep.keys.iter().map(|key| key.path.clone()).collect();
    lazygrid_sim::write_atomically(&sweep.directory.join("sweep.csv"), |out| write(out, &keys, &rows))?;
    if args.report {
        report::sweep::write(sweep, &rows, &responses)?;
    }
    let finished: usize = results.iter().map(|results| results.finished.len()).sum();
    let printed = print(summary(sweep, &rows, finished));
    match results.iter().all(|results| results.end == RunEnd::Finished) {
        true => printed,
        false => stopped(finished),
    }
}

fn summary(sweep: &SweepRuns, rows: &[SweepRow], finished: usize) -> String {
    let mut lines = vec![format!("sweep      {} points, {finished} runs done", rows.len())];
    for (k, row) in rows.iter().enumerate() {
        let values = sweep.keys.iter().zip(&row.values).map(|(key, value)| format!("{} = {value}", key.path));
        let values = values.collect::<Vec<_>>().join(", ");
        lines.push(format!("point {k:<5}{values}: {} of {} replicas", row.replicas, sweep.points[k].count));
    }
    lines.push(format!("table      {}", sweep.directory.join("sweep.csv").display()));
    lines.join("\n") + "\n"
}
