//! Included by tests of several crates.

use lazygrid::gpu::{GpuDevice, wgpu};

/// Opens another device of the adapter.
///
/// # Panics
/// Panics if the adapter refuses the limits.
pub(crate) fn limited(gpu: &GpuDevice, limits: impl FnOnce(wgpu::Limits) -> wgpu::Limits) -> GpuDevice {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    let same = adapters.into_iter().find(|adapter| adapter.get_info().name == gpu.adapter.name);
    let adapter = same.expect("the adapter");
    let descriptor = wgpu::DeviceDescriptor {
        required_features: gpu.device.features(),
        required_limits: limits(adapter.limits()),
        ..Default::default()
    };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).expect("a device");
    GpuDevice::from_wgpu(&device, &queue)
}
