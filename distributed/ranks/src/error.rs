use thiserror::Error;

/// The cause of a refusal. Every message names the value, the limit and the remedy.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// Planes of a partition into another number of parts, or along no axis.
    #[error("{planes} planes cut space into {} parts, not {parts}; use the planes of one partition", *planes + 1)]
    Planes {
        /// The number of planes.
        planes: usize,
        /// The requested number of parts.
        parts: u32,
    },
    /// A message limit below one element per rank.
    #[error(
        "a limit of {limit} elements per message is below the {ranks} ranks that share each message; raise the limit"
    )]
    MessageLimit {
        /// The limit, in elements.
        limit: u64,
        /// The number of ranks.
        ranks: u32,
    },
}
