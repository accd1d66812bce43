//! What the device tests share: a device or a reason to skip, and buffers to and fro.

#![allow(dead_code, unused_imports, reason = "each test binary uses its part")]

#[path = "../../../tests/src/adapter.rs"]
mod adapter;
pub(crate) mod scenes;

use adapter::or_skip;
use bytemuck::Pod;
use lazygrid::gpu::{GpuDevice, wgpu};
pub(crate) use lazygrid_check::Random;
use lazygrid_check::device;
use lazygrid_kernels::kernel::{Kernel, Variant};

/// The device to test on. Without one the test says why and is skipped, unless `LAZYGRID_REQUIRE_GPU` is set.
pub(crate) fn device() -> Option<GpuDevice> {
    or_skip(GpuDevice::open(true))
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

/// Runs one kernel on buffers given by the names of its bindings.
pub(crate) fn run(
    own: &GpuDevice,
    kernel: &'static Kernel,
    variant: Variant,
    groups: u32,
    buffers: &[(&str, &wgpu::Buffer)],
) {
    device::run(own, kernel, variant, groups, buffers).expect("run");
}
