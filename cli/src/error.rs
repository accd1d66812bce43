use std::io;
use std::path::PathBuf;

use lazygrid_io::scenes::Scene;
use thiserror::Error;

#[cfg(unix)]
pub(crate) type SignalError = std::io::Error;
#[cfg(not(unix))]
pub(crate) type SignalError = ctrlc::Error;

#[derive(Debug, Error)]
pub(crate) enum CliError {
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
    #[error("{}: this is the input {}, which the output would replace; choose another --output", output.display(), input.display())]
    OutputIsInput { input: PathBuf, output: PathBuf },
    #[error(
        "{}: unknown output format; use .csv, .npy or --output-format",
        path.display()
    )]
    OutputFormat { path: PathBuf },
    #[error("{}: {{frame}} cannot be replaced in a name that is not UTF-8; rename the output", path.display())]
    NumberedName { path: PathBuf },
    #[error(
        "--tilt: {name} is {tilt}, but space is unbounded along {axis}; use 0, or give a length along {axis} with --periodic"
    )]
    TiltOfUnboundedAxis { name: &'static str, tilt: f64, axis: &'static str },
    #[error("--timeout limits searches on a GPU and has no effect with --backend cpu; omit one of them")]
    TimeoutOnCpu,
    #[error(
        "neighbor lists as NumPy arrays are several files, but standard output is one; use --output-format csv"
    )]
    NeighborsToStdout,
    #[error("{0}")]
    RadiusTwice(String),
    #[error("{}, frame {frame}: two spheres have the id {id}, so --ids cannot tell them apart; omit --ids", path.display())]
    IdTwice { path: PathBuf, frame: usize, id: i64 },
    #[error("{}, frame {frame}: no memory to sort {spheres} spheres by id; omit --ids, or split the file", path.display())]
    NoMemoryToSort { path: PathBuf, frame: usize, spheres: usize },
    #[error("{}, frame {frame}: {reason}; with --ids the numbers are ids", path.display())]
    Excluded { path: PathBuf, frame: usize, reason: Box<lazygrid::Error> },
    #[error("{}: no memory for {pairs} pairs; list fewer", path.display())]
    NoMemoryForPairs { path: PathBuf, pairs: usize },
    #[error("no memory for {spheres} spheres; generate fewer")]
    NoMemory { spheres: u64 },
    #[error(
        "the scene {scene} has no transceivers; leave --transceivers and --size-ratio out, or generate transceivers"
    )]
    NoTransceivers { scene: Scene },
    #[error(
        "--transceivers {transceivers} of {spheres} spheres are more than there are; ask for fewer, or raise -n"
    )]
    TooManyTransceivers { transceivers: u32, spheres: u64 },
    #[error("calibration failed: {0}")]
    Calibration(lazygrid::Error),
    #[error("no directory for the calibration; set HOME, or XDG_CACHE_HOME to a directory")]
    NoCacheDirectory,
    #[error(transparent)]
    Simulation(#[from] lazygrid_sim::Error),
    #[error("{failures} checks failed; the command below each failure repeats it")]
    Wrong { failures: usize },
    #[error("{0} with --threads, or raise the limit of processes")]
    Threads(lazygrid::Error),
    #[error(
        "{}, frame {frame}: {spheres} spheres need about {needed} bytes of memory, and {available} bytes are available ({limit}); \
         split the file{remedy}, or raise the limit",
        path.display()
    )]
    TooLittleMemory {
        path: PathBuf,
        frame: usize,
        spheres: usize,
        needed: u64,
        available: u64,
        limit: &'static str,
        remedy: &'static str,
    },
    #[error(
        "{spheres} spheres need {needed} bytes of memory, and {available} bytes are available ({limit}); generate fewer"
    )]
    TooLittleMemoryToGenerate { spheres: u64, needed: u64, available: u64, limit: &'static str },
    #[error(
        "{what} needs {needed} bytes of memory, and {available} bytes are available ({limit}); raise the limit, or end \
         other programs"
    )]
    TooLittleMemoryFor { what: &'static str, needed: u64, available: u64, limit: &'static str },
    #[error("cannot listen for Ctrl-C: {0}")]
    Signal(SignalError),
    #[cfg(unix)]
    #[error(
        "cannot start the thread that listens for Ctrl-C: {0}; raise the limit of processes or of memory"
    )]
    SignalThread(io::Error),
    #[error("stopped after {steps} steps; resume with: {command}")]
    Stopped { steps: u32, command: String, signal: i32 },
    #[error("stopped with {done} of {count} {runs} done; resume with: {command}")]
    StoppedRuns { done: usize, count: u64, runs: &'static str, command: String, signal: i32 },
    #[error("--{option} would replace the values of {key} in the sweep; give one of the two")]
    SweptOption { option: &'static str, key: &'static str },
    #[error("{}: cannot be drawn: {reason}", path.display())]
    Report { path: PathBuf, reason: String },
    #[error("the page cannot be made: {what}")]
    Page { what: String },
    #[error("cannot write JSON: {0}")]
    Json(serde_json::Error),
    #[error("cannot write to standard output: {0}")]
    Stdout(io::Error),
}

impl CliError {
    /// 2 for contradicting options; 128 plus the signal after Ctrl-C or SIGTERM; else 1.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::Stopped { signal, .. } | Self::StoppedRuns { signal, .. } => 128 + (*signal & 0x7F) as u8,
            Self::Setting(
                lazygrid::Error::InvalidSetting { .. }
                | lazygrid::Error::NotOnBackend { .. }
                | lazygrid::Error::AdapterOnCpu { .. },
            )
            | Self::Simulation(lazygrid_sim::Error::AlgorithmOnGpu { .. })
            | Self::OutputIsInput { .. }
            | Self::SweptOption { .. }
            | Self::OutputFormat { .. }
            | Self::NumberedName { .. }
            | Self::TiltOfUnboundedAxis { .. }
            | Self::TimeoutOnCpu
            | Self::NeighborsToStdout
            | Self::NoTransceivers { .. }
            | Self::TooManyTransceivers { .. }
            | Self::RadiusTwice(_) => 2,
            _ => 1,
        }
    }
}

fn remedy(error: &lazygrid::Error) -> &'static str {
    match error {
        lazygrid::Error::TooManyPairs { .. } => " (--count, --output without --neighbors, or --max-pairs)",
        lazygrid::Error::Timeout { .. } => " (--timeout)",
        _ => "",
    }
}
