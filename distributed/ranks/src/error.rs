use thiserror::Error;

#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "messages explain the fields")]
pub enum Error {
    #[error("{planes} planes cut space into {} domains, not {domains}; use the planes of one partition", *planes + 1)]
    Planes { planes: usize, domains: u32 },
    #[error(
        "a limit of {limit} elements per message is below the {ranks} ranks that share each message; raise the limit"
    )]
    MessageLimit { limit: u64, ranks: u32 },
}
