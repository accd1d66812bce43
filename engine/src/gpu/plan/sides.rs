//! The sides of a cell list on the GPU: a partition of the species that needs few comparisons.

use lazygrid_host::SpeciesPartition;
use lazygrid_kernels::layout::{CellListLayout, SearchParams};
use lazygrid_kernels::{EffectiveRadius, Interaction, Interactions};

/// More sides must save at least this fraction of comparisons: each side has a table of cells.
const MIN_SAVING: f64 = 0.25;
/// A group is a narrow side if its spheres pair among themselves within less than this fraction of the distance to
/// others. Else its cells would seldom be crowded enough to pay for searches between sides.
const MAX_NARROW: f64 = 0.25;
const MAX_SIDES: usize = CellListLayout::MAX_SIDES;
/// Maximum number of sides of each of two sets, so that a side has at least eight levels.
const MAX_SIDES_OF_SET: usize = 2;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sides {
    /// `None` for a species that never pairs.
    pub(crate) of_species: Vec<Option<u8>>,
    pub(crate) one_set: SidePartners,
    /// Sides of the first set, then of the second.
    pub(crate) two_sets: SidePartners,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SidePartners {
    /// Sides that each side is compared with, one bit each.
    pub(crate) of_side: Vec<u8>,
    pub(crate) narrow: u8,
    /// See [`SearchParams::interaction`].
    pub(crate) interaction: f32,
}

impl SidePartners {
    pub(crate) fn one_set() -> Self {
        Self { of_side: vec![1], narrow: 0, interaction: SearchParams::TOUCH }
    }

    pub(crate) fn two_sets() -> Self {
        Self::one_set().across_sets()
    }

    fn across_sets(&self) -> Self {
        let sides = self.of_side.len();
        let of_first = self.of_side.iter().map(|partners| partners << sides);
        let of_side = of_first.chain(self.of_side.iter().copied()).collect();
        Self { of_side, narrow: self.narrow | self.narrow << sides, ..*self }
    }
}

impl Sides {
    /// Returns the sides with the fewest comparisons, assuming equally frequent species. Of narrow groups that pair
    /// with each other, that of `most_frequent`, the species of most spheres, has a narrow side.
    pub(crate) fn new(table: &Interactions, most_frequent: Option<u32>) -> Self {
        let groups = PairingGroups::from_table(table, most_frequent);
        let species = || 0..table.species();
        let division = groups.divide();
        let of_species: Vec<Option<u8>> =
            species().map(|id| Some(division[groups.of_species[id as usize]?])).collect();
        let partners = groups.side_partners(&division);
        let is_narrow = |side: usize| {
            (0..groups.count()).any(|group| groups.is_narrow(group) && usize::from(division[group]) == side)
        };
        let narrow = mask((0..partners.len()).map(is_narrow));
        let on = |side: usize| {
            let own = species().filter(|&id| of_species[id as usize].map(usize::from) == Some(side));
            own.collect::<Vec<_>>()
        };
        let members: Vec<Vec<u32>> = (0..partners.len()).map(on).collect();
        let compared = side_pairs(&partners).flat_map(|(a, b)| product(&members[a], &members[b]));
        let interaction = common(compared, table);
        let one_set = SidePartners { of_side: partners, narrow, interaction };
        let two_sets = if members.len() <= MAX_SIDES_OF_SET {
            one_set.across_sets()
        } else {
            let all = members.concat();
            SidePartners { interaction: common(product(&all, &all), table), ..SidePartners::two_sets() }
        };
        Self { of_species, one_set, two_sets }
    }

    pub(crate) fn narrow_species(table: &Interactions, most_frequent: Option<u32>) -> Vec<bool> {
        let groups = PairingGroups::from_table(table, most_frequent);
        let is_narrow = |group: &Option<usize>| group.is_some_and(|group| groups.is_narrow(group));
        groups.of_species.iter().map(is_narrow).collect()
    }

    /// Returns the effective radius, which on a narrow side covers interactions with this side only.
    pub(crate) fn effective_radius(&self, table: &Interactions, species: u32) -> EffectiveRadius {
        let mut radius = table.effective_radius(species);
        let side = self.of_species[species as usize];
        if let Some(side) = side.filter(|side| self.one_set.narrow >> side & 1 == 1) {
            let own = (0..table.species()).filter(|&other| self.of_species[other as usize] == Some(side));
            radius.half = table.species_radius_among(species, own).effective.half;
        }
        radius
    }

    /// Returns `true` if a search needs no species.
    pub(crate) fn are_decided_by_contact(&self) -> bool {
        self.one_set.of_side.len() == 1 && self.one_set.interaction == SearchParams::TOUCH
    }
}

struct PairingGroups {
    of_species: Vec<Option<usize>>,
    weights: Vec<f64>,
    partners: Vec<u8>,
    /// Narrow groups, one bit each. No two of them pair.
    narrow: u8,
}

type Division = [u8; MAX_SIDES];

impl PairingGroups {
    fn from_table(table: &Interactions, most_frequent: Option<u32>) -> Self {
        let [by_partners, by_distance] = SpeciesPartition::from_table(table);
        let by_distance = Self::from_partition(&by_distance, table, most_frequent);
        if by_distance.narrow == 0 {
            Self::from_partition(&by_partners, table, most_frequent)
        } else {
            by_distance
        }
    }

    fn from_partition(
        partition: &SpeciesPartition,
        table: &Interactions,
        most_frequent: Option<u32>,
    ) -> Self {
        let active: Vec<usize> = (0..partition.count()).filter(|&group| !partition.is_idle(group)).collect();
        let position = |id: u32| active.iter().position(|&group| group == partition.group_of(id));
        let of_species: Vec<Option<usize>> = (0..table.species()).map(position).collect();
        let weight = |group: usize| of_species.iter().filter(|other| **other == Some(group)).count() as f64;
        let partners = |group: usize| mask(active.iter().map(|&other| partition.groups_pair(group, other)));
        let groups = Self {
            weights: (0..active.len()).map(weight).collect(),
            partners: active.iter().map(|&group| partners(group)).collect(),
            of_species,
            narrow: 0,
        };
        let frequent_group = most_frequent.and_then(|species| groups.of_species[species as usize]);
        let narrow = groups.narrow(frequent_group, |group| partition.narrowness(active[group]));
        Self { narrow, ..groups }
    }

    fn count(&self) -> usize {
        self.weights.len()
    }

    fn is_narrow(&self, group: usize) -> bool {
        self.narrow >> group & 1 == 1
    }

    /// Returns the narrow groups, one bit each. If two of them pair, `frequent_group` stays, or else the narrower one.
    fn narrow(&self, frequent_group: Option<usize>, narrowness: impl Fn(usize) -> Option<f64>) -> u8 {
        let narrow = |group| Some((narrowness(group).filter(|fraction| *fraction < MAX_NARROW)?, group));
        let mut groups: Vec<(f64, usize)> = (0..self.count()).filter_map(narrow).collect();
        groups.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        groups.sort_by_key(|&(_, group)| Some(group) != frequent_group);
        groups.iter().fold(0, |narrow, &(_, group)| match self.partners[group] & narrow {
            0 => narrow | 1 << group,
            _ => narrow,
        })
    }

    fn separates_narrow(&self, division: &Division) -> bool {
        let others = |group: usize| (0..self.count()).filter(move |&other| other != group);
        (0..self.count())
            .filter(|&group| self.is_narrow(group))
            .all(|group| others(group).all(|other| division[other] != division[group]))
    }

    /// Returns `true` if no group without pairs of its own is on a side that is compared with itself, in quadratic time
    /// for no pair.
    fn separates_groups_without_pairs(&self, division: &Division, partners: &[u8]) -> bool {
        let is_compared = |side: u8| partners[usize::from(side)] >> side & 1 == 1;
        (0..self.count()).all(|group| self.partners[group] >> group & 1 == 1 || !is_compared(division[group]))
    }

    /// Returns the division with fewest comparisons, with as many sides as save enough. One exists: a side per group
    /// separates narrow groups and those that do not pair with themselves.
    fn divide(&self) -> Division {
        let mut best = [(f64::INFINITY, [0; MAX_SIDES]); MAX_SIDES + 1];
        for division in divisions(self.count()).into_iter().filter(|division| self.separates_narrow(division))
        {
            let partners = self.side_partners(&division);
            let (cost, of_this_many) = (self.comparisons(&division, &partners), &mut best[partners.len()]);
            if cost < of_this_many.0 && self.separates_groups_without_pairs(&division, &partners) {
                *of_this_many = (cost, division);
            }
        }
        let [_, one, more @ ..] = best;
        let chosen = more
            .into_iter()
            .fold(one, |chosen, more| if more.0 <= (1.0 - MIN_SAVING) * chosen.0 { more } else { chosen });
        chosen.1
    }

    fn side_partners(&self, division: &Division) -> Vec<u8> {
        let groups = self.count();
        let sides = division[..groups].iter().max().map_or(1, |&last| usize::from(last) + 1);
        let mut partners = vec![0; sides];
        let pairs = (0..groups).flat_map(|a| (0..groups).map(move |b| (a, b)));
        for (a, b) in pairs.filter(|&(a, b)| self.partners[a] >> b & 1 == 1) {
            partners[usize::from(division[a])] |= 1 << division[b];
        }
        partners
    }

    fn comparisons(&self, division: &Division, partners: &[u8]) -> f64 {
        let mut spheres = [0.0; MAX_SIDES];
        self.weights.iter().zip(division).for_each(|(weight, &side)| spheres[usize::from(side)] += weight);
        side_pairs(partners)
            .map(|(a, b)| if a == b { 0.5 * spheres[a] * spheres[a] } else { spheres[a] * spheres[b] })
            .sum()
    }
}

/// A group is on an earlier group's side or on the next.
fn divisions(groups: usize) -> Vec<Division> {
    let mut divisions = vec![([0; MAX_SIDES], 0)];
    for group in 0..groups {
        let on_each_side = |(division, sides): (Division, u8)| {
            (0..=sides).map(move |side| {
                let mut division = division;
                division[group] = side;
                (division, sides.max(side + 1))
            })
        };
        divisions = divisions.into_iter().flat_map(on_each_side).collect();
    }
    divisions.into_iter().map(|(division, _)| division).collect()
}

fn side_pairs(partners: &[u8]) -> impl Iterator<Item = (usize, usize)> {
    let pairs = (0..partners.len()).flat_map(|a| (a..partners.len()).map(move |b| (a, b)));
    pairs.filter(|&(a, b)| partners[a] >> b & 1 == 1)
}

fn mask(bits: impl Iterator<Item = bool>) -> u8 {
    bits.enumerate().fold(0, |mask, (at, bit)| mask | u8::from(bit) << at)
}

fn product(a: &[u32], b: &[u32]) -> impl Iterator<Item = (u32, u32)> {
    a.iter().flat_map(|&a| b.iter().map(move |&b| (a, b)))
}

/// Returns the interaction of all pairs: `BY_SPECIES` if interactions differ or spheres never pair, `TOUCH` without
/// pairs.
fn common(mut pairs: impl Iterator<Item = (u32, u32)>, table: &Interactions) -> f32 {
    let Some((a, b)) = pairs.next() else { return SearchParams::TOUCH };
    let first = table.get(a, b);
    match first {
        _ if pairs.any(|(a, b)| table.get(a, b) != first) => SearchParams::BY_SPECIES,
        Interaction::Never => SearchParams::BY_SPECIES,
        Interaction::Touch => SearchParams::TOUCH,
        Interaction::Within(distance) => distance as f32,
    }
}

#[cfg(test)]
mod tests;
