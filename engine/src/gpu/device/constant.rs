use super::error_scope::with_error_scope;
use crate::Error;

pub(crate) fn constant_buffer(
    device: &wgpu::Device,
    label: &'static str,
    contents: &[u8],
) -> Result<wgpu::Buffer, Error> {
    let size = (contents.len() as u64).max(16).next_multiple_of(16);
    let descriptor = wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: true,
    };
    with_error_scope(device, label, size, || -> Result<wgpu::Buffer, wgpu::MapRangeError> {
        let buffer = device.create_buffer(&descriptor);
        buffer.slice(..contents.len() as u64).get_mapped_range_mut()?.copy_from_slice(contents);
        buffer.unmap();
        Ok(buffer)
    })?
    .map_err(|error| Error::DeviceRejected { what: label, reason: error.to_string() })
}
