use lazygrid::{Error, Interaction, Sphere};
use lazygrid_kernels::layout::{CellListLayout, SearchParams, SpeciesParams};

use super::kernel_call::KernelCall;
use crate::SpeciesSetup;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Division {
    OneSet,
    TwoSets,
    /// Every fifth sphere does not pair with its species, every seventh never pairs.
    Species {
        meets_itself: bool,
    },
    /// Each species pairs with one other; every seventh sphere never pairs.
    DisjointPairs(usize),
    /// Different species pair within [`FAR`]; with two sets, no spheres of one set pair.
    NarrowSide {
        two_sets: bool,
    },
}

const FAR: f32 = 3.0;

impl Division {
    fn species_of(self, index: usize, count: usize) -> usize {
        match self {
            Self::OneSet => 0,
            Self::TwoSets => usize::from(index >= self.first_set(count)),
            _ if index % 7 == 3 => self.species_that_pair(),
            Self::Species { .. } | Self::NarrowSide { .. } => usize::from(index.is_multiple_of(5)),
            Self::DisjointPairs(pairs) => index / 2 % (2 * pairs),
        }
    }

    fn first_set(self, count: usize) -> usize {
        count - count / 5
    }

    fn species_that_pair(self) -> usize {
        if self == (Self::NarrowSide { two_sets: true }) { 2 } else { self.sides() }
    }

    pub(crate) fn side(self, index: usize, count: usize) -> usize {
        let species = self.species_of(index, count);
        let has_sides = self == Self::NarrowSide { two_sets: true };
        species + if has_sides && index >= self.first_set(count) { 2 } else { 0 }
    }

    pub(crate) fn may_pair(self, index: usize, count: usize) -> bool {
        self.species_of(index, count) < self.species_that_pair()
    }

    pub(crate) fn groups_pair(self, a: usize, b: usize) -> bool {
        self.partners().get(a).is_some_and(|&partners| u32::from(partners) >> b & 1 == 1)
    }

    fn partners(self) -> Vec<u8> {
        match self {
            Self::OneSet => vec![1],
            Self::Species { meets_itself: true } | Self::NarrowSide { two_sets: false } => vec![0b11, 0b01],
            Self::NarrowSide { two_sets: true } => vec![0b1100, 0b0100, 0b0011, 0b0001],
            Self::TwoSets | Self::Species { .. } => vec![0b10, 0b01],
            Self::DisjointPairs(pairs) => (0..2 * pairs).map(|side| 1 << (side ^ 1)).collect(),
        }
    }

    pub(crate) fn sides(self) -> usize {
        self.partners().len()
    }

    pub(crate) fn levels_per_side(self) -> usize {
        CellListLayout::levels_per_side(self.sides())
    }

    pub(crate) fn has_species(self) -> bool {
        matches!(self, Self::Species { .. } | Self::DisjointPairs(_) | Self::NarrowSide { .. })
    }

    pub(crate) fn divide(self, call: SearchParams) -> SearchParams {
        let second_set_start = match self {
            Self::TwoSets | Self::NarrowSide { two_sets: true } => {
                self.first_set(call.spheres as usize) as u32
            }
            _ => 0,
        };
        let species = if self.has_species() { self.species_that_pair() as u32 + 1 } else { 0 };
        let (interaction, narrow_sides) = match self {
            Self::NarrowSide { two_sets } => (SearchParams::BY_SPECIES, if two_sets { 0b0101 } else { 1 }),
            _ => (SearchParams::TOUCH, 0),
        };
        let call = SearchParams { interaction, narrow_sides, second_set_start, species, ..call };
        call.with_sides(&self.partners())
    }

    fn interaction(self, a: usize, b: usize) -> Interaction {
        match (self.groups_pair(a, b), self) {
            (false, _) => Interaction::Never,
            (true, Self::NarrowSide { .. }) if a % 2 != b % 2 => Interaction::Within(FAR.into()),
            (true, _) => Interaction::Touch,
        }
    }

    /// Half the distance at which a species pairs; 0 on the narrow side.
    fn half(self, species: usize) -> f32 {
        if matches!(self, Self::NarrowSide { .. }) && species == 1 { 0.5 * FAR } else { 0.0 }
    }

    pub(crate) fn effective_radius(self, index: usize, spheres: &[Sphere]) -> f32 {
        spheres[index].radius.max(self.half(self.species_of(index, spheres.len())))
    }

    pub(crate) fn mixture(self, count: usize) -> Option<SpeciesSetup> {
        let side_of =
            |index| if self.may_pair(index, count) { self.side(index, count) } else { self.sides() };
        let row = |a| (0..=a).map(|b| self.interaction(a, b)).collect();
        (self != Self::OneSet).then(|| SpeciesSetup {
            species: (0..count).map(|index| side_of(index) as u32).collect(),
            rows: (0..=self.sides()).map(row).collect(),
        })
    }

    pub(crate) fn species(self, count: usize) -> Vec<u32> {
        (0..count).map(|index| self.species_of(index, count) as u32).collect()
    }

    pub(super) fn bind(self, call: KernelCall<'_>, count: usize) -> Result<KernelCall<'_>, Error> {
        let of_one_set = match self {
            Self::NarrowSide { .. } => Self::NarrowSide { two_sets: false },
            other => other,
        };
        let ids = 0..=self.species_that_pair();
        let flags = |id: usize| match id < self.species_that_pair() {
            true => SpeciesParams::TOUCHES | (id as u32) << SpeciesParams::SIDE_SHIFT,
            false => SpeciesParams::IDLE,
        };
        let species_params: Vec<_> =
            ids.clone().map(|id| SpeciesParams { flags: flags(id), half: self.half(id) }).collect();
        let between = |a: usize, b: usize| match of_one_set.interaction(a, b) {
            Interaction::Never => SearchParams::NEVER,
            Interaction::Touch => SearchParams::TOUCH,
            Interaction::Within(distance) => distance as f32,
        };
        let table: Vec<f32> = ids.clone().flat_map(|a| ids.clone().map(move |b| between(a, b))).collect();
        call.with("species", &self.species(count))?
            .with("species_params", &species_params)?
            .with("table", &table)
    }
}
