#![allow(dead_code, unused_imports, reason = "each test binary uses its part")]

#[path = "../../../tests/src/adapter.rs"]
mod adapter;
pub(crate) mod periodic;
pub(crate) mod scenes;

use adapter::or_skip;
use bytemuck::Pod;
use lazygrid::gpu::{GpuDevice, SoftwareAdapter, wgpu};
pub(crate) use lazygrid_check::Random;
use lazygrid_check::device;
use lazygrid_kernels::kernel::{Kernel, Variant};

/// The device of all tests of a binary, which keeps compiled kernels.
pub(crate) fn device() -> Option<GpuDevice> {
    or_skip(GpuDevice::shared(SoftwareAdapter::Allow))
}

/// A device that a test may destroy.
pub(crate) fn new_device() -> Option<GpuDevice> {
    or_skip(GpuDevice::open(SoftwareAdapter::Allow))
}

pub(crate) fn limited(own: &GpuDevice, limits: impl FnOnce(wgpu::Limits) -> wgpu::Limits) -> GpuDevice {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    let same = adapters.into_iter().find(|adapter| adapter.get_info().name == own.adapter.name);
    let adapter = same.expect("the adapter");
    let descriptor = wgpu::DeviceDescriptor {
        required_features: own.device.features(),
        required_limits: limits(adapter.limits()),
        ..Default::default()
    };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).expect("a device");
    GpuDevice::from_wgpu(&device, &queue)
}

pub(crate) fn upload<T: Pod>(own: &GpuDevice, data: &[T]) -> wgpu::Buffer {
    device::upload(own, data).expect("uploaded")
}

pub(crate) fn download<T: Pod>(own: &GpuDevice, buffer: &wgpu::Buffer, count: usize) -> Vec<T> {
    device::download(own, buffer, count).expect("downloaded")
}

pub(crate) fn submit<R>(own: &GpuDevice, record: impl FnOnce(&mut wgpu::CommandEncoder) -> R) -> R {
    device::submit(own, |encoder| Ok(record(encoder))).expect("submitted")
}

pub(crate) fn run(
    own: &GpuDevice,
    kernel: &'static Kernel,
    variant: Variant,
    groups: u32,
    buffers: &[(&str, &wgpu::Buffer)],
) {
    device::run(own, kernel, variant, groups, buffers).expect("run");
}
