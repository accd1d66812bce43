use crate::gpu::plan::GpuPhase;

#[derive(Debug)]
pub(super) struct Timer {
    queries: wgpu::QuerySet,
    ticks: wgpu::Buffer,
}

impl Timer {
    const TICKS: u32 = 2 * GpuPhase::ALL.len() as u32;

    pub(super) fn new(device: &wgpu::Device) -> Self {
        let queries = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("lazygrid::phases"),
            ty: wgpu::QueryType::Timestamp,
            count: Self::TICKS,
        });
        let ticks = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("lazygrid::ticks"),
            size: u64::from(Self::TICKS) * 8,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Self { queries, ticks }
    }

    pub(super) fn queries(&self) -> &wgpu::QuerySet {
        &self.queries
    }

    pub(super) fn ticks(&self) -> &wgpu::Buffer {
        &self.ticks
    }

    pub(super) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.queries, 0..Self::TICKS, &self.ticks, 0);
    }
}
