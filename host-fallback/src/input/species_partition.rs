//! Species grouped by their partners, so that a search compares only spheres that may pair.
//!
//! Species with the same present partners share a group. The division by distance also requires about the same distances.

#![expect(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "lists have at most MAX_PRESENT species or MAX_GROUPS groups"
)]

use lazygrid_kernels::{EffectiveRadius, Interaction, Interactions, SpeciesRadius};

use super::shared_groups::share_groups;
use crate::Error;
use crate::memory::try_collect;

/// Maximum groups of species that pair. With more sets of partners, groups are [shared](super::shared_groups).
pub(crate) const MAX_GROUPS: usize = 8;
/// Maximum present species that are grouped, because grouping takes quadratic time. More species are one group.
pub(super) const MAX_PRESENT: usize = 512;
/// Largest sum of two effective radii, as a multiple of the distance that they represent: rounding up adds one ulp, or
/// 4 of the 16 half ulps of the filter's band in the square.
const ROUNDED_UP: f64 = 1.0 + f32::EPSILON as f64;
/// Radius of a species for its own group, as a fraction of that for all species, below which both are distinguished.
const MAX_NARROW: f32 = 0.5;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GroupInteraction {
    /// Contact decides some pairs.
    pub(crate) touches: bool,
    /// Largest distance of a pair, or 0.
    pub(crate) distance: f64,
    /// Effective radii decide pairs, up to rounding.
    pub(crate) is_by_radii: bool,
}

impl GroupInteraction {
    pub(crate) const ANY: Self = Self { touches: true, distance: f64::INFINITY, is_by_radii: false };

    fn from_species_pairs(
        species: impl Iterator<Item = (u32, u32)>,
        table: SpeciesTable<'_>,
    ) -> Option<Self> {
        let none = Self { touches: false, distance: 0.0, is_by_radii: true };
        let (group_interaction, pairs) =
            species.fold((none, false), |(mut group_interaction, pairs), (a, b)| {
                let interaction = table.interactions.get(a, b);
                let is_by_radii = [a, b].into_iter().all(|species| {
                    let EffectiveRadius { touches, half, .. } =
                        table.species_radii[species as usize].effective;
                    match interaction {
                        Interaction::Never => false,
                        Interaction::Touch => half == 0.0,
                        Interaction::Within(distance) => {
                            !touches && (distance..=ROUNDED_UP * distance).contains(&(2.0 * f64::from(half)))
                        }
                    }
                });
                group_interaction.is_by_radii &= is_by_radii;
                match interaction {
                    Interaction::Never => return (group_interaction, pairs),
                    Interaction::Touch => group_interaction.touches = true,
                    Interaction::Within(distance) => {
                        group_interaction.distance = group_interaction.distance.max(distance)
                    }
                }
                (group_interaction, true)
            });
        pairs.then_some(group_interaction)
    }
}

/// Group of each species, `None` without partners, and number of groups.
pub(super) type Groups = (Vec<Option<usize>>, usize);

#[derive(Clone, Copy)]
pub(super) struct SpeciesTable<'t> {
    pub(super) interactions: &'t Interactions,
    pub(super) species_radii: &'t [SpeciesRadius],
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Division {
    #[default]
    Merged,
    ByPartners,
    /// Groups species with the same partners and about the same distances. Each group has its own radii.
    ByDistance,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpeciesPartition {
    pub(super) of_species: Vec<u8>,
    pub(super) count: usize,
    /// Indexed by two groups, row by row; `None` if they never pair.
    pub(super) group_interactions: Vec<Option<GroupInteraction>>,
    /// Radius of each species for its own group. Empty unless some species pairs much farther with others in a
    /// division by distance.
    pub(super) narrow: Vec<SpeciesRadius>,
}

impl SpeciesPartition {
    /// Returns the most bytes of the three divisions of a table of `species`, of which `present` are grouped.
    pub(super) fn memory_of_three(species: u64, present: u64) -> u64 {
        let group_interactions = (MAX_GROUPS + 1).pow(2) * size_of::<Option<GroupInteraction>>();
        let groups = present.min(MAX_PRESENT as u64) * size_of::<Option<usize>>() as u64;
        let narrow = species * size_of::<SpeciesRadius>() as u64;
        3 * (species + group_interactions as u64 + groups) + narrow + 2 * groups
    }

    fn new(of_species: Vec<u8>, count: usize, present: &[u32], table: SpeciesTable<'_>) -> Self {
        let members = |group: usize| {
            let of_species = &of_species;
            present.iter().copied().filter(move |&s| usize::from(of_species[s as usize]) == group)
        };
        let group_interaction = |a: usize, b: usize| {
            GroupInteraction::from_species_pairs(
                members(a).flat_map(|s| members(b).map(move |t| (s, t))),
                table,
            )
        };
        let group_interactions =
            (0..count * count).map(|k| group_interaction(k / count, k % count)).collect();
        Self { of_species, count, group_interactions, narrow: Vec::new() }
    }

    pub(super) fn narrowed(self, present: &[u32], table: SpeciesTable<'_>) -> Result<Self, Error> {
        let mut narrow = try_collect(table.species_radii.iter().copied(), "radii of species")?;
        let mut is_narrow = false;
        for &species in present {
            let group = self.group_of(species);
            // A group without own pairs is searched only by other groups.
            if self.groups_pair(group, group) {
                let members = present.iter().copied().filter(|&other| self.group_of(other) == group);
                let own = table.interactions.species_radius_among(species, members);
                let all = std::mem::replace(&mut narrow[species as usize], own).effective;
                is_narrow |= own.effective.half < MAX_NARROW * all.half;
                is_narrow |= all.touches && !own.effective.touches;
            }
        }
        Ok(Self { narrow: if is_narrow { narrow } else { Vec::new() }, ..self })
    }

    /// Returns the divisions of all species by partners and by distance.
    pub fn from_table(interactions: &Interactions) -> [Self; 2] {
        let all: Vec<u32> = (0..interactions.species()).collect();
        let species_radii: Vec<_> = all.iter().map(|&species| interactions.species_radius(species)).collect();
        let [_, by_partners, by_distance] =
            Self::from_present(&all, SpeciesTable { interactions, species_radii: &species_radii });
        [by_partners, by_distance]
    }

    pub(super) fn from_present(present: &[u32], table: SpeciesTable<'_>) -> [Self; 3] {
        let interactions = table.interactions;
        if present.len() > MAX_PRESENT {
            return [(); 3].map(|()| Self::undivided(interactions.species()));
        }
        let pairs = |with| u16::from(with != Interaction::Never);
        let by_partners = group_by(present, interactions, pairs);
        let by_partners = by_partners.unwrap_or_else(|| share_groups(present, interactions));
        let by_distance = group_by(present, interactions, distance_class);
        let is_idle = by_partners.0.iter().any(|group| group.is_none());
        let partition = |(groups, count): &Groups| {
            // Without spheres, one empty group exists.
            let count = (*count).max(usize::from(present.is_empty()));
            let mut of_species = vec![0; interactions.species() as usize];
            for (&species, group) in present.iter().zip(groups) {
                of_species[species as usize] = group.unwrap_or(count) as u8;
            }
            Self::new(of_species, count + usize::from(is_idle), present, table)
        };
        let merged = by_partners.0.iter().map(|group| group.map(|_| 0)).collect();
        let merged = partition(&(merged, by_partners.1.min(1)));
        let by_distance = by_distance.filter(|(_, count)| *count > by_partners.1);
        let by_partners = partition(&by_partners);
        let by_distance = by_distance.map_or_else(|| by_partners.clone(), |groups| partition(&groups));
        [merged, by_partners, by_distance]
    }

    pub fn count(&self) -> usize {
        self.count
    }

    pub fn group_of(&self, species: u32) -> usize {
        self.of_species[species as usize].into()
    }

    pub fn groups_pair(&self, a: usize, b: usize) -> bool {
        self.group_interactions[a * self.count + b].is_some()
    }

    pub(super) fn distance(&self, a: usize, b: usize) -> f64 {
        self.group_interactions[a * self.count + b]
            .map_or(0.0, |group_interaction| group_interaction.distance)
    }

    /// Returns the largest distance within a group, relative to that to any group. Returns `None` if its spheres never
    /// pair, or pair by contact: radii may be as large as distances.
    pub fn narrowness(&self, group: usize) -> Option<f64> {
        let own = self.group_interactions[group * self.count + group].filter(|own| !own.touches)?;
        let largest = (0..self.count).map(|other| self.distance(group, other)).fold(0.0, f64::max);
        Some(own.distance / largest)
    }

    /// Returns `true` for a group that pairs with no group.
    pub fn is_idle(&self, group: usize) -> bool {
        (0..self.count).all(|other| !self.groups_pair(group, other))
    }

    fn undivided(species: u32) -> Self {
        let of_species = vec![0; species as usize];
        Self {
            of_species,
            count: 1,
            group_interactions: vec![Some(GroupInteraction::ANY)],
            narrow: Vec::new(),
        }
    }
}

/// Distances of one class differ by less than a factor of 4.
fn distance_class(with: Interaction) -> u16 {
    match with {
        Interaction::Never => 0,
        Interaction::Touch => 1,
        // Half the exponent.
        Interaction::Within(distance) => 2 + (distance.to_bits() >> 53) as u16,
    }
}

/// Groups species by the classes of their interactions. Class 0 is [`Interaction::Never`]. Returns `None` above
/// [`MAX_GROUPS`].
fn group_by(present: &[u32], table: &Interactions, class: impl Fn(Interaction) -> u16) -> Option<Groups> {
    let class = |a: u32, b: u32| class(table.get(a, b));
    let mut firsts: Vec<u32> = Vec::new();
    let mut of_species = Vec::with_capacity(present.len());
    for &species in present {
        if present.iter().all(|&other| class(species, other) == 0) {
            of_species.push(None);
            continue;
        }
        let is_alike = |first: &u32| present.iter().all(|&b| class(*first, b) == class(species, b));
        let known = firsts.iter().position(is_alike);
        if known.is_none() {
            firsts.push(species);
        }
        of_species.push(Some(known.unwrap_or(firsts.len() - 1)));
        if firsts.len() > MAX_GROUPS {
            return None;
        }
    }
    Some((of_species, firsts.len()))
}
