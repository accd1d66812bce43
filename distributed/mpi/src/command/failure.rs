use lazygrid_mpi::Error;
use thiserror::Error as DeriveError;

/// The failure of a command, equal on all ranks.
#[derive(Debug, DeriveError)]
pub(crate) enum Failure {
    #[error(transparent)]
    Run(#[from] Error),
    /// Contradicting options.
    #[error(transparent)]
    Usage(Error),
    #[error("stopped after {steps} steps; continue with --resume")]
    Stopped { steps: u32, signal: i32 },
}

impl Failure {
    /// The codes of `lazygrid`: 2 for wrong usage, 128 plus the signal that stopped a run, else 1.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::Run(Error::Setting { .. } | Error::Settings { .. }) => 2,
            Self::Run(_) => 1,
            Self::Stopped { signal, .. } => 128 + (*signal & 0x7F) as u8,
        }
    }
}
