use bytemuck::Pod;

use super::{GpuDevice, wgpu};

/// A linear congruential generator.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0
    }

    pub(crate) fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }
}

/// Opens another device of the adapter, whose storage bindings have at most `bytes`.
pub(crate) fn with_binding_limit(gpu: &GpuDevice, bytes: u64) -> GpuDevice {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    let adapter = adapters.into_iter().find(|a| a.get_info().name == gpu.adapter.name).expect("the same");
    let limits = wgpu::Limits { max_storage_buffer_binding_size: bytes, ..adapter.limits() };
    let descriptor = wgpu::DeviceDescriptor {
        required_features: gpu.device.features(),
        required_limits: limits,
        ..Default::default()
    };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).expect("a device");
    GpuDevice::from_wgpu(&device, &queue)
}

/// Submits the encoder, then reads `count` values.
pub(crate) fn download<T: Pod>(
    gpu: &GpuDevice,
    mut encoder: wgpu::CommandEncoder,
    buffer: &wgpu::Buffer,
    count: usize,
) -> Vec<T> {
    let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let size = (count * size_of::<T>()) as u64;
    let descriptor = wgpu::BufferDescriptor { label: Some("test"), size, usage, mapped_at_creation: false };
    let back = gpu.device.create_buffer(&descriptor);
    encoder.copy_buffer_to_buffer(buffer, 0, &back, 0, size);
    gpu.queue.submit([encoder.finish()]);
    back.slice(..).map_async(wgpu::MapMode::Read, |result| result.expect("mapped"));
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("finished");
    bytemuck::pod_collect_to_vec(&back.slice(..).get_mapped_range().expect("mapped"))
}
