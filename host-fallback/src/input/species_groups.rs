//! Species grouped by their partners, so a search compares only spheres that may pair.
//!
//! Present species with the same present partners share a group.

#![expect(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "lists have at most MAX_PRESENT species or MAX_GROUPS groups"
)]

use lazygrid_kernels::{EffectiveRadius, Interaction, Interactions};

use crate::Error;
use crate::executor::Executor;

/// All further groups share the last one.
pub(crate) const MAX_GROUPS: usize = 8;
/// Grouping takes quadratic time.
const MAX_PRESENT: usize = 512;
const CHUNK_SPHERES: usize = 1 << 14;
/// Largest sum of two effective radii, as a multiple of the distance that they stand for: rounding up adds one ulp, or
/// 4 of the 16 half ulps of the filter's band in the square.
const ROUNDED_UP: f64 = 1.0 + f32::EPSILON as f64;
const WORDS: usize = Interactions::MAX_SPECIES as usize / 64;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Meeting {
    pub(crate) touches: bool,
    /// Largest distance of a pair, or 0.
    pub(crate) distance: f64,
    /// Touching effective radii decide pairs of the groups, up to rounding.
    pub(crate) is_by_radii: bool,
}

impl Meeting {
    pub(crate) const ANY: Self = Self { touches: true, distance: f64::INFINITY, is_by_radii: false };

    fn of(species: impl Iterator<Item = (u32, u32)>, table: &Interactions) -> Option<Self> {
        let none = Self { touches: false, distance: 0.0, is_by_radii: true };
        let (meeting, pairs) = species.fold((none, false), |(mut meeting, pairs), (a, b)| {
            let interaction = table.get(a, b);
            let is_by_radii = [a, b].into_iter().all(|species| {
                let EffectiveRadius { touches, half } = table.effective_radius(species);
                match interaction {
                    Interaction::Never => false,
                    Interaction::Touch => half == 0.0,
                    Interaction::Within(distance) => {
                        !touches && (distance..=ROUNDED_UP * distance).contains(&(2.0 * f64::from(half)))
                    }
                }
            });
            meeting.is_by_radii &= is_by_radii;
            match interaction {
                Interaction::Never => return (meeting, pairs),
                Interaction::Touch => meeting.touches = true,
                Interaction::Within(distance) => meeting.distance = meeting.distance.max(distance),
            }
            (meeting, true)
        });
        pairs.then_some(meeting)
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpeciesPartition {
    pub(super) of_species: Vec<u8>,
    pub(super) count: usize,
    /// Indexed by two groups, row by row; `None` if they never pair.
    pub(super) meetings: Vec<Option<Meeting>>,
}

impl SpeciesPartition {
    fn new(of_species: Vec<u8>, count: usize, present: &[u32], table: &Interactions) -> Self {
        let members = |group: usize| {
            let of_species = &of_species;
            present.iter().copied().filter(move |&s| usize::from(of_species[s as usize]) == group)
        };
        let meeting =
            |a: usize, b: usize| Meeting::of(members(a).flat_map(|s| members(b).map(move |t| (s, t))), table);
        let meetings = (0..count * count).map(|k| meeting(k / count, k % count)).collect();
        Self { of_species, count, meetings }
    }

    pub fn of_table(table: &Interactions) -> Self {
        let all: Vec<u32> = (0..table.species()).collect();
        let [by_partners, _] = Self::of_present(&all, table);
        by_partners
    }

    /// Returns two divisions of the species `present`: by partners, and with all that pair in one group.
    fn of_present(present: &[u32], table: &Interactions) -> [Self; 2] {
        if present.len() > MAX_PRESENT {
            return [(); 2].map(|()| Self::undivided(table.species()));
        }
        let (groups, count) = group_by_partners(present, table);
        // Without spheres there is one group of no species.
        let count = count.max(usize::from(present.is_empty()));
        let is_idle = groups.iter().any(|group| group.is_none());
        let partition = |group: &dyn Fn(usize) -> usize, count: usize| {
            let mut of_species = vec![0; table.species() as usize];
            for (&species, own) in present.iter().zip(&groups) {
                of_species[species as usize] = own.map_or(count, group) as u8;
            }
            Self::new(of_species, count + usize::from(is_idle), present, table)
        };
        [partition(&|own| own, count), partition(&|_| 0, count.min(1))]
    }

    pub fn count(&self) -> usize {
        self.count
    }

    pub fn group_of(&self, species: u32) -> usize {
        self.of_species[species as usize].into()
    }

    pub fn meets(&self, a: usize, b: usize) -> bool {
        self.meetings[a * self.count + b].is_some()
    }

    /// Returns `true` for a group that meets none.
    pub fn is_idle(&self, group: usize) -> bool {
        (0..self.count).all(|other| !self.meets(group, other))
    }

    fn undivided(species: u32) -> Self {
        Self { of_species: vec![0; species as usize], count: 1, meetings: vec![Some(Meeting::ANY)] }
    }
}

#[derive(Debug)]
pub(crate) struct SpeciesGroups {
    present: [u64; WORDS],
    by_partners: SpeciesPartition,
    merged: SpeciesPartition,
    version: u32,
}

impl Default for SpeciesGroups {
    fn default() -> Self {
        let (by_partners, merged) = Default::default();
        Self { present: [0; WORDS], by_partners, merged, version: 0 }
    }
}

impl SpeciesGroups {
    /// `table` must be the same in every call.
    pub(crate) fn update(
        &mut self,
        ids: &[u32],
        table: &Interactions,
        executor: Executor,
    ) -> Result<(), Error> {
        let found = find_present(ids, table.species(), executor)?;
        if found == self.present && self.version > 0 {
            return Ok(());
        }
        (self.present, self.version) = (found, self.version.wrapping_add(1).max(1));
        let is_present = |s: &u32| found[*s as usize / 64] >> (s % 64) & 1 == 1;
        let present: Vec<u32> = (0..table.species()).filter(is_present).collect();
        [self.by_partners, self.merged] = SpeciesPartition::of_present(&present, table);
        Ok(())
    }

    pub(crate) fn partition(&self, is_separate: bool) -> &SpeciesPartition {
        if is_separate { &self.by_partners } else { &self.merged }
    }

    pub(crate) fn are_several(&self) -> bool {
        self.by_partners.count > self.merged.count
    }

    pub(crate) fn version(&self) -> u32 {
        self.version
    }
}

fn find_present(ids: &[u32], species: u32, executor: Executor) -> Result<[u64; WORDS], Error> {
    let piece = |mut seen: [u64; WORDS], piece: usize| {
        let ids = &ids[piece * CHUNK_SPHERES..ids.len().min((piece + 1) * CHUNK_SPHERES)];
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
    executor.for_light_work(ids.len()).fold(
        (ids.len().div_ceil(CHUNK_SPHERES), usize::MAX),
        || [0; WORDS],
        piece,
        merge,
    )
}

/// `None` for species without partners. Also returns the number of groups.
fn group_by_partners(present: &[u32], table: &Interactions) -> (Vec<Option<usize>>, usize) {
    let mut partners: Vec<[u64; MAX_PRESENT / 64]> = Vec::new();
    let groups: Vec<_> = present
        .iter()
        .map(|&species| {
            let mut own = [0; MAX_PRESENT / 64];
            for (k, &other) in present.iter().enumerate() {
                let pairs = table.get(species, other) != Interaction::Never;
                own[k / 64] |= u64::from(pairs) << (k % 64);
            }
            if own.iter().all(|&word| word == 0) {
                return None;
            }
            let known = partners.iter().position(|partners| *partners == own);
            let group = known.unwrap_or_else(|| {
                partners.push(own);
                partners.len() - 1
            });
            Some(group.min(MAX_GROUPS - 1))
        })
        .collect();
    (groups, partners.len().min(MAX_GROUPS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::Grouping;

    fn groups(ids: &[u32], table: &Interactions) -> SpeciesGroups {
        let mut groups = SpeciesGroups::default();
        groups.update(ids, table, Executor::Caller).expect("nothing fails");
        groups
    }

    fn of(ids: &[u32], table: &Interactions) -> Vec<u8> {
        let groups = groups(ids, table);
        ids.iter().map(|&species| groups.by_partners.of_species[species as usize]).collect()
    }

    #[test]
    fn ring_of_reactions_has_two_groups() {
        let mut table = Interactions::new(4, Interaction::Never).expect("a table");
        for species in 0..4 {
            table.set(species, (species + 1) % 4, Interaction::Within(1.0)).expect("species of the table");
        }
        assert_eq!(of(&[0, 1, 2, 3], &table), [0, 1, 0, 1]);
        let groups = groups(&[3, 2, 1, 0], &table);
        let meeting = Some(Meeting { touches: false, distance: 1.0, is_by_radii: true });
        assert_eq!(groups.by_partners.meetings, [None, meeting, meeting, None]);
        assert!(!groups.merged.meetings[0].expect("some pair").is_by_radii);
        assert_eq!((groups.by_partners.count, groups.merged.count), (2, 1));
        assert!(groups.are_several());
    }

    #[test]
    fn species_without_present_partner_is_idle() {
        let mut table = Interactions::new(3, Interaction::Never).expect("a table");
        table.set(0, 1, Interaction::Touch).expect("species of the table");
        assert_eq!(of(&[0, 2, 1], &table), [0, 2, 1]);
        assert_eq!(of(&[0, 2], &table), [0, 0], "its partner is absent");
        let mut groups = groups(&[0, 1, 2], &table);
        let grouping = Grouping::new(None, Some((groups.partition(true), &[0, 1, 2])));
        assert!((0..3).all(|other| grouping.meeting(2, other).is_none()));
        assert_eq!(groups.merged.of_species, [0, 0, 1]);
        groups.update(&[2], &table, Executor::Caller).expect("nothing fails");
        assert_eq!((groups.merged.count, groups.merged.meetings[0], groups.version()), (1, None, 2));
    }

    #[test]
    fn groups_beyond_the_most_share_one() {
        let mut table = Interactions::new(100, Interaction::Never).expect("a table");
        for species in 0..100 {
            table.set(species, species, Interaction::Touch).expect("species of the table");
        }
        let all: Vec<u32> = (0..100).collect();
        let groups = groups(&all, &table);
        assert_eq!(groups.by_partners.count, MAX_GROUPS);
        let meeting = |a: usize, b: usize| groups.by_partners.meetings[a * MAX_GROUPS + b];
        assert_eq!(meeting(0, 0).map(|of| of.is_by_radii), Some(true));
        assert_eq!(meeting(0, 1), None);
        assert_eq!(meeting(MAX_GROUPS - 1, MAX_GROUPS - 1).map(|of| of.is_by_radii), Some(false));
    }

    #[test]
    fn radii_decide_only_if_no_species_has_another_distance() {
        let touch = Interactions::new(2, Interaction::Touch).expect("a table");
        let mut within = Interactions::new(3, Interaction::Within(0.3)).expect("a table");
        let decides = |ids: &[u32], table: &Interactions| {
            let groups = groups(ids, table);
            Grouping::new(None, Some((groups.partition(true), ids))).is_by_radii()
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
        assert!(decides(&[0], &within));
        assert!(
            !decides(&[1], &within),
            "the effective radius is that of the distance with an absent species"
        );
        let mut mixed = touch.clone();
        mixed.set(0, 1, Interaction::Within(0.5)).expect("species of the table");
        assert!(!decides(&[0, 1], &mixed) && !decides(&[0], &mixed));
    }

    #[test]
    fn sets_meet_each_other_only() {
        let mut table = Interactions::new(2, Interaction::Never).expect("a table");
        table.set(0, 1, Interaction::Touch).expect("species of the table");
        let ids = [0, 1, 0, 1];
        let groups = groups(&ids, &table);
        let grouping = Grouping::new(Some(2), Some((groups.partition(true), &ids)));
        assert_eq!([0, 1, 2, 3].map(|id| grouping.of(id)), [0, 1, 2, 3]);
        let meets = |a: usize, b: usize| grouping.meeting(a, b).is_some();
        assert!(!meets(0, 1) && !meets(0, 2) && meets(0, 3) && meets(1, 2));
        let sets = Grouping::new(Some(2), None);
        assert_eq!((sets.count(), sets.meeting(0, 0), sets.meeting(1, 0)), (2, None, Some(Meeting::ANY)));
    }
}
