use lazygrid::gpu::GpuDevice;
use lazygrid::{Algorithm, Backend};

use crate::adapter::or_skip;
use crate::{Subject, THREADS};

/// Opens a new device. If no adapter exists, returns `None` and prints that the test is skipped.
///
/// # Panics
/// Panics if no adapter exists but `LAZYGRID_REQUIRE_GPU` is set.
pub fn device() -> Option<GpuDevice> {
    or_skip(GpuDevice::open(true))
}

/// The GPU variants, one for each algorithm except `Auto`. Empty if no adapter exists.
pub(crate) fn subjects() -> Vec<Subject> {
    let subject = |algorithm| Subject { backend: Backend::Gpu, algorithm, threads: THREADS[0] };
    or_skip(GpuDevice::shared(true))
        .map_or_else(Vec::new, |_| Algorithm::GPU.iter().copied().map(subject).collect())
}
