use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The failure of a call, which is the same on all ranks. Every message names the value, the limit and the remedy.
#[derive(Clone, Debug, Error, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Error {
    /// The input of one rank is refused.
    #[error("rank {rank}: {message}")]
    Input {
        /// The rank; the first, if there are several.
        rank: u32,
        /// The index of the first such sphere on the rank, if it is one sphere.
        index: Option<u32>,
        /// The fault and the remedy.
        message: String,
    },
    /// Two spheres have the same id.
    #[error(
        "duplicate id {id}: sphere {} on rank {} and sphere {} on rank {}; give each sphere of all ranks its own id",
        first[1], first[0], second[1], second[0]
    )]
    DuplicateId {
        /// The id; the smallest, if there are several.
        id: u64,
        /// Rank and index of one.
        first: [u32; 2],
        /// Rank and index of the other.
        second: [u32; 2],
    },
    /// A setting outside its range.
    #[error("{name} = {value} is out of range; {range}")]
    Setting { name: String, value: String, range: String },
    /// A setting is not the same on all ranks.
    #[error("{message}")]
    Settings {
        /// The name of the setting; the first, if several differ.
        name: String,
        /// Two ranks that have different values: rank 0, and the first that differs from it.
        ranks: [u32; 2],
        /// The values of these two ranks, the number of ranks that differ, and the remedy.
        message: String,
    },
    /// The system refused memory to one rank.
    #[error(
        "rank {rank}: no memory for {what}: {bytes} bytes were refused; use more nodes or fewer ranks on each, or \
         count or stream the pairs"
    )]
    OutOfMemory {
        rank: u32,
        /// The purpose of the memory.
        what: String,
        /// The requested bytes.
        bytes: u64,
    },
    /// The list of one rank would hold more pairs than allowed. Nothing was truncated.
    #[error(
        "rank {rank}: {found} pairs are more than the limit of {limit} for the list of a rank; count or stream them, \
         use more ranks, or raise `max_pairs`"
    )]
    TooManyPairs { rank: u32, found: u64, limit: u64 },
    /// The detector of one rank failed.
    #[error("rank {rank}: {message}")]
    Detection {
        rank: u32,
        /// The message of the detector.
        message: String,
    },
    /// More than one message can carry.
    #[error("{what}: {needed} bytes are more than the {limit} that one message can carry; use fewer ranks")]
    Message {
        /// The data that was to be sent.
        what: String,
        /// Its size in bytes.
        needed: u64,
        /// The limit in bytes.
        limit: u64,
    },
}

impl Error {
    pub(crate) fn of_detector(rank: u32, error: lazygrid::Error) -> Self {
        match error {
            lazygrid::Error::OutOfMemory { what, bytes } => {
                Self::OutOfMemory { rank, what: what.to_owned(), bytes }
            }
            error => Self::Detection { rank, message: error.to_string() },
        }
    }
}
