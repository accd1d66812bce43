//! The `lazygrid` command as a library, for hosts that bring a command line of their own: [`run`].

mod args;
mod calibration_file;
mod commands;
mod error;
mod progress;
mod signals;

use std::ffi::OsString;
use std::io::{self, Write};

use clap::{CommandFactory, Parser};

use crate::args::{Args, Command};
use crate::commands::{calibrate, check, detect, devices, generate, page, simulate};
use crate::error::CliError;

/// Does what the arguments say, of which the first is the program's name, and returns the exit code: 0 done, 1 bad input
/// or failure, 2 wrong usage, 128 and the signal's number for a run that was stopped with a checkpoint.
///
/// Writes to standard output and standard error, listens for signals, and sets up the process's log.
pub fn run(args: impl IntoIterator<Item = OsString>) -> u8 {
    let args = match Args::try_parse_from(args) {
        Ok(args) => args,
        // Help and version are among them.
        Err(said) => {
            // Where the stream is closed nobody can be told.
            let _ = said.print();
            return said.exit_code() as u8;
        }
    };
    let log = env_logger::Env::default().default_filter_or("warn");
    // A host may have a log already.
    let _ = env_logger::Builder::from_env(log).try_init();
    match command(args.command) {
        Ok(()) => 0,
        // Whoever reads has read enough, as in `lazygrid … | head -1`.
        Err(CliError::Stdout(error) | CliError::File(lazygrid_io::Error::Write { source: error, .. }))
            if error.kind() == io::ErrorKind::BrokenPipe =>
        {
            0
        }
        Err(failure) => {
            // Where standard error is closed nobody can be told.
            let _ = writeln!(io::stderr(), "error: {failure}");
            failure.exit_code()
        }
    }
}

fn command(command: Command) -> Result<(), CliError> {
    match command {
        Command::Detect(args) => signals::install_cleanup_handler().and_then(|()| detect::run(&args)),
        Command::Generate(args) => signals::install_cleanup_handler().and_then(|()| generate::run(&args)),
        Command::Simulate(args) => simulate::run(&args),
        Command::Devices => devices::run(),
        Command::Calibrate { adapter } => calibrate::run(adapter.as_ref()),
        Command::Check(args) => signals::install_cleanup_handler().and_then(|()| check::run(&args)),
        Command::Page(args) => signals::install_cleanup_handler().and_then(|()| page::run(&args)),
        Command::Plan(args) => signals::install_cleanup_handler().and_then(|()| page::plan(&args)),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Args::command(), "lazygrid", &mut script);
            print(&script)
        }
    }
}

/// Writes to standard output at once, so that a pipe sees each result when it is there.
fn print(text: impl AsRef<[u8]>) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_ref()).and_then(|()| out.flush()).map_err(CliError::Stdout)
}
