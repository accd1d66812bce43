use std::time::Duration;

use bytemuck::Pod;
use encase::internal::{CreateFrom, WriteInto};
use encase::{ShaderType, StorageBuffer};
use lazygrid::Error;
use lazygrid::gpu::{GpuDevice, wgpu};
use lazygrid_kernels::kernel::{Binding, Kernel, Variant};
use wgpu::BufferUsages;

/// Time limit of each operation.
pub const TIMEOUT: Duration = Duration::from_secs(60);

pub fn storage_buffer(gpu: &GpuDevice, bytes: u64) -> Result<wgpu::Buffer, Error> {
    let usage =
        BufferUsages::STORAGE | BufferUsages::UNIFORM | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
    buffer(gpu, bytes, usage)
}

fn buffer(gpu: &GpuDevice, bytes: u64, usage: BufferUsages) -> Result<wgpu::Buffer, Error> {
    let size = bytes.max(16).next_multiple_of(16);
    let descriptor =
        wgpu::BufferDescriptor { label: Some("lazygrid::check"), size, usage, mapped_at_creation: false };
    gpu.with_error_scope("a buffer to check with", size, || gpu.device.create_buffer(&descriptor))
}

pub fn upload<T: Pod>(gpu: &GpuDevice, data: &[T]) -> Result<wgpu::Buffer, Error> {
    let bytes: &[u8] = bytemuck::cast_slice(data);
    let buffer = storage_buffer(gpu, bytes.len() as u64)?;
    gpu.with_error_scope("an upload", bytes.len() as u64, || gpu.queue.write_buffer(&buffer, 0, bytes))?;
    Ok(buffer)
}

pub fn download<T: Pod>(gpu: &GpuDevice, from: &wgpu::Buffer, count: usize) -> Result<Vec<T>, Error> {
    if count == 0 {
        return Ok(Vec::new());
    }
    let bytes = (count * size_of::<T>()) as u64;
    let staging = buffer(gpu, bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?;
    submit(gpu, |encoder| {
        encoder.copy_buffer_to_buffer(from, 0, &staging, 0, bytes);
        Ok(())
    })?;
    let view = gpu.map_for_reading(&staging, None, TIMEOUT)?;
    Ok(bytemuck::pod_collect_to_vec(&view[..bytes as usize]))
}

pub fn upload_one<T: ShaderType + WriteInto>(gpu: &GpuDevice, data: &T) -> Result<wgpu::Buffer, Error> {
    let mut bytes = StorageBuffer::new(Vec::<u8>::new());
    bytes.write(data).expect("a vector grows");
    upload(gpu, bytes.as_ref())
}

pub fn download_one<T: ShaderType + CreateFrom>(gpu: &GpuDevice, from: &wgpu::Buffer) -> Result<T, Error> {
    let bytes = download::<u8>(gpu, from, T::min_size().get() as usize)?;
    Ok(StorageBuffer::new(bytes).create().expect("all of it"))
}

pub fn wait(gpu: &GpuDevice) -> Result<(), Error> {
    let until = wgpu::PollType::Wait { submission_index: None, timeout: Some(TIMEOUT) };
    gpu.poll(until)
}

pub fn submit<R>(
    gpu: &GpuDevice,
    record: impl FnOnce(&mut wgpu::CommandEncoder) -> Result<R, Error>,
) -> Result<R, Error> {
    gpu.with_error_scope("a submission", 0, || {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let result = record(&mut encoder)?;
        gpu.queue.submit([encoder.finish()]);
        Ok(result)
    })?
}

/// Runs one kernel on buffers by binding name.
///
/// # Panics
/// Panics if a binding has no buffer.
pub fn run(
    gpu: &GpuDevice,
    kernel: &'static Kernel,
    variant: Variant,
    groups: u32,
    buffers: &[(&str, &wgpu::Buffer)],
) -> Result<(), Error> {
    run_over(gpu, kernel, variant, [groups, 1, 1], buffers)
}

/// # Panics
/// Panics if a binding has no buffer.
pub fn run_over(
    gpu: &GpuDevice,
    kernel: &'static Kernel,
    variant: Variant,
    [x, y, z]: [u32; 3],
    buffers: &[(&str, &wgpu::Buffer)],
) -> Result<(), Error> {
    let (pipeline, layout) = gpu.kernel(kernel, variant)?;
    let entry = |(binding, bound): (u32, Binding)| {
        let (_, buffer) = buffers
            .iter()
            .find(|(name, _)| *name == bound.name)
            .unwrap_or_else(|| panic!("{}: no buffer for {}", kernel.name, bound.name));
        wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() }
    };
    let entries: Vec<_> = (0..).zip(kernel.bindings(variant)).map(entry).collect();
    submit(gpu, |encoder| {
        let descriptor = wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries };
        let bindings = gpu.device.create_bind_group(&descriptor);
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups(x, y, z);
        Ok(())
    })
}
