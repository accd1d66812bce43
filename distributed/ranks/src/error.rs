use thiserror::Error;

/// An error, with value, limit and remedy.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// Planes that make no partition of this size, or along no axis.
    #[error("{planes} planes cut space into {} parts, not {parts}; use the planes of one partition", *planes + 1)]
    Planes {
        /// Number of planes.
        planes: usize,
        /// Requested parts.
        parts: u32,
    },
    /// A message limit below one element per rank.
    #[error(
        "a limit of {limit} elements per message is below the {ranks} ranks that share each message; raise the limit"
    )]
    MessageLimit {
        /// Limit in elements.
        limit: u64,
        /// Number of ranks.
        ranks: u32,
    },
}
