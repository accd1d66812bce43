use std::time::Duration;

use encase::internal::WriteInto;
use encase::{ShaderType, StorageBuffer};
use lazygrid::gpu::{GpuDevice, wgpu};

use crate::Error;

/// Submissions are sized to take far less.
const TIMEOUT: Duration = Duration::from_secs(600);

pub(super) fn refused(error: lazygrid::Error) -> Error {
    Error::Detection(error)
}

pub(super) fn with_error_scope<T>(
    gpu: &GpuDevice,
    what: &'static str,
    bytes: u64,
    work: impl FnOnce() -> T,
) -> Result<T, Error> {
    gpu.with_error_scope(what, bytes, work).map_err(refused)
}

pub(super) fn buffer(gpu: &GpuDevice, name: &'static str, bytes: u64) -> Result<wgpu::Buffer, Error> {
    use wgpu::BufferUsages as Usage;
    let size = if bytes == 0 { 64 } else { bytes.next_multiple_of(16) };
    let usage = Usage::STORAGE | Usage::UNIFORM | Usage::COPY_SRC | Usage::COPY_DST;
    // A buffer above the uniform limit is never bound as a uniform.
    let usage = if size > 1 << 14 { usage - Usage::UNIFORM } else { usage };
    let descriptor = wgpu::BufferDescriptor { label: Some(name), size, usage, mapped_at_creation: false };
    with_error_scope(gpu, name, size, || gpu.device.create_buffer(&descriptor))
}

pub(super) fn encoded<T: ShaderType + WriteInto>(contents: &T) -> Vec<u8> {
    let mut bytes = StorageBuffer::new(Vec::<u8>::new());
    bytes.write(contents).expect("a vector grows");
    bytes.into_inner()
}

pub(super) fn filled<T: ShaderType + WriteInto>(
    gpu: &GpuDevice,
    name: &'static str,
    contents: &T,
) -> Result<wgpu::Buffer, Error> {
    let bytes = encoded(contents);
    let created = buffer(gpu, name, bytes.len() as u64)?;
    with_error_scope(gpu, name, 0, || gpu.queue.write_buffer(&created, 0, &bytes))?;
    Ok(created)
}

pub(super) fn read(
    gpu: &GpuDevice,
    mut encoder: wgpu::CommandEncoder,
    sources: &[(&wgpu::Buffer, u64)],
) -> Result<Vec<Vec<u8>>, Error> {
    let size = sources.iter().map(|(_, bytes)| bytes).sum::<u64>().max(16);
    let staging = wgpu::BufferDescriptor {
        label: Some("readback"),
        size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    };
    let staging = with_error_scope(gpu, "the readback", size, || gpu.device.create_buffer(&staging))?;
    let mut offset = 0;
    for &(source, bytes) in sources {
        if bytes > 0 {
            encoder.copy_buffer_to_buffer(source, 0, &staging, offset, bytes);
        }
        offset += bytes;
    }
    let submission = with_error_scope(gpu, "the readback", size, || gpu.queue.submit([encoder.finish()]))?;
    let view = gpu.map_for_reading(&staging, Some(submission), TIMEOUT).map_err(refused)?;
    let mut rest = &view[..];
    let mut take = |&(_, bytes): &(&wgpu::Buffer, u64)| {
        let (first, others) = rest.split_at(bytes as usize);
        rest = others;
        first.to_vec()
    };
    Ok(sources.iter().map(&mut take).collect())
}
