//! The `lazygrid` command: overlapping pairs of the spheres in a file.

mod args;
mod cache;
mod calibrate;
mod detect;
mod devices;
mod failure;
mod generate;
mod input;
mod progress;
mod search;
mod signals;
mod simulate;
mod summary;

use std::io::{self, Write};
use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use crate::args::{Args, Command};
use crate::failure::Failure;

fn main() -> ExitCode {
    let args = Args::parse();
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    let result = match args.command {
        Command::Detect(args) => signals::end_cleanly().and_then(|()| detect::run(&args)),
        Command::Generate(args) => signals::end_cleanly().and_then(|()| generate::run(&args)),
        Command::Simulate(args) => simulate::run(&args),
        Command::Devices => devices::run(),
        Command::Calibrate => calibrate::run(),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Args::command(), "lazygrid", &mut script);
            print(&script)
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever reads has read enough, as in `lazygrid … | head -1`.
        Err(Failure::Stdout(error) | Failure::File(lazygrid_io::Error::Write { source: error, .. }))
            if error.kind() == io::ErrorKind::BrokenPipe =>
        {
            ExitCode::SUCCESS
        }
        Err(failure) => {
            // Where standard error is closed nobody can be told.
            let _ = writeln!(io::stderr(), "error: {failure}");
            failure.exit_code()
        }
    }
}

/// Writes to standard output at once, so that a pipe sees each result when it is there.
fn print(text: impl AsRef<[u8]>) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_ref()).and_then(|()| out.flush()).map_err(Failure::Stdout)
}
