use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

use lazygrid::gpu::GpuError;
use thiserror::Error;

/// Why the command did not do what it was asked for.
#[derive(Debug, Error)]
pub(crate) enum Failure {
    #[error(transparent)]
    File(#[from] lazygrid_io::Error),
    #[error("{}, frame {frame}: {source}{}", path.display(), remedy(source))]
    Detection { path: PathBuf, frame: usize, source: lazygrid::Error },
    #[error(transparent)]
    Setting(lazygrid::Error),
    #[error("{}: there is no frame {frame}; frames are counted from 0 and the file has {frames}", path.display())]
    NoFrame { path: PathBuf, frame: usize, frames: usize },
    #[error("{}: the file has no frame", path.display())]
    Empty { path: PathBuf },
    #[error(
        "{}: the file has several frames but --output is one file, which was not written; write {{frame}} in its \
         name, as in pairs-{{frame}}.npy, or choose a frame with --frame",
        path.display()
    )]
    SeveralFrames { path: PathBuf },
    #[error("no memory for {spheres} spheres; generate fewer")]
    NoMemory { spheres: u64 },
    #[error("calibration failed: {0}")]
    Calibration(GpuError),
    #[error("there is no place for the calibration; set HOME, or XDG_CACHE_HOME to a directory")]
    NoCacheDirectory,
    #[error(transparent)]
    Simulation(#[from] lazygrid_sim::Error),
    #[error("cannot listen for Ctrl-C: {0}")]
    Signal(ctrlc::Error),
    #[error("stopped after {steps} steps; go on with: lazygrid simulate {} --output {} --resume", scenario.display(), directory.display())]
    Stopped { steps: u32, scenario: PathBuf, directory: PathBuf },
    #[error("cannot write to standard output: {0}")]
    Stdout(io::Error),
}

impl Failure {
    /// 2 where the options contradict each other, which no other input would mend; 130, as shells say of Ctrl-C, after
    /// that and other requests to end; else 1.
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Stopped { .. } => ExitCode::from(130),
            Self::Setting(lazygrid::Error::NotOnBackend { .. }) => ExitCode::from(2),
            _ => ExitCode::FAILURE,
        }
    }
}

/// What the engine's remedies are called here.
fn remedy(error: &lazygrid::Error) -> &'static str {
    match error {
        lazygrid::Error::Host(lazygrid_host::Error::TooManyPairs { .. }) => {
            " (--count, --output without --neighbors, or --max-pairs)"
        }
        _ => "",
    }
}
