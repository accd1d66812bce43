//! The species of most spheres, whose narrow group should have the small cells: of several such groups that pair with
//! each other, a device keeps them for one.

use lazygrid_host::sample_species;
use lazygrid_kernels::{Interactions, Query, try_reserve};

use crate::Error;
use crate::gpu::plan::Sides;

/// A species replaces the last most frequent one only at or above this ratio of their numbers, because other sides need
/// new buffers on the device.
const MIN_RATIO: f64 = 4.0;
const MAX_PATIENCE: u32 = 255;

#[derive(Debug, Default)]
pub(super) struct FrequentSpecies {
    searched: Option<u32>,
    waited: u32,
    /// Value of `waited` at which the species changes; it doubles with each change.
    patience: u32,
    counts: Vec<f64>,
}

impl FrequentSpecies {
    pub(super) fn searched(&self) -> Option<u32> {
        self.searched
    }

    /// Returns a new most frequent species that needs other sides. After the device has accepted these, the species
    /// must be [recorded](Self::record).
    pub(super) fn next(&mut self, query: &Query<'_>, table: &Interactions) -> Result<Option<u32>, Error> {
        let Self { searched, waited, patience, counts } = self;
        counts.clear();
        try_reserve(counts, table.species() as usize, "counts of species")?;
        counts.resize(table.species() as usize, 0.0);
        sample_species(query, |species, spheres| counts[species as usize] += spheres);
        let most = (0..).zip(&*counts).max_by(|(_, a), (_, b)| a.total_cmp(b));
        let Some((most_frequent, &spheres)) = most else { return Ok(None) };
        let of_searched = searched.map_or(0.0, |species| counts[species as usize]);
        if *searched == Some(most_frequent) || spheres < MIN_RATIO * of_searched.max(1.0) {
            *waited = 0;
            return Ok(None);
        }
        if waited < patience {
            *waited += 1;
            return Ok(None);
        }
        (*waited, *patience) = (0, (2 * *patience + 1).min(MAX_PATIENCE));
        let narrow = |species| Sides::narrow_species(table, species);
        if narrow(Some(most_frequent)) != narrow(*searched) {
            return Ok(Some(most_frequent));
        }
        *searched = Some(most_frequent);
        Ok(None)
    }

    pub(super) fn record(&mut self, species: u32) {
        self.searched = Some(species);
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::{Interaction, Sphere, Spheres};

    use super::*;

    fn table(distances: [f64; 2]) -> Interactions {
        let mut table = Interactions::new(3, Interaction::Never).expect("few species");
        for (a, b, distance) in [(0, 0, distances[0]), (1, 1, distances[1]), (0, 1, 8.0)] {
            table.set(a, b, Interaction::Within(distance)).expect("known species");
        }
        table
    }

    fn follow(frequent: &mut FrequentSpecies, counts: [usize; 3], table: &Interactions) -> Option<u32> {
        let ids: Vec<u32> = (0..).zip(counts).flat_map(|(species, count)| vec![species; count]).collect();
        let spheres = vec![Sphere::default(); ids.len()];
        let query = Query::from(Spheres::from(&spheres).with_species(&ids).expect("one each"));
        let next = frequent.next(&query, table).expect("there is memory");
        next.into_iter().for_each(|species| frequent.record(species));
        next
    }

    #[test]
    fn frequent_species_changes_with_the_narrow_side_only() {
        let (table, mut frequent) = (table([0.5, 0.125]), FrequentSpecies::default());
        assert_eq!(follow(&mut frequent, [9000, 10, 10], &table), Some(0));
        assert_eq!(follow(&mut frequent, [9000, 10, 10], &table), None, "the same species");
        assert_eq!(follow(&mut frequent, [100, 300, 10], &table), None, "hardly larger");
        assert_eq!(frequent.searched(), Some(0));
        let mut frequent = FrequentSpecies::default();
        assert_eq!(follow(&mut frequent, [10, 9000, 10], &table), None, "the narrower group");
        assert_eq!(frequent.searched(), Some(1));
        assert_eq!(follow(&mut FrequentSpecies::default(), [10, 10, 9000], &table), None, "not narrow");
        assert_eq!(follow(&mut FrequentSpecies::default(), [0; 3], &table), None);
        assert_eq!(follow(&mut FrequentSpecies::default(), [9000, 10, 10], &self::table([4.0, 0.125])), None);
    }

    #[test]
    fn alternating_frequent_species_seldom_change_the_sides() {
        let (table, mut frequent) = (table([0.5, 0.125]), FrequentSpecies::default());
        let mut changes = |counts, calls: usize| {
            (0..calls).filter(|_| follow(&mut frequent, counts, &table).is_some()).count()
        };
        let [first, second] = [[9000, 10, 10], [10, 9000, 10]];
        assert_eq!(changes(first, 1), 1);
        assert_eq!([second, first].map(|counts| (0..50).map(|_| changes(counts, 1)).sum::<usize>()), [1, 1]);
        let alternating: usize = (0..50).map(|_| changes(second, 1) + changes(first, 1)).sum();
        assert_eq!(alternating, 0);
        assert_eq!([1, 1, 1].map(|_| changes(second, 300)), [1, 0, 0], "after some calls");
    }
}
