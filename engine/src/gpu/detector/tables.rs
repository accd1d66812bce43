use crate::Error;
use crate::gpu::config::GpuConfig;
use crate::gpu::device::constant_buffer;
use crate::gpu::plan::TableBytes;

#[derive(Debug)]
pub(crate) struct Tables {
    pub(crate) bytes: TableBytes,
    pub(crate) species_params: wgpu::Buffer,
    pub(crate) species_params_by_side: wgpu::Buffer,
    pub(crate) table: wgpu::Buffer,
}

impl Tables {
    pub(crate) fn new(device: &wgpu::Device, config: &GpuConfig) -> Result<Option<Self>, Error> {
        let Some(interactions) = &config.interactions else { return Ok(None) };
        let most_bytes = device.limits().max_storage_buffer_binding_size;
        let bytes = TableBytes::new(interactions, config.most_frequent, most_bytes)?;
        Ok(Some(Self {
            species_params: constant_buffer(device, "species parameters", &bytes.species_params)?,
            species_params_by_side: constant_buffer(
                device,
                "species parameters by side",
                &bytes.species_params_by_side,
            )?,
            table: constant_buffer(device, "interaction table", &bytes.table)?,
            bytes,
        }))
    }
}
