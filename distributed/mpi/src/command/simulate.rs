use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use lazygrid_mpi::{agree, threads};
use lazygrid_sim::run::{Run, RunEnd};
use log::LevelFilter;
use mpi::collective::SystemOperation;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};

use crate::command::args::Simulate;
use crate::command::{Failure, print, refused};

/// Collective.
pub(crate) fn simulate(world: &SimpleCommunicator, args: &Simulate) -> Result<(), Failure> {
    let say = |error: &dyn std::fmt::Display| refused(world, error.to_string());
    let run = agree(world, read(world, args).map_err(|error| say(&error)))?;
    // Collective, so ranks with `--threads` call it, too.
    let default_threads = threads(world);
    let threads = args.threads.map_or(default_threads, Into::into);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    let signal_number =
        pool.map_err(|error| say(&error)).and_then(|()| signals().map_err(|error| say(&error)));
    let signal_number = agree(world, signal_number)?;
    let result = lazygrid_mpi::simulate(world, &run, |_| match signal_number.load(Ordering::Relaxed) {
        0 => ControlFlow::Continue(()),
        _ => ControlFlow::Break(()),
    })?;
    let animated = (world.rank() == 0).then(|| lazygrid_results::animation::write(&run)).transpose();
    agree(world, animated.map_err(|error| say(&error)))?;
    if world.rank() == 0 {
        print(world, &result.summary)?;
    }
    match result.end {
        RunEnd::Finished => Ok(()),
        RunEnd::Stopped => {
            // Not every rank need have received it.
            let (local, mut signal) = (signal_number.load(Ordering::Relaxed) as i32, 0);
            world.all_reduce_into(&local, &mut signal, SystemOperation::max());
            Err(Failure::Stopped { steps: result.steps, signal })
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

/// Returns the number of the signal that asks to stop, or 0.
fn signals() -> std::io::Result<Arc<AtomicUsize>> {
    let signal_number = Arc::new(AtomicUsize::new(0));
    #[cfg(unix)]
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register_usize(signal, Arc::clone(&signal_number), signal as usize)?;
    }
    Ok(signal_number)
}
