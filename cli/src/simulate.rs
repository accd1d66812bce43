mod replicas;
mod report;

use std::ops::ControlFlow;

use lazygrid_sim::Standing;
use lazygrid_sim::replicas::Replicas;
use lazygrid_sim::run::{End, Run};
use lazygrid_sim::scenario::{Changes, Scenario};

use self::report::Done;
use crate::args::{ArrivalsFormat, Simulate};
use crate::failure::Failure;
use crate::signals::Asked;
use crate::{print, progress, signals};

/// Runs a scenario and says what came of it.
pub(crate) fn run(args: &Simulate) -> Result<(), Failure> {
    let mut scenario = Scenario::read(&args.scenario)?;
    scenario.change(&Changes {
        seed: args.seed,
        steps: args.steps,
        every: args.every,
        frames_every: args.frames_every,
        checkpoint_every: args.checkpoint_every,
        animated: args.animate.then_some(args.animate_particles),
        animate_every: args.animate_every,
    });
    scenario.output.arrow = args.arrivals_format == ArrivalsFormat::Arrow;
    let directory = args.output.clone().unwrap_or_else(|| Run::directory_of(&args.scenario));
    let run = Run {
        scenario,
        path: args.scenario.clone(),
        directory,
        backend: args.backend,
        algorithm: args.algorithm,
        threads: args.threads.map(Into::into),
        resume: args.resume,
        overwrite: args.overwrite,
        space_check: !args.no_space_check,
    };
    match args.replicas {
        None => once(run, args.report),
        Some(count) => replicas::run(Replicas { run, count }, args.report),
    }
}

/// Does one run.
fn once(run: Run, reports: bool) -> Result<(), Failure> {
    let asked = signals::ask_to_stop()?;
    let bar = progress::running(run.scenario.steps.into());
    let mut started = false;
    let (end, simulation) = run.run(|simulation| {
        if !started {
            started = true;
            // What an earlier run did is no part of this one's speed.
            bar.set_position(simulation.step_count().into());
            bar.reset_eta();
        }
        bar.set_position(simulation.step_count().into());
        let particles: u64 = simulation.totals().present.iter().sum();
        bar.set_message(format!("{particles} particles"));
        if asked.signal().is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    bar.finish_and_clear();
    if reports && end == End::Finished {
        let mean = report::of_one(&run)?;
        let runs = vec![(run.scenario.seed, run.directory.clone())];
        report::write(&Done { run: &run, mean: &mean, runs, command: report::command(&run) })?;
    }
    print(run.summary(&simulation))?;
    match end {
        End::Finished => Ok(()),
        End::Stopped => {
            let steps = simulation.step_count();
            let signal = asked.signal().unwrap_or(Asked::CTRL_C);
            Err(Failure::Stopped { steps, scenario: run.path, directory: run.directory, signal })
        }
    }
}
