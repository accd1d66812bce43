//! The exact filter after the broad phase: groups, exclusions and, in a frame, contact.

use lazygrid_kernels::{Exclusions, Interactions, Query, Space, Spheres};

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

    pub(crate) fn is_contact_of_radii(&self) -> bool {
        self.is_contact() && matches!(self.contact, Some((_, None)))
    }

    /// Returns `true` if the found spheres `i` and `j` pair.
    pub fn accepts(&self, i: u32, j: u32) -> bool {
        // The exclusion lookup is the slowest test, so it comes last.
        !(self.has_groups && self.are_of_one_group(i, j))
            && self.contact.is_none_or(|(space, table)| self.touch(space, table, i.min(j), i.max(j)))
            && !self.exclusions.is_some_and(|exclusions| self.are_listed(exclusions, i, j))
    }

    #[inline]
    fn locate(&self, k: u32) -> (&Spheres<'a>, usize) {
        let (k, split) = (k as usize, self.first.len());
        match &self.second {
            Some(second) if k >= split => (second, k - split),
            _ => (&self.first, k),
        }
    }

    fn group(&self, k: u32) -> u32 {
        let (set, k) = self.locate(k);
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
        let [(of_a, a), (of_b, b)] = [i, j].map(|k| self.locate(k));
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
