use lazygrid::gpu::{GpuDevice, wgpu};
use lazygrid::{Error, Interaction};
use lazygrid_kernels::layout::{SearchParams, SpeciesParams};

use crate::SpeciesSetup;
use crate::device::upload;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Division {
    OneSet,
    TwoSets,
    /// Every fifth sphere is of a species that does not pair with itself, and every seventh of one that never pairs.
    Species {
        meets_itself: bool,
    },
}

const SECOND: u32 = 1;
const IDLE: u32 = 2;

impl Division {
    fn species_of(self, index: usize, count: usize) -> u32 {
        match self {
            Self::OneSet => 0,
            Self::TwoSets => u32::from(index >= self.first_set(count)),
            Self::Species { .. } if index % 7 == 3 => IDLE,
            Self::Species { .. } => u32::from(index.is_multiple_of(5)),
        }
    }

    fn first_set(self, count: usize) -> usize {
        count - count / 5
    }

    pub(crate) fn side(self, index: usize, count: usize) -> usize {
        usize::from(self.species_of(index, count) == SECOND)
    }

    pub(crate) fn may_pair(self, index: usize, count: usize) -> bool {
        self.species_of(index, count) != IDLE
    }

    pub(crate) fn meets(self, a: usize, b: usize) -> bool {
        self.side_pairs() >> (a + b) & 1 == 1
    }

    fn side_pairs(self) -> u32 {
        match self {
            Self::OneSet => SearchParams::FIRST_WITH_ITSELF,
            Self::Species { meets_itself: true } => {
                SearchParams::FIRST_WITH_ITSELF | SearchParams::FIRST_WITH_SECOND
            }
            Self::TwoSets | Self::Species { .. } => SearchParams::FIRST_WITH_SECOND,
        }
    }

    pub(crate) fn has_species(self) -> bool {
        matches!(self, Self::Species { .. })
    }

    pub(crate) fn divide(self, call: SearchParams) -> SearchParams {
        let second_set_start =
            if self == Self::TwoSets { self.first_set(call.spheres as usize) as u32 } else { 0 };
        let species = if self.has_species() { IDLE + 1 } else { 0 };
        SearchParams {
            side_pairs: self.side_pairs(),
            interaction: SearchParams::TOUCH,
            second_set_start,
            species,
            ..call
        }
    }

    pub(crate) fn mixture(self, count: usize) -> Option<SpeciesSetup> {
        let first = if self.meets(0, 0) { Interaction::Touch } else { Interaction::Never };
        let never = Interaction::Never;
        (self != Self::OneSet).then(|| SpeciesSetup {
            species: self.species(count),
            rows: vec![vec![first], vec![Interaction::Touch, never], vec![never; 3]],
        })
    }

    pub(crate) fn species(self, count: usize) -> Vec<u32> {
        (0..count).map(|index| self.species_of(index, count)).collect()
    }

    pub(crate) fn upload(self, own: &GpuDevice, count: usize) -> Result<Species, Error> {
        let touches = SpeciesParams::TOUCHES;
        let flags = [touches, touches | SpeciesParams::SECOND_SIDE, SpeciesParams::IDLE];
        let reach = flags.map(|flags| SpeciesParams { flags, half: 0.0 });
        let (never, touch) = (SearchParams::NEVER, SearchParams::TOUCH);
        let first = if self.meets(0, 0) { touch } else { never };
        let table = [[first, touch, never], [touch, never, never], [never; 3]];
        Ok(Species {
            species: upload(own, &self.species(count))?,
            reach: upload(own, &reach)?,
            table: upload(own, &table)?,
        })
    }
}

pub(crate) struct Species {
    species: wgpu::Buffer,
    reach: wgpu::Buffer,
    table: wgpu::Buffer,
}

impl Species {
    pub(crate) fn and<'b>(
        &'b self,
        others: &[(&'static str, &'b wgpu::Buffer)],
    ) -> Vec<(&'static str, &'b wgpu::Buffer)> {
        let own = [("species", &self.species), ("species_params", &self.reach), ("table", &self.table)];
        own.into_iter().chain(others.iter().copied()).collect()
    }
}
