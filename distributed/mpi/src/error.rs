use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Equal on all ranks.
#[derive(Clone, Debug, Error, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
#[allow(missing_docs, reason = "messages explain the fields")]
pub enum Error {
    #[error("rank {rank}: {message}")]
    Input {
        rank: u32,
        /// First invalid sphere, if any.
        index: Option<u32>,
        message: String,
    },
    #[error(
        "duplicate id {id}: sphere {} on rank {} and sphere {} on rank {}; give each sphere of all ranks its own id",
        first[1], first[0], second[1], second[0]
    )]
    DuplicateId {
        /// Smallest such id.
        id: u64,
        first: [u32; 2],
        second: [u32; 2],
    },
    #[error("{name} = {value} is out of range; {range}")]
    Setting { name: String, value: String, range: String },
    #[error("{message}")]
    Settings {
        name: String,
        /// Rank 0, and the first that differs from it.
        ranks: [u32; 2],
        message: String,
    },
    #[error(
        "rank {rank}: no memory for {what}: {bytes} bytes were refused; use more nodes or fewer ranks on each, or \
         count or stream the pairs"
    )]
    OutOfMemory { rank: u32, what: String, bytes: u64 },
    /// Nothing was truncated.
    #[error(
        "rank {rank}: {found} pairs are more than the limit of {limit} for the list of a rank; count or stream them, \
         use more ranks, or raise `max_pairs`"
    )]
    TooManyPairs { rank: u32, found: u64, limit: u64 },
    #[error("rank {rank}: {message}")]
    Detection { rank: u32, message: String },
    #[error("{what}: {needed} bytes are more than the {limit} that one message can carry; use fewer ranks")]
    Message {
        what: String,
        /// In bytes.
        needed: u64,
        /// In bytes.
        limit: u64,
    },
}

impl Error {
    pub(crate) fn from_detector(rank: u32, error: lazygrid::Error) -> Self {
        match error {
            lazygrid::Error::OutOfMemory { what, bytes } => {
                Self::OutOfMemory { rank, what: what.to_owned(), bytes }
            }
            error => Self::Detection { rank, message: error.to_string() },
        }
    }
}
