use crate::Error;
use lazygrid_kernels::layout::{SearchParams, SpeciesParams};
use lazygrid_kernels::{EffectiveRadius, Interaction, Interactions};

use super::sides::{Side, Sides};
use crate::gpu::device::constant_buffer;

/// The interaction table on the device.
#[derive(Debug)]
pub(crate) struct Tables {
    /// A [`SpeciesParams`] for each species.
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
            Side::Second => SpeciesParams::SECOND_SIDE,
            Side::Idle => SpeciesParams::IDLE,
        };
        let touches = |reach: EffectiveRadius| if reach.touches { SpeciesParams::TOUCHES } else { 0 };
        let reach: Vec<SpeciesParams> = (0..species)
            .zip(&sides.of_species)
            .map(|(id, &side)| (interactions.effective_radius(id), side))
            .map(|(reach, side)| SpeciesParams { flags: touches(reach) | flags(side), half: reach.half })
            .collect();
        let table: Vec<f32> = (0..species)
            .flat_map(|a| (0..species).map(move |b| interactions.get(a, b)))
            .map(|interaction| match interaction {
                Interaction::Never => SearchParams::NEVER,
                Interaction::Touch => SearchParams::TOUCH,
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
