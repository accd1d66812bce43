use thiserror::Error;

/// The cause of a refusal. Every message names the value, the limit and the remedy.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// Splits that belong to another number of parts.
    #[error("{splits} splits make {} parts and not {parts}; take those of the same partition", *splits + 1)]
    Splits {
        /// The number of splits.
        splits: usize,
        /// The parts that were asked for.
        parts: u32,
    },
    /// A limit of messages that does not let one element through.
    #[error(
        "a limit of {limit} elements per message is below the {ranks} ranks that each message is shared among; \
         raise it"
    )]
    MessageLimit {
        /// The limit that was given, in elements.
        limit: u64,
        /// The number of ranks.
        ranks: u32,
    },
}
