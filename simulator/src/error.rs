use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// The reason for which a model was refused or a run ended.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// An invalid scenario file.
    #[error("{}, line {line}, `{key}`: {message}", path.display())]
    Scenario {
        /// The file.
        path: PathBuf,
        /// The line; the first is 1.
        line: usize,
        /// The key on that line.
        key: String,
        /// The fault and the valid values.
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
        /// The number that there would have been.
        released: u64,
    },
    /// The system refused memory for more particles.
    #[error("no memory for {particles} particles: {bytes} bytes were refused; release fewer")]
    OutOfMemory {
        /// The number that there would have been.
        particles: u64,
        /// The bytes of one of their columns.
        bytes: u64,
    },
    /// The system refused memory for candidates of reactions.
    #[error(
        "no memory for {candidates} pairs that may react: {bytes} bytes were refused; release fewer particles, or run fewer \
         replicas at once (--threads)"
    )]
    OutOfCandidateMemory {
        /// The number of candidates.
        candidates: u64,
        /// Their bytes.
        bytes: u64,
    },
    /// The particles of a step would not fit into the available memory.
    #[error(
        "{particles} particles need {needed} bytes of memory or more, and {available} bytes are available ({limit}); release \
         fewer particles, run fewer replicas at once (--threads), or raise the limit"
    )]
    TooLittleMemory {
        /// The number of particles.
        particles: u64,
        /// The bytes that they need.
        needed: u64,
        /// The bytes that are available.
        available: u64,
        /// The limit that leaves them.
        limit: &'static str,
    },
    /// The detector refused the particles, or found more pairs than fit.
    #[error("step {step}: {source}")]
    Step {
        /// The step, counted from 0.
        step: u32,
        /// The message of the detector.
        source: lazygrid::Error,
    },
    #[error(
        "step {step}: {particles} particles collided {collisions} times in one step; shorten the time step, or let contact = \"count\" only count overlaps"
    )]
    /// Particles collided too often in a step.
    Collisions {
        /// The step, counted from 0.
        step: u32,
        /// The number of particles.
        particles: u64,
        /// The number of collisions at which the step was given up.
        collisions: u64,
    },
    /// The detector could not be made.
    #[error(transparent)]
    Detection(#[from] lazygrid::Error),
    /// A model with something that the GPU back end cannot do.
    #[error("the GPU back end cannot do {what}; choose the CPU")]
    NotOnGpu {
        /// The refused part of the model, and its owner.
        what: String,
    },
    /// A model with something that a run over several ranks cannot do.
    #[error("a run over ranks cannot do {what}; run it in one process, with `lazygrid simulate`")]
    NotOverRanks {
        /// The refused part of the model.
        what: String,
    },
    /// Particles went beyond the range of numbers on the GPU.
    #[error(
        "step {step}: {particles} particles are at no finite place; shorten the time step or weaken the drift"
    )]
    NotFinite {
        /// The step, counted from 0.
        step: u32,
        /// Their number.
        particles: u64,
    },
    /// Arrow files were asked for, and this build has no writer of them.
    #[error("this build cannot write Arrow files; build it with --features arrow, or take the log as CSV")]
    NoArrow,
    /// The threads that were asked for could not be started.
    #[error("cannot start {threads} threads: {reason}; ask for fewer")]
    Threads {
        /// The requested number.
        threads: usize,
        /// The message of the system.
        reason: String,
    },
    /// The system refused to read a file.
    #[error("{}: cannot read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The message of the system.
        source: io::Error,
    },
    /// The system refused to create or write a file, such as on a full disk.
    #[error("{}: cannot write: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The message of the system.
        source: io::Error,
    },
    /// One of several replicas could not be done.
    #[error("replica {replica}: {source}")]
    Replica {
        /// The number of the replica, counted from 0.
        replica: u32,
        /// The reason.
        source: Box<Error>,
    },
    /// A combination of a sweep that is no valid scenario, or a run of it that failed.
    #[error("{values}: {source}")]
    SweepPoint {
        /// The keys and their values.
        values: String,
        /// The cause.
        source: Box<Error>,
    },
    /// A checkpoint of another version of the layout.
    #[error(
        "{}: the checkpoint has version {found} and this build reads version {expected}; resume it with the build that \
         wrote it, or start over with --overwrite in place of --resume",
        path.display()
    )]
    CheckpointVersion {
        /// The file.
        path: PathBuf,
        /// The version of the file.
        found: u32,
        /// The version that this build reads.
        expected: u32,
    },
    /// A file that a run was to resume from and that is not as it was written. The run has changed no file.
    #[error(
        "{}: the file is damaged: {damage}; restore it from a copy, or start over with --overwrite in place of --resume",
        path.display()
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The difference from the file that was written.
        damage: Damage,
    },
    /// A checkpoint of another run, such as one of another scenario.
    #[error("{}: {message}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// The reason for which the run cannot be resumed from it.
        message: String,
    },
}

/// The difference of a damaged file from the file that was written.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Damage {
    /// The first line is not that of such a file.
    #[error("it does not begin with the line '{expected}'")]
    Header {
        /// The line that it must begin with.
        expected: String,
    },
    /// The file has another length, or is shorter than the part of it that the checkpoint names.
    #[error("it has {found} bytes instead of {expected}")]
    Length {
        /// The length of the file.
        found: u64,
        /// The length that was written.
        expected: u64,
    },
    /// The bytes are not those that were written.
    #[error("its checksum is {found:016x} instead of {expected:016x}")]
    Checksum {
        /// The checksum of the bytes.
        found: u64,
        /// The checksum that was written.
        expected: u64,
    },
    /// The file is whole, and is not the one that the checkpoint names.
    #[error("it belongs to another checkpoint, since its checksum is {found:016x} and not {expected:016x}")]
    Foreign {
        /// The checksum of the file.
        found: u64,
        /// The checksum in the checkpoint.
        expected: u64,
    },
    /// The checksum is right, and the content makes no sense.
    #[error("its content cannot be decoded ({0})")]
    Content(String),
}
