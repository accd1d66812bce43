//! The `lazygrid-mpi` command: overlapping pairs of the spheres in a file, and runs of the simulator, by many ranks.

mod command;

use std::io::{self, Write};
use std::process::ExitCode;

use clap::Parser;
use clap::error::ErrorKind;
use mpi::traits::Communicator;

use crate::command::args::{Args, Command};

fn main() -> ExitCode {
    let parsed = Args::try_parse();
    let Some((universe, _)) = mpi::initialize_with_threading(mpi::Threading::Funneled) else {
        say("error: MPI is running already");
        return ExitCode::FAILURE;
    };
    let world = universe.world();
    lazygrid_mpi::abort_on_panic();
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    let is_first = world.rank() == 0;
    let args = match parsed {
        Ok(args) => args,
        Err(usage) => {
            // All ranks were told the same.
            if is_first {
                // Where nobody listens nobody can be told.
                let _ = usage.print();
            }
            let asked = matches!(usage.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
            return if asked { ExitCode::SUCCESS } else { ExitCode::from(2) };
        }
    };
    let done = match args.command {
        Command::Detect(args) => command::detect(&world, &args),
        Command::Scale(args) => command::scale(&world, &args),
        Command::Simulate(args) => command::simulate(&world, &args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if is_first {
                say(&format!("error: {error}"));
            }
            ExitCode::FAILURE
        }
    }
}

/// Says something on standard error; where that is closed nobody can be told.
fn say(text: &str) {
    let _ = writeln!(io::stderr(), "{text}");
}
