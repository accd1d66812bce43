//! The exact filter after the broad phase: groups, exclusions and, in a frame, contact.

use std::sync::atomic::Ordering::Relaxed;

use lazygrid_kernels::{Exclusions, Interactions, Pair, Query, Space, Spheres};

use crate::disjoint_writes::{close_gaps, shared};
use crate::executor::Executor;
use crate::memory::try_collect;

/// About 0.2 ms (50 ns per pair of distant spheres).
const CHUNK_PAIRS: usize = 1 << 12;

/// A filter of found pairs. Indices of a second set follow the first.
#[derive(Clone, Debug)]
pub struct PairFilter<'a> {
    first: Spheres<'a>,
    second: Option<Spheres<'a>>,
    exclusions: Option<&'a Exclusions>,
    contact: Option<(&'a Space, Option<&'a Interactions>)>,
    has_groups: bool,
}

impl<'a> PairFilter<'a> {
    /// Returns `None` if no filter is needed. Species ids and exclusions must be valid.
    pub(crate) fn new(
        query: Query<'a>,
        contact: Option<(&'a Space, Option<&'a Interactions>)>,
    ) -> Option<Self> {
        let (first, second, exclusions) = (query.first(), query.second(), query.exclusions());
        let has_groups = first.groups().is_some() && second.is_none_or(|second| second.groups().is_some());
        let is_needed = contact.is_some() || has_groups || exclusions.is_some();
        is_needed.then_some(Self { first, second, exclusions, contact, has_groups })
    }

    /// Returns `true` if the filter decides contact, so that a search finds only candidates.
    pub fn decides_contact(&self) -> bool {
        self.contact.is_some()
    }

    /// Returns `true` without groups and exclusions.
    pub(crate) fn is_contact(&self) -> bool {
        !self.has_groups && self.exclusions.is_none()
    }

    pub(crate) fn is_by_radii(&self) -> bool {
        matches!(self.contact, Some((_, None)))
    }

    /// Returns `true` if the found spheres `i` and `j` pair.
    pub fn accepts(&self, i: u32, j: u32) -> bool {
        // The exclusion lookup is the slowest test, so it comes last.
        !(self.has_groups && self.are_of_one_group(i, j))
            && self.contact.is_none_or(|(space, table)| self.touch(space, table, i.min(j), i.max(j)))
            && !self.exclusions.is_some_and(|exclusions| self.are_listed(exclusions, i, j))
    }

    /// Removes rejected pairs, in parallel and without changing the order.
    pub fn retain(&self, pairs: &mut Vec<Pair>, executor: Executor) {
        let accepts = |pair: &Pair| self.accepts(pair.i, pair.j);
        let none_kept = std::iter::repeat_n(0_u32, pairs.len().div_ceil(CHUNK_PAIRS));
        let Ok(mut kept) = try_collect(none_kept, "chunks of pairs") else {
            return pairs.retain(accepts);
        };
        let counts = shared(&mut kept);
        executor.for_each_chunk(pairs, CHUNK_PAIRS, |chunk, pairs| {
            let mut count = 0;
            for k in 0..pairs.len() {
                if accepts(&pairs[k]) {
                    pairs[count] = pairs[k];
                    count += 1;
                }
            }
            counts[chunk].store(count as u32, Relaxed);
        });
        close_gaps(pairs, kept.iter().zip(0..).map(|(&count, chunk)| (chunk * CHUNK_PAIRS, count as usize)));
    }

    #[inline]
    fn of(&self, k: u32) -> (&Spheres<'a>, usize) {
        let (k, split) = (k as usize, self.first.len());
        match &self.second {
            Some(second) if k >= split => (second, k - split),
            _ => (&self.first, k),
        }
    }

    fn group(&self, k: u32) -> u32 {
        let (set, k) = self.of(k);
        set.groups().map_or(Spheres::NO_GROUP, |groups| groups[k])
    }

    fn are_of_one_group(&self, i: u32, j: u32) -> bool {
        let group = self.group(i);
        group != Spheres::NO_GROUP && group == self.group(j)
    }

    fn are_listed(&self, exclusions: &Exclusions, i: u32, j: u32) -> bool {
        match self.second {
            None => exclusions.contains(i, j),
            Some(_) => exclusions.contains(i.min(j), i.max(j) - self.first.len() as u32),
        }
    }

    fn touch(&self, space: &Space, table: Option<&Interactions>, i: u32, j: u32) -> bool {
        let [(of_a, a), (of_b, b)] = [i, j].map(|k| self.of(k));
        let distance = match (table, of_a.species(), of_b.species()) {
            (Some(table), Some(species), Some(others)) => {
                let Some(distance) = table.get(species[a], others[b]).distance() else { return false };
                distance
            }
            _ => None,
        };
        space.touch(of_a.get_f64(a), of_b.get_f64(b), distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn retained_pairs_keep_their_order_on_any_number_of_threads() {
        let count = 3 * CHUNK_PAIRS as u32 + 5;
        let rows = vec![[0.0_f64; 4]; count as usize + 1];
        let is_listed = |k: u32| k.is_multiple_of(7) || k / CHUNK_PAIRS as u32 == 1 || k == count - 1;
        let listed = (0..count).filter(|&k| is_listed(k)).map(|k| (k, k + 1));
        let exclusions = Exclusions::new(rows.len(), listed).expect("all are in range");
        let query = Query::new(&rows).without(&exclusions);
        let filter = PairFilter::new(query, None).expect("exclusions need a filter");
        for executor in [Executor::Caller, Executor::Pool] {
            let mut pairs: Vec<_> = (0..count).rev().map(|k| Pair { i: k, j: k + 1 }).collect();
            filter.retain(&mut pairs, executor);
            let expected = (0..count).rev().filter(|&k| !is_listed(k));
            assert!(pairs.iter().map(|pair| pair.i).eq(expected), "{executor:?}");
        }
        filter.retain(&mut Vec::new(), Executor::Pool);
    }
}
