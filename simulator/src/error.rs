use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// Why a model was refused or a run ended. Every message names the value, the limit and the remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A scenario file that does not say what it must, with the place.
    #[error("{}, line {line}, `{key}`: {message}", path.display())]
    Scenario {
        /// The file.
        path: PathBuf,
        /// The line; the first is 1.
        line: usize,
        /// The key on that line.
        key: String,
        /// What is wrong and what is allowed.
        message: String,
    },
    /// A model that cannot be run.
    #[error("{0}")]
    Model(String),
    /// More particles than ids can name.
    #[error(
        "particle ids are used up: {released} particles were released or came of others, and ids have 32 bits; release \
         fewer, or end the run before"
    )]
    OutOfIds {
        /// How many there would have been.
        released: u64,
    },
    /// The system refused memory for more particles.
    #[error("no memory for {particles} particles: {bytes} bytes were refused; release fewer")]
    OutOfMemory {
        /// How many there would have been.
        particles: u64,
        /// How many bytes one column of them takes.
        bytes: u64,
    },
    /// The detector refused the particles, or found more pairs than fit.
    #[error("step {step}: {source}")]
    Step {
        /// The step, counted from 0.
        step: u32,
        /// What the detector said.
        source: lazygrid::Error,
    },
    /// The detector could not be made.
    #[error(transparent)]
    Detection(#[from] lazygrid::Error),
    /// A model with something that the GPU back end cannot do.
    #[error("the GPU back end cannot do {what}; choose the CPU")]
    NotOnGpu {
        /// What that is, and whose.
        what: String,
    },
    /// A model with something that a run over several ranks cannot do.
    #[error("a run over ranks cannot do {what}; run it in one process, with `lazygrid simulate`")]
    NotOverRanks {
        /// What that is.
        what: String,
    },
    /// Particles went beyond the range of numbers on the GPU.
    #[error(
        "step {step}: {particles} particles are at no finite place; shorten the time step or weaken the drift"
    )]
    NotFinite {
        /// The step, counted from 0.
        step: u32,
        /// How many they are.
        particles: u64,
    },
    /// Arrow files were asked for, and this build has no writer of them.
    #[error("this build cannot write Arrow files; build it with --features arrow, or take the log as CSV")]
    NoArrow,
    /// The threads that were asked for could not be started.
    #[error("cannot start {threads} threads: {reason}; ask for fewer")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What the system said.
        reason: String,
    },
    /// The system refused to read a file.
    #[error("{}: cannot read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The system refused to create or write a file, such as on a full disk.
    #[error("{}: cannot write: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// One of several replicas could not be done.
    #[error("replica {replica}: {source}")]
    Replica {
        /// Which, counted from 0.
        replica: u32,
        /// Why.
        source: Box<Error>,
    },
    /// A file that is no checkpoint, or one of another scenario or version.
    #[error("{}: {message}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// Why it cannot be continued from.
        message: String,
    },
}
