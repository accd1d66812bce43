use std::collections::HashMap;
use std::collections::hash_map::Entry;

use lazygrid::{Interaction, Interactions};

/// Groups of species with the same partners. Each has its own bounding boxes, so a ghost goes only to ranks with a
/// partner.
#[derive(Clone, Debug)]
pub(crate) struct SpeciesGroups {
    groups: Vec<u32>,
    /// Groups that may pair, as bits.
    partners: Vec<u64>,
}

impl SpeciesGroups {
    /// Groups add bounding boxes on all ranks. Further groups share these, which sends more ghosts and loses none.
    const MAX_GROUPS: u32 = 16;

    pub(crate) fn new(table: &Interactions) -> Self {
        let species = table.species();
        let pairs = |one: u32, other: u32| table.get(one, other) != Interaction::Never;
        let mut of_partners: HashMap<Vec<u64>, u32> = HashMap::new();
        let mut groups = Vec::with_capacity(species as usize);
        for one in 0..species {
            let mut row = vec![0_u64; species.div_ceil(64) as usize];
            (0..species).filter(|&other| pairs(one, other)).for_each(|other| {
                row[other as usize / 64] |= 1 << (other % 64);
            });
            let next = of_partners.len() as u32 % Self::MAX_GROUPS;
            groups.push(match of_partners.entry(row) {
                Entry::Occupied(group) => *group.get(),
                Entry::Vacant(group) => *group.insert(next),
            });
        }
        let mut partners = vec![0; Self::MAX_GROUPS.min(of_partners.len() as u32) as usize];
        for (row, &group) in &of_partners {
            for other in (0..species).filter(|other| row[*other as usize / 64] >> (other % 64) & 1 > 0) {
                partners[group as usize] |= 1 << groups[other as usize];
            }
        }
        Self { groups, partners }
    }

    /// Unknown species have a group of their own.
    #[inline]
    pub(crate) fn of(&self, species: u32) -> u32 {
        self.groups.get(species as usize).copied().unwrap_or(self.partners.len() as u32)
    }

    #[inline]
    pub(crate) fn can_pair(&self, one: u32, other: u32) -> bool {
        let known = self.partners.get(one as usize).filter(|_| (other as usize) < self.partners.len());
        known.is_none_or(|partners| partners >> other & 1 > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn groups(species: u32, pairs: impl Fn(u32, u32) -> bool) -> SpeciesGroups {
        let mut table = Interactions::new(species, Interaction::Never).unwrap();
        for one in 0..species {
            for other in 0..=one {
                if pairs(one, other) {
                    table.set(one, other, Interaction::Touch).unwrap();
                }
            }
        }
        SpeciesGroups::new(&table)
    }

    #[test]
    fn species_with_equal_partners_share_a_group() {
        let groups = groups(4, |one, other| other == 0 && (one == 1 || one == 2));
        assert_eq!([0, 1, 2, 3].map(|species| groups.of(species)), [0, 1, 1, 2]);
        assert!(groups.can_pair(0, 1) && groups.can_pair(1, 0));
        assert!(!groups.can_pair(0, 0) && !groups.can_pair(1, 1));
        assert!((0..3).all(|other| !groups.can_pair(2, other)));
        assert!((0..4).all(|other| groups.can_pair(groups.of(9), other)));
    }

    #[test]
    fn merged_groups_pair_wherever_their_species_do() {
        let pairs = |one: u32, other: u32| one.abs_diff(other) == 1 || one.abs_diff(other) == 69;
        let groups = groups(70, pairs);
        for one in 0..70 {
            for other in 0..70 {
                let [a, b] = [one, other].map(|species| groups.of(species));
                assert!(a < SpeciesGroups::MAX_GROUPS);
                assert!(!pairs(one, other) || groups.can_pair(a, b), "{one} {other}");
            }
        }
    }
}
