use std::env;

use lazygrid::gpu::{GpuDevice, GpuError};
use lazygrid::{Algorithm, Backend};

use crate::{Subject, THREADS};

/// The algorithms that have GPU kernels. `Auto` takes one of them by the number of spheres alone.
const ALGORITHMS: [Algorithm; 2] = [Algorithm::Naive, Algorithm::ArrayGrid];

/// The GPU's subjects: none, with a word on standard error, where there is no adapter.
///
/// # Panics
/// Where there is none although `LAZYGRID_REQUIRE_GPU` is set, or where it cannot be used.
pub(crate) fn subjects() -> Vec<Subject> {
    match GpuDevice::shared(true) {
        Ok(_) => ALGORITHMS
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
