use lazygrid::gpu::GpuDevice;
use lazygrid::{Algorithm, Backend};

use crate::adapter::or_skip;
use crate::{Subject, THREADS};

/// A device of one's own. None where there is no adapter, and a word on standard error.
///
/// # Panics
/// Where there is none although `LAZYGRID_REQUIRE_GPU` is set.
pub fn device() -> Option<GpuDevice> {
    or_skip(GpuDevice::open(true))
}

/// The GPU's subjects, one for each algorithm; `Auto` takes one of them. None where there is no adapter.
pub(crate) fn subjects() -> Vec<Subject> {
    let subject = |algorithm| Subject { backend: Backend::Gpu, algorithm, threads: THREADS[0] };
    or_skip(GpuDevice::shared(true)).map_or_else(Vec::new, |_| Algorithm::GPU.map(subject).to_vec())
}
