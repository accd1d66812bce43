use crate::Error;
use lazygrid_kernels::{Interaction, Interactions};

use crate::gpu::recording::constant_buffer;

/// The interaction table on the device.
#[derive(Debug)]
pub(crate) struct Tables {
    /// Per species, whether it touches any other and half its longest distance.
    pub(crate) reach: wgpu::Buffer,
    /// Per pair of species, a distance or one of the two negative marks.
    pub(crate) table: wgpu::Buffer,
}

impl Tables {
    /// # Errors
    /// [`Error::LimitExceeded`] where the device cannot bind the table, or where it refuses the memory.
    pub(crate) fn new(device: &wgpu::Device, interactions: &Interactions) -> Result<Self, Error> {
        let species = interactions.species();
        let bytes = u64::from(species) * u64::from(species) * 4;
        let limit = device.limits().max_storage_buffer_binding_size;
        if bytes > limit {
            let (what, remedy) = ("the interaction table", "merge species");
            return Err(Error::LimitExceeded { what, needed: bytes, limit, remedy });
        }
        let reach: Vec<[f32; 2]> = (0..species)
            .map(|id| interactions.reach(id))
            .map(|reach| [f32::from(u8::from(reach.touches)), reach.half])
            .collect();
        let table: Vec<f32> = (0..species)
            .flat_map(|a| (0..species).map(move |b| interactions.get(a, b)))
            .map(|interaction| match interaction {
                Interaction::Never => -1.0,
                Interaction::Touch => -2.0,
                Interaction::Within(distance) => distance as f32,
            })
            .collect();
        Ok(Self {
            reach: constant_buffer(device, "reach by species", bytemuck::cast_slice(&reach))?,
            table: constant_buffer(device, "interaction table", bytemuck::cast_slice(&table))?,
        })
    }
}
