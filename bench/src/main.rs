//! The `lazygrid-bench` command.

mod command {
    pub(crate) mod args;
    pub(crate) mod compare;
    pub(crate) mod failure;
    pub(crate) mod figures;
    pub(crate) mod gpu_results;
    pub(crate) mod invocation;
    pub(crate) mod kernels;
}

use std::io::{self, Write};
use std::process::ExitCode;

use clap::Parser;

use crate::command::args::{Args, Command};
use crate::command::failure::Failure;
use crate::command::{compare, figures, gpu_results, kernels};

fn main() -> ExitCode {
    let args = Args::parse();
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    let result = match args.command {
        Command::Figures(args) => figures::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::GpuResults(args) => gpu_results::run(&args),
        Command::Kernels(args) => kernels::run(&args),
        Command::MeasureMemory(args) => figures::measure_memory(&args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // The reader has closed the pipe, as in `lazygrid-bench … | head -1`.
        Err(Failure::Stdout(error)) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(failure) => {
            let _ = writeln!(io::stderr(), "error: {failure}");
            ExitCode::FAILURE
        }
    }
}

/// Flushes each result, for readers of a pipe.
fn print(text: impl AsRef<[u8]>) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_ref()).and_then(|()| out.flush()).map_err(Failure::Stdout)
}
