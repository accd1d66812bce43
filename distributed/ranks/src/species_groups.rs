use std::collections::HashMap;

use lazygrid::Interactions;

use crate::hash::sequence;

/// Groups of species with the same partners at similar distances, each with its own bounding boxes, so that
/// ghosts go only to ranks with near partners.
#[derive(Clone, Debug)]
pub(crate) struct SpeciesGroups {
    groups: Vec<u32>,
    count: u32,
    /// Largest cutoffs of two groups, in rows.
    cutoffs: Vec<Option<f64>>,
}

impl SpeciesGroups {
    /// Each group adds bounding boxes on all ranks. Further groups share these, which sends more ghosts and loses none.
    const MAX_GROUPS: u32 = 16;

    /// Groups by partners and, up to [`Self::MAX_GROUPS`], by distances to a factor of two. Without `has_cutoffs`, only
    /// radii limit distances.
    pub(crate) fn new(table: &Interactions, has_cutoffs: bool) -> Self {
        let cutoff = |one: u32, other: u32| {
            let distance = table.get(one, other).distance()?;
            Some(distance.filter(|_| has_cutoffs).unwrap_or(f64::INFINITY))
        };
        let by_distance = |one: u32, other: u32| cutoff(one, other).map_or(0, |cutoff| 1 + binade(cutoff));
        let by_partner = |one: u32, other: u32| cutoff(one, other).is_some().into();
        let species = table.species();
        let (mut groups, mut count) = grouped(species, by_distance);
        if count > Self::MAX_GROUPS {
            (groups, count) = grouped(species, by_partner);
            groups.iter_mut().for_each(|group| *group %= Self::MAX_GROUPS);
            count = count.min(Self::MAX_GROUPS);
        }
        let mut cutoffs = vec![None; (count * count) as usize];
        for (one, &row) in (0..).zip(&groups) {
            for (other, &column) in (0..).zip(&groups) {
                let most = &mut cutoffs[(row * count + column) as usize];
                if cutoff(one, other) > *most {
                    *most = cutoff(one, other);
                }
            }
        }
        Self { groups, count, cutoffs }
    }

    /// Unknown species have a group of their own.
    #[inline]
    pub(crate) fn group_of(&self, species: u32) -> u32 {
        self.groups.get(species as usize).copied().unwrap_or(self.count)
    }

    /// Returns the largest center distance of pairs of two groups, infinite if only radii limit it; `None` if they
    /// never pair.
    #[inline]
    pub(crate) fn cutoff(&self, one: u32, other: u32) -> Option<f64> {
        if one.max(other) < self.count {
            self.cutoffs[(one * self.count + other) as usize]
        } else {
            Some(f64::INFINITY)
        }
    }
}

fn binade(distance: f64) -> u64 {
    distance.to_bits() >> 52
}

/// Species with equal rows, or with colliding hashes of rows, share a group. Also returns the number of groups.
fn grouped(species: u32, class: impl Fn(u32, u32) -> u64) -> (Vec<u32>, u32) {
    let mut of_rows = HashMap::new();
    let group = |one: u32| {
        let next = of_rows.len() as u32;
        *of_rows.entry(sequence((0..species).map(|other| class(one, other)))).or_insert(next)
    };
    let groups = (0..species).map(group).collect();
    (groups, of_rows.len() as u32)
}

#[cfg(test)]
mod tests {
    use lazygrid::Interaction;

    use super::*;

    fn table(species: u32, of_pair: impl Fn(u32, u32) -> Interaction) -> Interactions {
        let mut table = Interactions::new(species, Interaction::Never).unwrap();
        for one in 0..species {
            (0..=one).for_each(|other| table.set(one, other, of_pair(one, other)).unwrap());
        }
        table
    }

    fn touching(does: bool) -> Interaction {
        if does { Interaction::Touch } else { Interaction::Never }
    }

    #[test]
    fn species_with_equal_partners_share_a_group() {
        let pairs = |one, other| touching(other == 0 && (one == 1 || one == 2));
        let groups = SpeciesGroups::new(&table(4, pairs), true);
        assert_eq!([0, 1, 2, 3].map(|species| groups.group_of(species)), [0, 1, 1, 2]);
        assert_eq!([(0, 1), (1, 0)].map(|(one, other)| groups.cutoff(one, other)), [Some(f64::INFINITY); 2]);
        assert_eq!([0, 1].map(|group| groups.cutoff(group, group)), [None; 2]);
        assert_eq!([0, 1, 2].map(|other| groups.cutoff(2, other)), [None; 3]);
        assert!((0..4).all(|other| groups.cutoff(groups.group_of(9), other) == Some(f64::INFINITY)));
    }

    #[test]
    fn species_with_similar_distances_share_a_group_and_the_largest() {
        let distance = |one: u32, other: u32| match (one, other) {
            (3, 3) => Interaction::Touch,
            (2 | 3, _) => Interaction::Within(100.0),
            _ => Interaction::Within(1.0 + 0.3 * f64::from(one + other)),
        };
        let table = table(4, distance);
        let groups = SpeciesGroups::new(&table, true);
        assert_eq!([0, 1, 2, 3].map(|species| groups.group_of(species)), [0, 0, 1, 2]);
        assert_eq!([0, 1, 2].map(|other| groups.cutoff(0, other)), [Some(1.6), Some(100.0), Some(100.0)]);
        assert_eq!(groups.cutoff(2, 2), Some(f64::INFINITY));
        let by_partners = SpeciesGroups::new(&table, false);
        assert_eq!((by_partners.count, by_partners.cutoff(0, 0)), (1, Some(f64::INFINITY)));
    }

    #[test]
    fn merged_groups_have_the_cutoffs_of_their_species() {
        let near = |one: u32, other: u32| one.abs_diff(other) == 1 || one.abs_diff(other) == 69;
        let scattered = |one: u32, other: u32| Interaction::Within(f64::from(one * other % 7).exp2());
        let of_pairs: [&dyn Fn(u32, u32) -> Interaction; 3] =
            [&|one, other| touching(near(one, other)), &scattered, &|one, other| {
                if near(one, other) { scattered(one, other) } else { Interaction::Never }
            }];
        for (k, of_pair) in of_pairs.into_iter().enumerate() {
            let groups = SpeciesGroups::new(&table(70, of_pair), true);
            assert!(groups.count <= SpeciesGroups::MAX_GROUPS, "{k}");
            let mut largest = HashMap::new();
            for (one, other) in (0..70).flat_map(|one| (0..=one).map(move |other| (one, other))) {
                let Some(cutoff) = of_pair(one, other).cutoff(f64::INFINITY) else { continue };
                let [a, b] = [one, other].map(|species| groups.group_of(species));
                for pair in [(a, b), (b, a)] {
                    let most = largest.entry(pair).or_insert(cutoff);
                    *most = cutoff.max(*most);
                }
            }
            for ((a, b), most) in largest {
                assert_eq!(groups.cutoff(a, b), Some(most), "{k}: groups {a} and {b}");
            }
        }
    }
}
