use lazygrid_kernels::{Algorithm, InputError};
use thiserror::Error;

/// Why the CPU path gave no result. Every message names the value, the limit and the remedy.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// The input is refused.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A list would hold more pairs than allowed. The count is exact; nothing was truncated.
    #[error(
        "{found} pairs are more than the limit of {limit} for a list; ask for the count only, stream the pairs \
         in chunks, or raise `max_pairs`"
    )]
    TooManyPairs {
        /// How many pairs there are.
        found: u64,
        /// The limit that was set.
        limit: u64,
    },
    /// The system refused memory.
    #[error("no memory for {what}: {bytes} bytes were refused; use fewer spheres or stream the pairs")]
    OutOfMemory {
        /// What it was for.
        what: &'static str,
        /// How many bytes were asked for.
        bytes: u64,
    },
    /// The algorithm runs on the GPU only.
    #[error(
        "{0} is a GPU algorithm; on the CPU choose auto, naive, hash-grid, array-grid, recursive-grid or cell-list"
    )]
    NotOnCpu(Algorithm),
    /// A setting outside its range.
    #[error("{name} = {value} is out of range; {range}")]
    Setting {
        /// Which setting.
        name: &'static str,
        /// Its value.
        value: String,
        /// What is allowed.
        range: &'static str,
    },
    /// The thread pool could not be made.
    #[error("could not start {threads} threads: {reason}; ask for fewer")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What the system said.
        reason: String,
    },
}
