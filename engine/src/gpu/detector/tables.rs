use crate::Error;
use lazygrid_kernels::{Interaction, Interactions};

use crate::gpu::recording::constant_buffer;
use crate::gpu::sides::{Side, Sides};

/// Flag of a species on the second side.
const SECOND_SIDE: u32 = 2;
/// Flag of a species that pairs with none.
const IDLE: u32 = 4;

/// The interaction table on the device.
#[derive(Debug)]
pub(crate) struct Tables {
    /// Per species its flags and the bits of half its longest distance, as `reach.wgsl` says.
    pub(crate) reach: wgpu::Buffer,
    /// Per pair of species, a distance or one of the two negative marks.
    pub(crate) table: wgpu::Buffer,
    /// The sides of the species.
    pub(crate) sides: Sides,
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
        let sides = Sides::of(interactions);
        let flags = |side: Side| match side {
            Side::First => 0,
            Side::Second => SECOND_SIDE,
            Side::Idle => IDLE,
        };
        let reach: Vec<[u32; 2]> = (0..species)
            .zip(&sides.of_species)
            .map(|(id, &side)| (interactions.reach(id), side))
            .map(|(reach, side)| [u32::from(reach.touches) | flags(side), reach.half.to_bits()])
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
            sides,
        })
    }
}
