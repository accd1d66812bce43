use lazygrid_kernels::Interactions;

use crate::Error;
use crate::gpu::device::constant_buffer;
use crate::gpu::plan::TableBytes;

/// The interaction table on the device.
#[derive(Debug)]
pub(crate) struct Tables {
    /// The contents of both buffers, and the sides of the species.
    pub(crate) bytes: TableBytes,
    /// The effective radii by species.
    pub(crate) reach: wgpu::Buffer,
    /// The interaction of each pair of species.
    pub(crate) table: wgpu::Buffer,
}

impl Tables {
    /// # Errors
    /// [`Error::LimitExceeded`] where the device cannot bind the table, or where it refuses the memory.
    pub(crate) fn new(device: &wgpu::Device, interactions: &Interactions) -> Result<Self, Error> {
        let bytes = TableBytes::new(interactions, device.limits().max_storage_buffer_binding_size)?;
        Ok(Self {
            reach: constant_buffer(device, "reach by species", &bytes.reach)?,
            table: constant_buffer(device, "interaction table", &bytes.table)?,
            bytes,
        })
    }
}
