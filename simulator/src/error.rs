use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// An invalid model, or the end of a run.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    #[error("{}, line {line}, `{key}`: {message}", path.display())]
    Scenario { path: PathBuf, line: usize, key: String, message: String },
    #[error("{0}")]
    Model(String),
    #[error(
        "particle ids are exhausted: {released} particles need one each, and ids have 32 bits; release fewer, or run \
         fewer steps"
    )]
    OutOfIds { released: u64 },
    #[error("no memory for {particles} particles: {bytes} bytes were refused; release fewer")]
    OutOfMemory {
        particles: u64,
        /// In one column.
        bytes: u64,
    },
    #[error(
        "no memory for {candidates} pairs that may react: {bytes} bytes were refused; release fewer particles, or run fewer \
         replicas at once (--threads)"
    )]
    OutOfCandidateMemory { candidates: u64, bytes: u64 },
    #[error(
        "{what} need {needed} bytes of memory or more, and {available} bytes are available ({limit}); {remedy}"
    )]
    TooLittleMemory {
        what: String,
        needed: u64,
        available: u64,
        /// Limit that determines `available`.
        limit: &'static str,
        remedy: &'static str,
    },
    #[error("step {step}: {source}")]
    Step {
        /// Step, from 0.
        step: u32,
        source: lazygrid::Error,
    },
    #[error(
        "step {step}: {particles} particles collided {collisions} times in one step; shorten the time step, or let contact = \"count\" only count overlaps"
    )]
    Collisions {
        /// Step, from 0.
        step: u32,
        particles: u64,
        /// Collisions at which the step stopped.
        collisions: u64,
    },
    #[error(
        "step {step}: a particle moves up to {path_length:.3e} µm in one step, and collisions are followed over {limit:.3e} µm at most, \
         {searches} times the distance that one search for neighbors covers; shorten the time step, or let contact = \"count\" \
         only count overlaps"
    )]
    LongPaths {
        /// Step, from 0.
        step: u32,
        /// In µm.
        path_length: f64,
        /// In µm.
        limit: f64,
        /// Largest number of searches for neighbors in a step.
        searches: u32,
    },
    /// A step that a GPU cannot do.
    #[error("{source}; --resume --backend cpu continues from the checkpoint of step {step}")]
    StoppedOnGpu {
        /// Steps of the checkpoint.
        step: u32,
        source: Box<Error>,
    },
    #[error(transparent)]
    Detection(#[from] lazygrid::Error),
    #[error(
        "an earlier call failed after steps were submitted to the GPU ({reason}); resume from an earlier state"
    )]
    UnknownState {
        /// Error of that call.
        reason: String,
    },
    #[error("the GPU backend does not support {what}; choose the CPU")]
    NotOnGpu { what: String },
    #[error("{algorithm} searches on the CPU and has no effect with the gpu backend; omit one of them")]
    AlgorithmOnGpu { algorithm: lazygrid::Algorithm },
    #[error(
        "step {step}: {particles} particles have non-finite positions; shorten the time step or weaken the drift"
    )]
    NotFinite {
        /// Step, from 0.
        step: u32,
        particles: u64,
    },
    #[error("this build cannot write Arrow files; build it with --features arrow, or write the log as CSV")]
    NoArrow,
    #[error("{}: cannot read: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{}: cannot write: {source}", path.display())]
    Write { path: PathBuf, source: io::Error },
    #[error("replica {replica}: {source}")]
    Replica {
        /// Replica, from 0.
        replica: u32,
        source: Box<Error>,
    },
    #[error("{values}: {source}")]
    SweepPoint { values: String, source: Box<Error> },
    #[error(
        "{}: the checkpoint has version {found} and this build reads version {expected}; resume it with the build that \
         wrote it, or start over with --overwrite in place of --resume",
        path.display()
    )]
    CheckpointVersion { path: PathBuf, found: u32, expected: u32 },
    /// A damaged file of a run to resume. No file was changed.
    #[error(
        "{}: the file is damaged: {damage}; restore it from a copy, or start over with --overwrite in place of --resume",
        path.display()
    )]
    Damaged { path: PathBuf, damage: Damage },
    #[error("{}: {message}", path.display())]
    Checkpoint { path: PathBuf, message: String },
}

/// The damage of a file.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Damage {
    #[error("it does not begin with the line '{expected}'")]
    Header {
        /// Required beginning of the line.
        expected: String,
    },
    #[error("it has {found} bytes instead of {expected}")]
    Length { found: u64, expected: u64 },
    #[error("its checksum is {found:016x} instead of {expected:016x}")]
    Checksum { found: u64, expected: u64 },
    #[error("it belongs to another checkpoint, since its checksum is {found:016x} and not {expected:016x}")]
    Foreign { found: u64, expected: u64 },
    #[error("its content cannot be decoded ({0})")]
    Content(String),
}
