//! The `lazygrid` command as a library: [`run`].

mod args;
mod calibration_file;
mod commands;
mod error;
mod printer;
mod progress;
mod signals;

use std::ffi::OsString;
use std::io::{self, Write};
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::{CommandFactory, Parser};
use lazygrid_io::excerpt;

use crate::args::{Args, Command};
use crate::commands::{calibrate, check, detect, devices, generate, page, simulate};
use crate::error::CliError;

/// Runs a command and returns the exit code: 0 for success, 1 for bad input or a failure, 2 for wrong usage,
/// 128 plus the signal for a run stopped with a checkpoint.
///
/// The first argument is the program's name. Handles signals, and sets up the log.
pub fn run(args: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments: Vec<OsString> = args.into_iter().collect();
    let result = match Args::try_parse_from(&arguments) {
        Ok(args) => {
            let log = env_logger::Env::default().default_filter_or("warn");
            let _ = env_logger::Builder::from_env(log).try_init();
            command(args.command)
        }
        Err(usage) if !usage.use_stderr() => print_help(&usage),
        Err(usage) => {
            let text = usage.render().to_string();
            let _ = match with_short_arguments(&text, &arguments, 0) {
                Some(short) => write!(io::stderr(), "{short}"),
                None => usage.print(),
            };
            return usage.exit_code() as u8;
        }
    };
    match result {
        Ok(()) => 0,
        // The reader has read enough, as in `lazygrid … | head -1`.
        Err(CliError::Stdout(error) | CliError::File(lazygrid_io::Error::Write { source: error, .. }))
            if error.kind() == io::ErrorKind::BrokenPipe =>
        {
            0
        }
        Err(failure) => {
            let text = failure.to_string();
            let text = with_short_arguments(&text, &arguments, MAX_PATH_BYTES).unwrap_or(text);
            let _ = writeln!(io::stderr(), "error: {text}");
            failure.exit_code()
        }
    }
}

/// Longest path that systems accept (`PATH_MAX` of Linux).
const MAX_PATH_BYTES: usize = 4096;

/// Returns a message with [excerpts](excerpt) of quoted arguments above `longest` bytes; `None` if it quotes
/// none.
fn with_short_arguments(message: &str, args: &[OsString], longest: usize) -> Option<String> {
    let mut text = message.to_owned();
    for arg in args.iter().map(|arg| arg.to_string_lossy()).filter(|arg| arg.len() > longest) {
        let after_equals = arg.split_once('=').map(|(_, value)| value);
        // Form `-oVALUE`.
        let after_option = arg.strip_prefix('-').and_then(|rest| rest.get(1..));
        for quoted in [&*arg].into_iter().chain(after_option).chain(after_equals) {
            let short = excerpt(quoted.as_bytes());
            if short.len() < quoted.len() {
                text = text.replace(quoted, &short);
            }
        }
    }
    (text != message).then_some(text)
}

fn print_help(usage: &clap::Error) -> Result<(), CliError> {
    check_output()?;
    usage.print().and_then(|()| io::stdout().flush()).map_err(CliError::Stdout)
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

/// Starts the process's threads, as later rayon could not report a failure.
fn start_threads(threads: Option<NonZeroUsize>) -> Result<(), CliError> {
    match threads {
        Some(_) => Ok(()),
        None => lazygrid::start_threads().map_err(CliError::Threads),
    }
}

static OUTPUT_IS_CLOSED: AtomicBool = AtomicBool::new(false);

/// Makes writes to standard output fail, for a program that began with a closed one. Rust replaces it by
/// /dev/null.
pub fn set_output_closed() {
    OUTPUT_IS_CLOSED.store(true, Ordering::Relaxed);
}

fn check_output() -> Result<(), CliError> {
    match OUTPUT_IS_CLOSED.load(Ordering::Relaxed) {
        true => Err(CliError::Stdout(io::Error::new(io::ErrorKind::NotConnected, "it is closed"))),
        false => Ok(()),
    }
}

/// Flushes each result, for readers of a pipe.
fn print(text: impl AsRef<[u8]>) -> Result<(), CliError> {
    check_output()?;
    let mut out = io::stdout().lock();
    out.write_all(text.as_ref()).and_then(|()| out.flush()).map_err(CliError::Stdout)
}
