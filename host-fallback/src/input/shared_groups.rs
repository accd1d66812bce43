//! Groups that species with different partners share, for tables with more sets of partners than groups.
//!
//! Comparisons within a group that pairs with itself grow with the square of its spheres. So a species joins a group
//! in which no spheres pair, if one exists.

#![expect(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "lists have at most MAX_PRESENT species"
)]

use std::cmp::Reverse;

use lazygrid_kernels::{Interaction, Interactions};

use super::species_partition::{Groups, MAX_GROUPS};

#[derive(Default)]
struct SharedGroups {
    firsts: [usize; MAX_GROUPS],
    species: [usize; MAX_GROUPS],
    /// One bit per group.
    partners: [u8; MAX_GROUPS],
}

impl SharedGroups {
    fn groups_pair(&self, a: usize, b: usize) -> bool {
        self.partners[a] >> b & 1 == 1
    }

    fn species_of(&self, groups: u8) -> usize {
        (0..MAX_GROUPS).filter(|group| groups >> group & 1 == 1).map(|group| self.species[group]).sum()
    }

    /// Returns the disadvantage of a group: first needless comparisons within species, then added comparisons of
    /// species.
    fn cost(&self, group: usize, partners: u8, pairs_with_itself: bool) -> (u8, usize) {
        let paired_with_itself = self.groups_pair(group, group);
        let has_own_pairs = paired_with_itself || pairs_with_itself || partners >> group & 1 == 1;
        let needless = match self.species[group] {
            _ if !has_own_pairs => 0,
            0 => 1,
            _ if paired_with_itself => 1,
            _ => 2,
        };
        let added = partners & !self.partners[group];
        let of_species = self.species_of(self.partners[group] | partners);
        (needless, of_species + self.species[group] * self.species_of(added))
    }

    fn add(&mut self, species: usize, group: usize, partners: u8) {
        if self.species[group] == 0 {
            self.firsts[group] = species;
        }
        self.species[group] += 1;
        self.partners[group] |= partners;
        for partner in (0..MAX_GROUPS).filter(|partner| partners >> partner & 1 == 1) {
            self.partners[partner] |= 1 << group;
        }
    }
}

/// Begins with the species that have most partners.
pub(super) fn share_groups(present: &[u32], table: &Interactions) -> Groups {
    let pairs = |a: usize, b: usize| table.get(present[a], present[b]) != Interaction::Never;
    let partners = |a: usize| (0..present.len()).filter(move |&b| pairs(a, b));
    let mut order: Vec<(usize, usize)> = (0..present.len())
        .map(|at| (at, partners(at).count()))
        .filter(|&(_, partners)| partners > 0)
        .collect();
    order.sort_by_key(|&(_, partners)| Reverse(partners));
    let mut groups = SharedGroups::default();
    let mut of_species = vec![None; present.len()];
    for (species, _) in order {
        let groups_of_partners = partners(species).filter_map(|other| of_species[other]);
        let of_partners = groups_of_partners.fold(0_u8, |mask, group| mask | 1_u8 << group);
        let pairs_with_itself = pairs(species, species);
        let is_alike =
            |other: usize| (0..present.len()).all(|partner| pairs(other, partner) == pairs(species, partner));
        // At equal cost, a species joins its like, or else an empty group.
        let difference = |group: usize| match groups.species[group] {
            0 => 1,
            _ if is_alike(groups.firsts[group]) => 0,
            _ => 2,
        };
        let cost = |&group: &usize| (groups.cost(group, of_partners, pairs_with_itself), difference(group));
        let group = (0..MAX_GROUPS).min_by_key(cost).unwrap_or(0);
        groups.add(species, group, of_partners | u8::from(pairs_with_itself) << group);
        of_species[species] = Some(group);
    }
    let count = groups.species.iter().filter(|species| **species > 0).count();
    (of_species, count)
}
