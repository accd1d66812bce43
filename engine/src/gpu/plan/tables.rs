use std::sync::Arc;

use lazygrid_kernels::layout::{SearchParams, SpeciesParams};
use lazygrid_kernels::{EffectiveRadius, Interaction, Interactions};

use super::sides::Sides;
use crate::Error;

#[derive(Clone, Debug)]
pub(crate) struct TableBytes {
    pub(crate) species_params: Arc<[u8]>,
    pub(crate) species_params_by_side: Arc<[u8]>,
    pub(crate) table: Arc<[u8]>,
    pub(crate) sides: Sides,
}

impl TableBytes {
    pub(crate) fn new(
        interactions: &Interactions,
        most_frequent: Option<u32>,
        storage_binding: u64,
    ) -> Result<Self, Error> {
        let species = interactions.species();
        let bytes = u64::from(species) * u64::from(species) * 4;
        if bytes > storage_binding {
            let (what, remedy) = ("the interaction table", "merge species");
            return Err(Error::LimitExceeded { what, needed: bytes, limit: storage_binding, remedy });
        }
        let sides = Sides::new(interactions, most_frequent);
        let flags = |side: Option<u8>| match side {
            Some(side) => u32::from(side) << SpeciesParams::SIDE_SHIFT,
            None => SpeciesParams::IDLE,
        };
        let touches = |radius: EffectiveRadius| if radius.touches { SpeciesParams::TOUCHES } else { 0 };
        let params_of = |radius: &dyn Fn(u32) -> EffectiveRadius| -> Vec<SpeciesParams> {
            (0..species)
                .zip(&sides.of_species)
                .map(|(id, &side)| (radius(id), side))
                .map(|(radius, side)| SpeciesParams {
                    flags: touches(radius) | flags(side),
                    half: radius.half,
                })
                .collect()
        };
        let species_params = params_of(&|id| interactions.effective_radius(id));
        let species_params_by_side = params_of(&|id| sides.effective_radius(interactions, id));
        let table: Vec<f32> = (0..species)
            .flat_map(|a| (0..species).map(move |b| interactions.get(a, b)))
            .map(|interaction| match interaction {
                Interaction::Never => SearchParams::NEVER,
                Interaction::Touch => SearchParams::TOUCH,
                Interaction::Within(distance) => distance as f32,
            })
            .collect();
        let [species_params, species_params_by_side] =
            [species_params, species_params_by_side].map(|params| bytemuck::cast_slice(&params).into());
        Ok(Self { species_params, species_params_by_side, table: bytemuck::cast_slice(&table).into(), sides })
    }
}
