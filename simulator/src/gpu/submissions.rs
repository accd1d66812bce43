use lazygrid::gpu::{GpuDetector, GpuDevice, GpuSpheres, wgpu};

use super::device::{refused, with_error_scope};
use crate::Error;

/// Moved particles and pairs per submission: far below a watchdog's limit.
pub(super) const MAX_WORK: u64 = 1 << 24;

#[derive(Debug)]
pub(super) struct Submissions {
    gpu: GpuDevice,
    encoder: wgpu::CommandEncoder,
    work: u64,
    has_submitted: bool,
}

impl Submissions {
    pub(super) fn new(gpu: GpuDevice) -> Self {
        let encoder = gpu.device.create_command_encoder(&Default::default());
        Self { gpu, encoder, work: 0, has_submitted: false }
    }

    pub(super) fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        &mut self.encoder
    }

    pub(super) fn add_work(&mut self, work: u64) -> Result<(), Error> {
        self.work += work;
        if self.work < MAX_WORK { Ok(()) } else { self.submit() }
    }

    pub(super) fn encode_search(
        &mut self,
        detector: &mut GpuDetector,
        input: &GpuSpheres<'_>,
    ) -> Result<(), Error> {
        detector.bind(input).map_err(refused)?;
        for part in 0..detector.parts() {
            if part > 0 {
                self.submit()?;
            }
            detector.encode_part(&mut self.encoder, part);
        }
        Ok(())
    }

    fn submit(&mut self) -> Result<(), Error> {
        let Self { gpu, encoder, .. } = self;
        self.has_submitted = true;
        self.work = 0;
        with_error_scope(gpu, "steps", 0, || {
            let next = gpu.device.create_command_encoder(&Default::default());
            gpu.queue.submit([std::mem::replace(encoder, next).finish()]);
        })
    }

    pub(super) fn has_submitted(&self) -> bool {
        self.has_submitted
    }

    /// Returns commands not submitted yet.
    pub(super) fn finish(self) -> wgpu::CommandEncoder {
        self.encoder
    }
}
