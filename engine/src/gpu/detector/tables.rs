use lazygrid_kernels::Interactions;

use crate::Error;
use crate::gpu::device::constant_buffer;
use crate::gpu::plan::TableBytes;

/// The interactions of a detector as constant buffers.
#[derive(Debug)]
pub(crate) struct Tables {
    pub(crate) bytes: TableBytes,
    pub(crate) reach: wgpu::Buffer,
    pub(crate) reach_by_side: wgpu::Buffer,
    pub(crate) table: wgpu::Buffer,
}

impl Tables {
    pub(crate) fn new(device: &wgpu::Device, interactions: &Interactions) -> Result<Self, Error> {
        let bytes = TableBytes::new(interactions, device.limits().max_storage_buffer_binding_size)?;
        Ok(Self {
            reach: constant_buffer(device, "reach by species", &bytes.reach)?,
            reach_by_side: constant_buffer(device, "reach by species on their sides", &bytes.reach_by_side)?,
            table: constant_buffer(device, "interaction table", &bytes.table)?,
            bytes,
        })
    }
}
