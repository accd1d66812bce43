//! The `lazygrid` command: overlapping pairs of the spheres in a file.

mod args;
mod cache;
mod calibrate;
mod check;
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
    quiet_wayland();
    let args = Args::parse();
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    let result = match args.command {
        Command::Detect(args) => signals::end_cleanly().and_then(|()| detect::run(&args)),
        Command::Generate(args) => signals::end_cleanly().and_then(|()| generate::run(&args)),
        Command::Simulate(args) => simulate::run(&args),
        Command::Devices => devices::run(),
        Command::Calibrate { adapter } => calibrate::run(adapter.as_ref()),
        Command::Check(args) => signals::end_cleanly().and_then(|()| check::run(&args)),
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

/// Keeps libwayland from complaining on standard error, as if the complaint were ours, where there is no run-time
/// directory: it says so when Mesa's layer that chooses a device asks for a compositor, and wgpu lets it ask.
fn quiet_wayland() {
    const RUNTIME_DIRECTORY: &str = "XDG_RUNTIME_DIR";
    let missing = !std::env::var_os(RUNTIME_DIRECTORY)
        .is_some_and(|directory| std::path::Path::new(&directory).is_absolute());
    if cfg!(target_os = "linux") && missing {
        // Nothing can lie below it, so no compositor is found there, as before.
        // SAFETY: `main` has just begun. No thread has been started, by this program or by a library that is loaded
        // with it, so nobody reads or writes the environment at the same time.
        unsafe { std::env::set_var(RUNTIME_DIRECTORY, "/dev/null") };
    }
}

/// Writes to standard output at once, so that a pipe sees each result when it is there.
fn print(text: impl AsRef<[u8]>) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_ref()).and_then(|()| out.flush()).map_err(Failure::Stdout)
}
