//! The `lazygrid-mpi` command.

mod command;

use std::io::{self, Write};
use std::process::ExitCode;

use clap::Parser;
use clap::error::ErrorKind;
use lazygrid_mpi::agree_on;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};

use crate::command::Failure;
use crate::command::args::{Args, Command};

fn main() -> ExitCode {
    let parsed = Args::try_parse().and_then(Args::checked);
    let Some((universe, _)) = mpi::initialize_with_threading(mpi::Threading::Funneled) else {
        say("error: MPI is running already");
        return ExitCode::FAILURE;
    };
    let world = universe.world();
    lazygrid_mpi::abort_on_panic();
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    let is_first = world.rank() == 0;
    let args = match all_parsed(&world, parsed) {
        Ok(args) => args,
        Err(code) => return code,
    };
    let agreed = agree_on(&world, &args.command.shared()).map_err(Failure::from);
    let result = agreed.and_then(|()| match args.command {
        Command::Detect(args) => command::detect(&world, &args),
        Command::BenchScaling(args) => command::bench_scaling(&world, &args),
        Command::Simulate(args) => command::simulate(&world, &args),
    });
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if is_first {
                say(&format!("error: {failure}"));
            }
            failure.exit_code().into()
        }
    }
}

/// Returns the exit code of all if a rank's arguments are invalid. Collective.
fn all_parsed(world: &SimpleCommunicator, parsed: Result<Args, clap::Error>) -> Result<Args, ExitCode> {
    let mut refused = vec![false; world.size() as usize];
    world.all_gather_into(&parsed.is_err(), &mut refused[..]);
    let Some(first) = refused.iter().position(|&refused| refused) else {
        return parsed.map_err(|_| ExitCode::from(2));
    };
    let is_first = world.rank() as usize == first;
    if let (Err(usage), true) = (&parsed, is_first) {
        let _ = usage.print();
    }
    if refused.iter().all(|&refused| refused) {
        let is_help =
            |usage: &clap::Error| matches!(usage.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
        let is_help = parsed.as_ref().err().is_some_and(is_help);
        return Err(if is_help { ExitCode::SUCCESS } else { ExitCode::from(2) });
    }
    if is_first {
        let other = refused.iter().position(|&refused| !refused).unwrap_or_default();
        say(&format!(
            "error: rank {first} has other arguments than rank {other}; give all ranks the same command and options"
        ));
    }
    Err(ExitCode::from(2))
}

fn say(text: &str) {
    let _ = writeln!(io::stderr(), "{text}");
}
