//! Radii for frames in which radii alone decide the size of cells.
//!
//! Two species pair within the sum of their radii, which need not be equal. A frequent species with distant partners gets
//! half of its own largest distance as radius, and the partners get the rest of the distance to it.

use lazygrid_kernels::{Interaction, Query, SpeciesRadius};

use super::species_partition::{MAX_GROUPS, SpeciesPartition, SpeciesTable};
use crate::Error;
use crate::memory::try_collect;

/// Largest distance within a group, as a fraction of its largest distance to any group, for which its radius may be
/// smaller.
const MAX_NARROW: f64 = 0.5;
/// Fraction of the expected candidates below which one choice of radii replaces another.
const MAX_COST_RATIO: f64 = 0.75;
/// Maximum spheres of each set whose species are counted.
const SAMPLES: usize = 1024;

/// One bit per group.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Groups(u16);

impl Groups {
    const NONE: Self = Self(0);

    fn has(self, group: usize) -> bool {
        self.0 >> group & 1 == 1
    }

    fn with(self, group: usize) -> Self {
        Self(self.0 | 1 << group)
    }
}

#[derive(Debug, Default)]
pub(super) struct UnequalRadii {
    narrow: Groups,
    /// Groups with half of their own largest distance as radius. No two of them pair.
    chosen: Groups,
    /// Empty if no group is chosen.
    species_radii: Vec<SpeciesRadius>,
    largest: f64,
}

impl UnequalRadii {
    pub(super) fn new(partition: &SpeciesPartition) -> Self {
        let is_narrow =
            |&group: &usize| partition.narrowness(group).is_some_and(|fraction| fraction < MAX_NARROW);
        let narrow = (0..partition.count).filter(is_narrow).fold(Groups::NONE, Groups::with);
        Self { narrow, ..Self::default() }
    }

    pub(super) fn may_differ(&self) -> bool {
        self.narrow != Groups::NONE
    }

    /// Samples spheres to choose groups again. Returns `true` if radii have changed.
    pub(super) fn choose(
        &mut self,
        query: &Query<'_>,
        partition: &SpeciesPartition,
        present: &[u32],
        table: SpeciesTable<'_>,
    ) -> Result<bool, Error> {
        let counts = GroupCounts::new(query, partition);
        let chosen = counts.best(self.narrow);
        if !counts.is_better(chosen, self.chosen) {
            return Ok(false);
        }
        self.species_radii = match chosen {
            Groups::NONE => Vec::new(),
            _ => species_radii(partition, chosen, present, table)?,
        };
        let halves = present.iter().filter_map(|&species| self.species_radii.get(species as usize));
        self.largest = halves.map(|species_radius| species_radius.largest_half).fold(0.0, f64::max);
        self.chosen = chosen;
        Ok(true)
    }

    pub(super) fn species_radii(&self, most: f64) -> Option<&[SpeciesRadius]> {
        (!self.species_radii.is_empty() && self.largest <= most).then_some(&*self.species_radii)
    }
}

fn species_radii(
    partition: &SpeciesPartition,
    chosen: Groups,
    present: &[u32],
    table: SpeciesTable<'_>,
) -> Result<Vec<SpeciesRadius>, Error> {
    let half = |species: u32, other: u32| match table.interactions.get(species, other) {
        Interaction::Within(distance) => rest(partition, chosen, distance, partition.group_of(other)),
        Interaction::Never | Interaction::Touch => 0.0,
    };
    let largest = |species| present.iter().map(|&other| half(species, other)).fold(0.0, f64::max);
    let species_radius = |species: u32| {
        let group = partition.group_of(species);
        let largest_half = if chosen.has(group) { own_half(partition, group) } else { largest(species) };
        SpeciesRadius { largest_half, ..table.species_radii[species as usize] }
    };
    try_collect((0..table.interactions.species()).map(species_radius), "radii of species")
}

fn own_half(partition: &SpeciesPartition, group: usize) -> f64 {
    0.5 * partition.distance(group, group)
}

/// Returns the radius of a group that pairs with `other` within `distance`.
fn rest(partition: &SpeciesPartition, chosen: Groups, distance: f64, other: usize) -> f64 {
    if chosen.has(other) { distance - own_half(partition, other) } else { 0.5 * distance }
}

/// Calls `add` for each sphere of a sample, with its species and the number of spheres that it represents.
pub fn sample_species(query: &Query<'_>, mut add: impl FnMut(u32, f64)) {
    for set in [Some(query.first()), query.second()].into_iter().flatten() {
        let ids = set.species().unwrap_or(&[]);
        let samples = ids.len().min(SAMPLES);
        for k in 0..samples {
            let [begin, end] = [k, k + 1].map(|k| (k as u64 * ids.len() as u64 / samples as u64) as usize);
            let random = (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32;
            add(ids[begin + random as usize % (end - begin)], ids.len() as f64 / samples as f64);
        }
    }
}

struct GroupCounts<'a> {
    partition: &'a SpeciesPartition,
    counts: [f64; MAX_GROUPS + 1],
}

impl<'a> GroupCounts<'a> {
    fn new(query: &Query<'_>, partition: &'a SpeciesPartition) -> Self {
        let mut counts = [1.0; MAX_GROUPS + 1];
        sample_species(query, |species, spheres| counts[partition.group_of(species)] += spheres);
        Self { partition, counts }
    }

    /// Tries large groups first.
    fn best(&self, narrow: Groups) -> Groups {
        let mut order: [usize; MAX_GROUPS + 1] = std::array::from_fn(|group| group);
        order.sort_unstable_by(|&a, &b| self.counts[b].total_cmp(&self.counts[a]).then(a.cmp(&b)));
        order.into_iter().filter(|&group| narrow.has(group)).fold(Groups::NONE, |chosen, group| {
            let pairs_with = |other| chosen.has(other) && self.partition.groups_pair(group, other);
            let is_better = || self.is_better(chosen.with(group), chosen);
            let is_added = !(0..self.partition.count).any(pairs_with) && is_better();
            if is_added { chosen.with(group) } else { chosen }
        })
    }

    fn is_better(&self, chosen: Groups, before: Groups) -> bool {
        self.candidates(chosen) < MAX_COST_RATIO * self.candidates(before)
    }

    /// Returns the expected candidates of evenly mixed spheres, up to a common factor.
    fn candidates(&self, chosen: Groups) -> f64 {
        let groups = 0..self.partition.count;
        let of_pair = |a: usize, b: usize| {
            let pairs = self.counts[a] * self.counts[b] * if a == b { 0.5 } else { 1.0 };
            pairs * (self.radius(a, chosen) + self.radius(b, chosen)).powi(3)
        };
        let pairs = groups.clone().flat_map(|a| groups.clone().skip(a).map(move |b| (a, b)));
        pairs.filter(|&(a, b)| self.partition.groups_pair(a, b)).map(|(a, b)| of_pair(a, b)).sum()
    }

    fn radius(&self, group: usize, chosen: Groups) -> f64 {
        let partition = self.partition;
        let half = |other| rest(partition, chosen, partition.distance(group, other), other);
        match chosen.has(group) {
            true => own_half(partition, group),
            false => (0..partition.count).map(half).fold(0.0, f64::max),
        }
    }
}
