//! The `lazygrid` command as a library, for hosts that bring a command line of their own: [`run`].

mod args;
mod calibration_file;
mod commands;
mod error;
mod progress;
mod signals;

use std::error::Error as _;
use std::ffi::OsString;
use std::io::{self, Write};
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::{CommandFactory, Parser};

use crate::args::{Args, Command};
use crate::commands::{calibrate, check, detect, devices, generate, page, simulate};
use crate::error::CliError;

/// Runs the command of the arguments, of which the first is the program's name. Returns the exit code: 0 done, 1 bad
/// input or failure, 2 wrong usage, 128 plus the signal's number for a run that was stopped with a checkpoint.
///
/// Writes to standard output and standard error, listens for signals, and sets up the process's log.
pub fn run(args: impl IntoIterator<Item = OsString>) -> u8 {
    let args = match Args::try_parse_from(args) {
        Ok(args) => args,
        // Help and version are errors of the parser, too.
        Err(said) => {
            // No other stream is left for a failure of this one.
            let _ = said.print();
            return said.exit_code() as u8;
        }
    };
    let log = env_logger::Env::default().default_filter_or("warn");
    // A host may have a log already.
    let _ = env_logger::Builder::from_env(log).try_init();
    match command(args.command) {
        Ok(()) => 0,
        // The reader has read enough, as in `lazygrid … | head -1`.
        Err(CliError::Stdout(error) | CliError::File(lazygrid_io::Error::Write { source: error, .. }))
            if error.kind() == io::ErrorKind::BrokenPipe =>
        {
            0
        }
        Err(failure) => {
            // No other stream is left if standard error is closed.
            let _ = writeln!(io::stderr(), "error: {failure}");
            failure.exit_code()
        }
    }
}

fn command(command: Command) -> Result<(), CliError> {
    match command {
        Command::Detect(args) => {
            start_threads(args.threads)?;
            signals::install_cleanup_handler()?;
            detect::run(&args)
        }
        Command::Generate(args) => signals::install_cleanup_handler().and_then(|()| generate::run(&args)),
        Command::Simulate(args) => {
            start_threads(args.threads)?;
            simulate::run(&args)
        }
        Command::Devices => devices::run(),
        Command::Calibrate { adapter } => calibrate::run(adapter.as_ref()),
        Command::Check(args) => {
            start_threads(None)?;
            signals::install_cleanup_handler()?;
            check::run(&args)
        }
        Command::Page(args) => signals::install_cleanup_handler().and_then(|()| page::run(&args)),
        Command::Plan(args) => signals::install_cleanup_handler().and_then(|()| page::plan(&args)),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Args::command(), "lazygrid", &mut script);
            print(&script)
        }
    }
}

/// Starts the threads of the process, unless the command makes a pool of `threads` threads. Later rayon could not
/// report a refusal.
fn start_threads(threads: Option<NonZeroUsize>) -> Result<(), CliError> {
    if threads.is_some() {
        return Ok(());
    }
    match rayon::ThreadPoolBuilder::new().build_global() {
        // A host may have started them; then the error has no source.
        Err(error) if error.source().is_some() => Err(CliError::Threads(error)),
        _ => Ok(()),
    }
}

/// `true` if the process was started without a standard output.
static OUTPUT_IS_CLOSED: AtomicBool = AtomicBool::new(false);

/// Makes every later write to standard output an error, for a program that was started with a closed standard output,
/// which Rust replaces by /dev/null.
pub fn set_output_closed() {
    OUTPUT_IS_CLOSED.store(true, Ordering::Relaxed);
}

/// Fails if there is no standard output.
fn check_output() -> Result<(), CliError> {
    match OUTPUT_IS_CLOSED.load(Ordering::Relaxed) {
        true => Err(CliError::Stdout(io::Error::new(io::ErrorKind::NotConnected, "it is closed"))),
        false => Ok(()),
    }
}

/// Writes to standard output and flushes, so that a pipe gets each result at once.
fn print(text: impl AsRef<[u8]>) -> Result<(), CliError> {
    check_output()?;
    let mut out = io::stdout().lock();
    out.write_all(text.as_ref()).and_then(|()| out.flush()).map_err(CliError::Stdout)
}
