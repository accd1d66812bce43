use std::env;

use lazygrid::gpu::{GpuDevice, GpuError};
use lazygrid::{Algorithm, Backend};

use crate::{Subject, THREADS};

/// The GPU's subjects, one for each algorithm; `Auto` takes one of them. None, with a word on standard error, where there is no adapter.
///
/// # Panics
/// Where there is none although `LAZYGRID_REQUIRE_GPU` is set, or where it cannot be used.
pub(crate) fn subjects() -> Vec<Subject> {
    match GpuDevice::shared(true) {
        Ok(_) => Algorithm::GPU
            .map(|algorithm| Subject { backend: Backend::Gpu, algorithm, threads: THREADS[0] })
            .to_vec(),
        Err(error @ GpuError::NoAdapter { .. }) if env::var_os("LAZYGRID_REQUIRE_GPU").is_none() => {
            #[expect(clippy::print_stderr, reason = "a skipped test says why")]
            {
                eprintln!("without the GPU: {error}");
            }
            Vec::new()
        }
        Err(error) => panic!("{error}"),
    }
}
