use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use lazygrid::{Algorithm, Backend};
use lazygrid_mpi::{Error, agree, threads};
use lazygrid_sim::run::{End, Run};
use lazygrid_sim::scenario::{Changes, Scenario};
use log::LevelFilter;
use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;

use crate::command::args::Simulate;
use crate::command::{print, refused};

/// Collective, as all of the command: every rank returns the same.
pub(crate) fn simulate(world: &SimpleCommunicator, args: &Simulate) -> Result<(), Error> {
    let say = |error: &dyn std::fmt::Display| refused(world, error.to_string());
    let scenario = read(world, args).map_err(|error| say(&error));
    let run = agree(world, scenario.map(|scenario| run(scenario, args)))?;
    let threads = args.threads.map_or_else(|| threads(world), Into::into);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    let asked = pool.map_err(|error| say(&error)).and_then(|()| signals().map_err(|error| say(&error)));
    let asked = agree(world, asked)?;
    let done = lazygrid_mpi::simulate(world, &run, |_| match asked.load(Ordering::Relaxed) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    })?;
    if world.rank() == 0 {
        print(world, &done.summary)?;
    }
    match done.end {
        End::Finished => Ok(()),
        End::Stopped => {
            Err(refused(world, format!("stopped after {} steps; go on with --resume", done.steps)))
        }
    }
}

/// Every rank reads the scenario, and the first says what there is to say of it.
fn read(world: &SimpleCommunicator, args: &Simulate) -> Result<Scenario, lazygrid_sim::Error> {
    let level = log::max_level();
    if world.rank() != 0 {
        log::set_max_level(LevelFilter::Off);
    }
    let scenario = Scenario::read(&args.scenario);
    log::set_max_level(level);
    scenario
}

fn run(mut scenario: Scenario, args: &Simulate) -> Run {
    scenario.change(&Changes {
        seed: args.seed,
        steps: args.steps,
        every: args.every,
        frames_every: args.frames_every,
        checkpoint_every: args.checkpoint_every,
        animated: args.animate.then_some(args.animate_particles),
        animate_every: args.animate_every,
    });
    Run {
        scenario,
        path: args.scenario.clone(),
        directory: args.output.clone().unwrap_or_else(|| Run::directory_of(&args.scenario)),
        backend: Backend::Cpu,
        algorithm: Algorithm::Auto,
        threads: None,
        resume: args.resume,
        overwrite: args.overwrite,
        space_check: !args.no_space_check,
    }
}

/// From here on a signal to end asks the run to stop, with a checkpoint.
fn signals() -> std::io::Result<Arc<AtomicBool>> {
    let asked = Arc::new(AtomicBool::new(false));
    #[cfg(unix)]
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&asked))?;
    }
    Ok(asked)
}
