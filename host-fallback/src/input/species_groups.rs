//! The species that are present, their radii for each other, and their groups.

#![expect(clippy::disallowed_methods, reason = "a table has at most 4096 species")]

use lazygrid_kernels::{Interactions, Query, SpeciesRadius};

use super::species_partition::{Division, MAX_PRESENT, SpeciesPartition, SpeciesTable};
use super::unequal_radii::UnequalRadii;
use crate::Error;
use crate::executor::{Chunks, Executor};
use crate::memory::try_collect;

const CHUNK_SPHERES: usize = 1 << 14;
const WORDS: usize = Interactions::MAX_SPECIES as usize / 64;

#[derive(Debug)]
pub struct SpeciesGroups {
    /// One bit per species.
    present: [u64; WORDS],
    species_radii: Vec<SpeciesRadius>,
    unequal_radii: UnequalRadii,
    /// Indexed by [`Division`].
    partitions: [SpeciesPartition; 3],
    version: u32,
}

impl Default for SpeciesGroups {
    fn default() -> Self {
        let (species_radii, unequal_radii, partitions) = Default::default();
        Self { present: [0; WORDS], species_radii, unequal_radii, partitions, version: 0 }
    }
}

impl SpeciesGroups {
    /// Returns the most bytes for a table of `species` and `spheres` spheres, while the present species change.
    pub(crate) fn memory_for(species: u32, spheres: u64) -> u64 {
        let (all, present) = (u64::from(species), spheres.min(species.into()));
        // Old and new radii, old and new ones in frames, and the table's radii beyond `MAX_PRESENT`.
        let species_radii = 5 * size_of::<SpeciesRadius>() as u64 * all;
        let lists = 3 * size_of::<u32>() as u64 * present;
        species_radii + lists + 2 * SpeciesPartition::memory_of_three(all, present)
    }

    /// `table` must be the same in every call, and contain the query's species.
    pub(crate) fn update(
        &mut self,
        query: &Query<'_>,
        table: &Interactions,
        executor: Executor,
    ) -> Result<(), Error> {
        let mut found = [0; WORDS];
        for set in [Some(query.first()), query.second()].into_iter().flatten() {
            let seen = find_present(set.species().unwrap_or(&[]), table.species(), executor)?;
            found.iter_mut().zip(seen).for_each(|(found, seen)| *found |= seen);
        }
        if found == self.present && self.version > 0 {
            return Ok(());
        }
        let is_present = |species: &u32| has(&found, *species);
        let present: Vec<u32> = (0..table.species()).filter(is_present).collect();
        let species_radius = |species| match present.len() > MAX_PRESENT {
            true => table.species_radius(species),
            false if is_present(&species) => table.species_radius_among(species, present.iter().copied()),
            false => SpeciesRadius::NONE,
        };
        let species_radii = try_collect((0..table.species()).map(species_radius), "radii of species")?;
        let table = SpeciesTable { interactions: table, species_radii: &species_radii };
        let [merged, by_partners, by_distance] = SpeciesPartition::from_present(&present, table);
        let by_distance = by_distance.narrowed(&present, table)?;
        self.unequal_radii = UnequalRadii::new(&by_distance);
        self.partitions = [merged, by_partners, by_distance];
        (self.present, self.version) = (found, self.version.wrapping_add(1).max(1));
        self.species_radii = species_radii;
        Ok(())
    }

    pub fn is_present(&self, species: u32) -> bool {
        has(&self.present, species)
    }

    pub fn species_radii(&self) -> &[SpeciesRadius] {
        &self.species_radii
    }

    /// Spheres and `table` must be those of the last update.
    pub(super) fn choose_radii(&mut self, query: &Query<'_>, table: &Interactions) -> Result<(), Error> {
        if self.unequal_radii.may_differ() {
            let present: Vec<u32> =
                (0..table.species()).filter(|&species| self.is_present(species)).collect();
            let table = SpeciesTable { interactions: table, species_radii: &self.species_radii };
            let [.., by_distance] = &self.partitions;
            let has_changed = self.unequal_radii.choose(query, by_distance, &present, table)?;
            self.version = self.version.wrapping_add(has_changed.into()).max(1);
        }
        Ok(())
    }

    /// Returns the chosen radii if no radius exceeds `most`, else those of the last update.
    pub(super) fn species_radii_in_frame(&self, most: f64) -> &[SpeciesRadius] {
        self.unequal_radii.species_radii(most).unwrap_or(&self.species_radii)
    }

    pub(crate) fn partition(&self, division: Division) -> &SpeciesPartition {
        &self.partitions[division as usize]
    }

    pub(crate) fn finer_divisions(&self) -> impl Iterator<Item = Division> {
        let [merged, by_partners, by_distance] = &self.partitions;
        let divides = by_partners.count > merged.count;
        let narrows = !by_distance.narrow.is_empty();
        let by_partners = divides.then_some(Division::ByPartners);
        by_partners.into_iter().chain(narrows.then_some(Division::ByDistance))
    }

    /// Returns a number that changes with the present species, and with the choice of radii in frames.
    pub fn version(&self) -> u32 {
        self.version
    }
}

fn has(present: &[u64; WORDS], species: u32) -> bool {
    present[species as usize / 64] >> (species % 64) & 1 == 1
}

fn find_present(ids: &[u32], species: u32, executor: Executor) -> Result<[u64; WORDS], Error> {
    let fold_chunk = |mut seen: [u64; WORDS], chunk: usize| {
        let ids = &ids[chunk * CHUNK_SPHERES..ids.len().min((chunk + 1) * CHUNK_SPHERES)];
        if species <= 64 {
            seen[0] |= ids.iter().fold(0, |seen, id| seen | 1 << (id % 64));
        } else {
            ids.iter().for_each(|id| seen[*id as usize / 64] |= 1 << (id % 64));
        }
        Ok(seen)
    };
    let merge = |mut a: [u64; WORDS], b: [u64; WORDS]| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a |= b);
        Ok(a)
    };
    let chunks = Chunks::unlimited(ids.len().div_ceil(CHUNK_SPHERES));
    executor.for_light_work(ids.len()).fold(chunks, || [0; WORDS], fold_chunk, merge)
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::{Interaction, Sphere, Spheres};

    use super::*;
    use crate::input::{GroupInteraction, Grouping, MAX_GROUPS};

    fn update(groups: &mut SpeciesGroups, ids: &[u32], table: &Interactions) {
        let spheres = vec![Sphere::default(); ids.len()];
        let query = Spheres::from(&spheres).with_species(ids).expect("as many").into();
        groups.update(&query, table, Executor::Caller).expect("nothing fails");
    }

    fn groups(ids: &[u32], table: &Interactions) -> SpeciesGroups {
        let mut groups = SpeciesGroups::default();
        update(&mut groups, ids, table);
        groups
    }

    fn by_partners(groups: &SpeciesGroups) -> &SpeciesPartition {
        groups.partition(Division::ByPartners)
    }

    fn groups_by_partners(ids: &[u32], table: &Interactions) -> Vec<u8> {
        let groups = groups(ids, table);
        ids.iter().map(|&species| by_partners(&groups).of_species[species as usize]).collect()
    }

    #[test]
    fn ring_of_reactions_has_two_groups() {
        let mut table = Interactions::new(4, Interaction::Never).expect("a table");
        for species in 0..4 {
            table.set(species, (species + 1) % 4, Interaction::Within(1.0)).expect("species of the table");
        }
        assert_eq!(groups_by_partners(&[0, 1, 2, 3], &table), [0, 1, 0, 1]);
        let groups = groups(&[3, 2, 1, 0], &table);
        let group_interaction = Some(GroupInteraction { touches: false, distance: 1.0, is_by_radii: true });
        assert_eq!(
            by_partners(&groups).group_interactions,
            [None, group_interaction, group_interaction, None]
        );
        assert!(!groups.partition(Division::Merged).group_interactions[0].expect("some pair").is_by_radii);
        assert_eq!((by_partners(&groups).count, groups.partition(Division::Merged).count), (2, 1));
        assert!(groups.finer_divisions().eq([Division::ByPartners]));
    }

    #[test]
    fn species_without_present_partner_is_idle() {
        let mut table = Interactions::new(3, Interaction::Never).expect("a table");
        table.set(0, 1, Interaction::Touch).expect("species of the table");
        assert_eq!(groups_by_partners(&[0, 2, 1], &table), [0, 2, 1]);
        assert_eq!(groups_by_partners(&[0, 2], &table), [0, 0], "its partner is absent");
        let mut groups = groups(&[0, 1, 2], &table);
        let grouping = Grouping::new(None, Some((by_partners(&groups), &[0, 1, 2])));
        assert!((0..3).all(|other| grouping.group_interaction(2, other).is_none()));
        assert_eq!(groups.partition(Division::Merged).of_species, [0, 0, 1]);
        update(&mut groups, &[2], &table);
        let merged = groups.partition(Division::Merged);
        assert_eq!((merged.count, merged.group_interactions[0], groups.version()), (1, None, 2));
    }

    #[test]
    fn species_beyond_the_most_groups_share_these() {
        let mut table = Interactions::new(100, Interaction::Never).expect("a table");
        for species in 0..100 {
            table.set(species, species, Interaction::Touch).expect("species of the table");
        }
        let all: Vec<u32> = (0..100).collect();
        let nine = groups(&all[..MAX_GROUPS + 1], &table);
        let group_interaction =
            |a: usize, b: usize| by_partners(&nine).group_interactions[a * MAX_GROUPS + b];
        assert_eq!(group_interaction(0, 0).map(|pairs| pairs.is_by_radii), Some(false), "of two species");
        assert_eq!(group_interaction(1, 1).map(|pairs| pairs.is_by_radii), Some(true));
        assert_eq!(group_interaction(0, 1), None);
        let groups = groups_by_partners(&all, &table);
        let members = |group: u8| groups.iter().filter(|other| **other == group).count();
        assert!((0..MAX_GROUPS as u8).all(|group| (12..=13).contains(&members(group))), "{groups:?}");
    }

    fn crowded_groups(species: u32, pairs: impl Fn(u32, u32) -> bool) -> (usize, Vec<u8>) {
        let mut table = Interactions::new(species, Interaction::Never).expect("a table");
        for (a, b) in (0..species).flat_map(|a| (a..species).map(move |b| (a, b))) {
            let with = if pairs(a, b) { Interaction::Touch } else { Interaction::Never };
            table.set(a, b, with).expect("species of the table");
        }
        let all: Vec<u32> = (0..species).collect();
        let groups = groups(&all, &table);
        let partition = by_partners(&groups);
        assert!(partition.count <= MAX_GROUPS + 1);
        let are_in_paired_groups = |(a, b): (u32, u32)| {
            !pairs(a.min(b), a.max(b)) || partition.groups_pair(partition.group_of(a), partition.group_of(b))
        };
        assert!(all.iter().flat_map(|&a| all.iter().map(move |&b| (a, b))).all(are_in_paired_groups));
        let meets_itself = |group: &usize| partition.groups_pair(*group, *group);
        ((0..partition.count).filter(meets_itself).count(), partition.of_species.clone())
    }

    #[test]
    fn shared_groups_of_pairs_never_pair_with_themselves() {
        for pairs in 5..=20 {
            assert_eq!(crowded_groups(2 * pairs, |a, b| a ^ b == 1).0, 0, "{pairs} neighbors");
            assert_eq!(crowded_groups(2 * pairs, |a, b| a + pairs == b).0, 0, "{pairs} in two halves");
            assert_eq!(crowded_groups(2 * pairs + 1, |a, b| a ^ b == 1 || b == 2 * pairs).0, 1, "and one");
            let partner_of_all = |a: u32, b: u32| b == 2 * pairs && a < b || a ^ b == 1 && b < 2 * pairs;
            assert_eq!(crowded_groups(2 * pairs + 1, partner_of_all).0, 0, "{pairs} and a partner of all");
        }
        for species in 9..=20 {
            assert_eq!(crowded_groups(species, |a, b| a != b).0, 1, "{species} that pair with all others");
            let (crowded, groups) = crowded_groups(2 * species, |a, b| a % species != b % species);
            let has_like = |k: usize| groups[k] == groups[k + species as usize];
            assert!(crowded == 1 && (0..species as usize).all(has_like), "{groups:?}");
        }
    }

    #[test]
    fn radii_decide_only_if_no_species_has_another_distance() {
        let touch = Interactions::new(2, Interaction::Touch).expect("a table");
        let mut within = Interactions::new(3, Interaction::Within(0.3)).expect("a table");
        let decides = |ids: &[u32], table: &Interactions| {
            let groups = groups(ids, table);
            Grouping::new(None, Some((by_partners(&groups), ids))).is_by_radii()
        };
        assert!(decides(&[0, 1], &touch));
        let half_is_no_f32 = f64::from(0.3_f32) != 0.3;
        assert!(half_is_no_f32 && decides(&[0, 1], &within));
        within.set(0, 1, Interaction::Within(0.3 * (1.0 - 1e-7))).expect("species of the table");
        assert!(!decides(&[0, 1], &within), "more than rounding");
        for beyond_f32 in [1e-45, 1e-300, 1e300] {
            within.set(2, 2, Interaction::Within(beyond_f32)).expect("species of the table");
            assert!(!decides(&[2], &within), "{beyond_f32}");
        }
        within.set(0, 0, Interaction::Within(0.5)).expect("species of the table");
        within.set(1, 1, Interaction::Within(0.25)).expect("species of the table");
        within.set(1, 2, Interaction::Within(0.75)).expect("species of the table");
        assert!(decides(&[0], &within) && !decides(&[1, 2], &within));
        assert!(decides(&[1], &within), "the species at another distance is absent");
        let mut mixed = touch.clone();
        mixed.set(0, 1, Interaction::Within(0.5)).expect("species of the table");
        assert!(!decides(&[0, 1], &mixed) && decides(&[0], &mixed));
    }

    #[test]
    fn radii_cover_only_present_species() {
        let mut table = Interactions::new(3, Interaction::Within(0.5)).expect("a table");
        table.set(0, 1, Interaction::Within(8.0)).expect("species of the table");
        let half = |ids: &[u32]| groups(ids, &table).species_radii()[0].largest_half;
        assert_eq!([half(&[0, 2]), half(&[0, 1, 2]), half(&[1, 2])], [0.25, 4.0, 0.0]);
    }

    #[test]
    fn species_with_the_same_partners_are_divided_by_distance() {
        let mut table = Interactions::new(3, Interaction::Within(8.0)).expect("a table");
        table.set(0, 0, Interaction::Within(0.5)).expect("species of the table");
        let groups = groups(&[0, 1, 2], &table);
        assert!(groups.finer_divisions().eq([Division::ByDistance]));
        let by_distance = groups.partition(Division::ByDistance);
        assert_eq!((&by_distance.of_species[..], by_distance.count), (&[0, 1, 1][..], 2));
        assert_eq!([0, 1].map(|species| by_distance.narrow[species].largest_half), [0.25, 4.0]);
        assert!(groups.partition(Division::Merged).narrow.is_empty());
        table.set(0, 0, Interaction::Within(7.0)).expect("species of the table");
        assert!(self::groups(&[0, 1, 2], &table).partition(Division::ByDistance).narrow.is_empty());
    }

    fn halves_in_frame(groups: &mut SpeciesGroups, counts: [usize; 3], table: &Interactions) -> [f64; 3] {
        let ids: Vec<u32> = (0..).zip(counts).flat_map(|(id, count)| vec![id; count]).collect();
        let spheres = vec![Sphere::default(); ids.len()];
        let query = Spheres::from(&spheres).with_species(&ids).expect("as many").into();
        groups.update(&query, table, Executor::Caller).expect("nothing fails");
        groups.choose_radii(&query, table).expect("there is memory");
        [0, 1, 2].map(|species| groups.species_radii_in_frame(10.0)[species].largest_half)
    }

    #[test]
    fn partners_of_a_crowd_have_the_rest_of_the_distance_in_a_frame() {
        let mut table = Interactions::new(3, Interaction::Within(8.0)).expect("a table");
        table.set(0, 0, Interaction::Within(0.5)).expect("species of the table");
        let mut groups = self::groups(&[0, 1, 2], &table);
        assert_eq!(groups.species_radii_in_frame(10.0)[0].largest_half, 4.0, "of a search by distances");
        assert_eq!(halves_in_frame(&mut groups, [5000, 2, 2], &table), [0.25, 7.75, 7.75]);
        assert_eq!(groups.species_radii_in_frame(7.0)[0].largest_half, 4.0, "a radius is larger");
        let version = groups.version();
        assert_eq!(halves_in_frame(&mut groups, [2000, 300, 300], &table)[0], 0.25, "the same choice");
        assert_eq!(groups.version(), version);
        assert_eq!(halves_in_frame(&mut groups, [2, 5000, 5000], &table), [4.0; 3]);
        assert_ne!(groups.version(), version, "of other radii");
        table.set(0, 0, Interaction::Touch).expect("species of the table");
        let halves = halves_in_frame(&mut SpeciesGroups::default(), [5000, 2, 2], &table);
        assert_eq!(halves, [4.0; 3], "radii may be large");
    }

    #[test]
    fn of_two_narrow_groups_that_pair_the_larger_is_chosen() {
        let mut table = Interactions::new(3, Interaction::Within(8.0)).expect("a table");
        for (species, distance) in [(0, 3.0), (1, 0.125), (2, 0.5)] {
            table.set(species, species, Interaction::Within(distance)).expect("species of the table");
        }
        let halves = |counts| halves_in_frame(&mut SpeciesGroups::default(), counts, &table);
        assert_eq!(halves([100, 9000, 100]), [7.9375, 0.0625, 7.9375]);
        assert_eq!(halves([9000, 100, 100]), [1.5, 6.5, 6.5]);
        assert_eq!(halves([3000, 3000, 3000]), [4.0; 3]);
    }

    #[test]
    fn sets_meet_each_other_only() {
        let mut table = Interactions::new(2, Interaction::Never).expect("a table");
        table.set(0, 1, Interaction::Touch).expect("species of the table");
        let ids = [0, 1, 0, 1];
        let groups = groups(&ids, &table);
        let grouping = Grouping::new(Some(2), Some((by_partners(&groups), &ids)));
        assert_eq!([0, 1, 2, 3].map(|id| grouping.group_of(id)), [0, 1, 2, 3]);
        let groups_pair = |a: usize, b: usize| grouping.group_interaction(a, b).is_some();
        assert!(!groups_pair(0, 1) && !groups_pair(0, 2) && groups_pair(0, 3) && groups_pair(1, 2));
        let sets = Grouping::new(Some(2), None);
        assert_eq!(
            (sets.count(), sets.group_interaction(0, 0), sets.group_interaction(1, 0)),
            (2, None, Some(GroupInteraction::ANY))
        );
    }
}
