use lazygrid::gpu::GpuDevice;
use lazygrid::{Algorithm, Backend};

use crate::adapter::or_skip;
use crate::{Subject, THREADS};

/// The GPU's subjects, one for each algorithm; `Auto` takes one of them. None where there is no adapter.
pub(crate) fn subjects() -> Vec<Subject> {
    let subject = |algorithm| Subject { backend: Backend::Gpu, algorithm, threads: THREADS[0] };
    or_skip(GpuDevice::shared(true)).map_or_else(Vec::new, |_| Algorithm::GPU.map(subject).to_vec())
}
