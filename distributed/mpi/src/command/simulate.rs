use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use lazygrid_mpi::{Error, agree, threads};
use lazygrid_sim::run::{Run, RunEnd};
use log::LevelFilter;
use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;

use crate::command::args::Simulate;
use crate::command::{print, refused};

/// Collective.
pub(crate) fn simulate(world: &SimpleCommunicator, args: &Simulate) -> Result<(), Error> {
    let say = |error: &dyn std::fmt::Display| refused(world, error.to_string());
    let run = agree(world, read(world, args).map_err(|error| say(&error)))?;
    // Collective, so ranks with `--threads` call it, too.
    let share = threads(world);
    let threads = args.threads.map_or(share, Into::into);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    let asked = pool.map_err(|error| say(&error)).and_then(|()| signals().map_err(|error| say(&error)));
    let asked = agree(world, asked)?;
    let done = lazygrid_mpi::simulate(world, &run, |_| match asked.load(Ordering::Relaxed) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    })?;
    let animated = (world.rank() == 0).then(|| lazygrid_results::animation::write(&run)).transpose();
    agree(world, animated.map_err(|error| say(&error)))?;
    if world.rank() == 0 {
        print(world, &done.summary)?;
    }
    match done.end {
        RunEnd::Finished => Ok(()),
        RunEnd::Stopped => {
            Err(refused(world, format!("stopped after {} steps; continue with --resume", done.steps)))
        }
    }
}

fn read(world: &SimpleCommunicator, args: &Simulate) -> Result<Run, lazygrid_sim::Error> {
    let level = log::max_level();
    if world.rank() != 0 {
        log::set_max_level(LevelFilter::Off);
    }
    let run = args.options.read();
    log::set_max_level(level);
    run.map(|run| Run { backend: args.backend, ..run })
}

fn signals() -> std::io::Result<Arc<AtomicBool>> {
    let asked = Arc::new(AtomicBool::new(false));
    #[cfg(unix)]
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&asked))?;
    }
    Ok(asked)
}
