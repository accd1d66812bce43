use lazygrid_kernels::{Algorithm, InputError};
use thiserror::Error;

/// Why a call gave no result. Every message names the value, the limit and the remedy.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// The input is refused: not finite, a negative radius, lengths that differ, unknown species.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The CPU path refused a setting, found more pairs than a list may hold, or got no memory.
    #[error(transparent)]
    Host(lazygrid_host::Error),
    /// The GPU path failed, or the device cannot hold what was asked.
    #[error(transparent)]
    Gpu(crate::gpu::GpuError),
    /// The GPU was asked for by name and cannot be used. An explicit choice never falls back.
    #[error("the GPU backend is not available: {reason}; choose the `cpu` or `auto` backend")]
    GpuUnavailable {
        /// Why not.
        reason: String,
    },
    /// An adapter was named, and the CPU asked for.
    #[error("adapter '{adapter}' and the cpu backend were asked for together; leave one of them out")]
    AdapterOnCpu {
        /// The adapter that was named.
        adapter: String,
    },
    /// The algorithm does not run on the backend.
    #[error("{algorithm} does not run on the {backend} backend; choose `auto`")]
    NotOnBackend {
        /// The algorithm asked for.
        algorithm: Algorithm,
        /// The backend asked for.
        backend: crate::Backend,
    },
}

impl From<lazygrid_host::Error> for Error {
    fn from(error: lazygrid_host::Error) -> Self {
        match error {
            lazygrid_host::Error::Input(input) => Self::Input(input),
            other => Self::Host(other),
        }
    }
}
