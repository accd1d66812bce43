mod command;
mod replicas;
mod report;
mod sweep;

use std::num::NonZeroU32;
use std::ops::ControlFlow;

use lazygrid_results::animation;
use lazygrid_sim::RunView;
use lazygrid_sim::run::replicas::Replicas;
use lazygrid_sim::run::run_args::RunArgs;
use lazygrid_sim::run::sweep::SweepRuns;
use lazygrid_sim::run::{Run, RunEnd};
use lazygrid_sim::scenario::{Scenario, Sweep};

use self::report::ReportInput;
use crate::args::{ArrivalsFormat, Simulate};
use crate::error::CliError;
use crate::signals::StopSignal;
use crate::{print, progress, signals};

pub(crate) fn run(args: &Simulate) -> Result<(), CliError> {
    if let Some(swept) = Sweep::read(&args.options.scenario, &args.sweep)? {
        check_keys(&swept, &args.options)?;
        args.options.warn_of_frames(swept.points.iter().map(|point| &point.scenario));
        let count = args.replicas.unwrap_or(NonZeroU32::MIN);
        let run = |scenario: &Scenario| with_options(args, args.options.run(scenario.clone()));
        return sweep::run(&SweepRuns::new(swept, run, count), args);
    }
    let run = with_options(args, args.options.read()?);
    match args.replicas {
        None => once(run, args),
        Some(count) => replicas::run(&Replicas { run, count }, args),
    }
}

/// Refuses options that would replace the values of a key in all points.
fn check_keys(swept: &Sweep, options: &RunArgs) -> Result<(), CliError> {
    let options_of_keys = [
        ("seed", "seed", options.seed.is_some()),
        ("steps", "steps", options.steps.is_some()),
        ("series-every", "output.every", options.series_every.is_some()),
        ("frames-every", "output.frames-every", options.frames_every.is_some()),
        ("checkpoint-every", "output.checkpoint-every", options.checkpoint_every.is_some()),
    ];
    let is_swept = |key: &str| swept.keys.iter().any(|swept| swept.path == key);
    match options_of_keys.into_iter().find(|&(_, key, is_given)| is_given && is_swept(key)) {
        Some((option, key, _)) => Err(CliError::SweptOption { option, key }),
        None => Ok(()),
    }
}

fn with_options(args: &Simulate, run: Run) -> Run {
    let Simulate { backend, algorithm, .. } = *args;
    let mut run = Run { backend, algorithm, threads: args.threads.map(Into::into), ..run };
    run.report = args.report.then_some(report::PLOTS);
    run.scenario.output.arrow = args.arrivals_format == ArrivalsFormat::Arrow;
    run
}

fn once(run: Run, args: &Simulate) -> Result<(), CliError> {
    let stop_signal = signals::install_stop_handler()?;
    let bar = progress::running(run.scenario.steps.into());
    let mut started = false;
    let (end, simulation) = run.run(|simulation| {
        if !started {
            started = true;
            // Steps of an earlier run must not count in the speed.
            bar.set_position(simulation.step_count().into());
            bar.reset_eta();
        }
        bar.set_position(simulation.step_count().into());
        let particles: u64 = simulation.totals().present.iter().sum();
        bar.set_message(format!("{particles} particles"));
        if stop_signal.signal().is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    bar.finish_and_clear();
    animation::write(&run)?;
    if args.report && end == RunEnd::Finished {
        let mean = report::mean_of_run(&run)?;
        let runs = vec![(run.scenario.seed, run.directory.clone())];
        let command = command::report_command(args, &run, &run.path, None);
        report::write(&ReportInput { run: &run, mean: &mean, runs, command })?;
    }
    let printed = print(run.summary(&simulation));
    match end {
        RunEnd::Finished => printed,
        RunEnd::Stopped => {
            let steps = simulation.step_count();
            let signal = stop_signal.signal().unwrap_or(StopSignal::CTRL_C);
            let command = command::resume_command(args, &run.directory, true);
            Err(CliError::Stopped { steps, command, signal })
        }
    }
}
