//! The exact filter after the broad phase: groups, exclusions and, in a frame, contact.

use lazygrid_kernels::{Exclusions, Interactions, Query, Space, Spheres};

/// Decides which found pairs are reported. Indices of a second set follow those of the first.
#[derive(Clone, Debug)]
pub struct PairFilter<'a> {
    query: Query<'a>,
    /// The space and the table that decide contact, if the spheres are searched in a frame.
    contact: Option<(&'a Space, Option<&'a Interactions>)>,
    has_groups: bool,
}

impl<'a> PairFilter<'a> {
    /// Creates the filter of a query; `None` if the search decides. `contact` has the space and the table if spheres
    /// are searched in a frame. Species ids and exclusions are checked already.
    pub(crate) fn new(
        query: Query<'a>,
        contact: Option<(&'a Space, Option<&'a Interactions>)>,
    ) -> Option<Self> {
        // Spheres of one set only never share a group with any of the other.
        let has_groups =
            query.first().groups().is_some() && query.second().is_none_or(|second| second.groups().is_some());
        let is_needed = contact.is_some() || has_groups || query.exclusions().is_some();
        is_needed.then_some(Self { query, contact, has_groups })
    }

    /// Returns `true` if it decides contact too, so that a search finds candidates only.
    pub fn decides_contact(&self) -> bool {
        self.contact.is_some()
    }

    /// Returns `true` if it decides only contact, by radii.
    pub(crate) fn is_contact_of_radii(&self) -> bool {
        let is_by_radii = matches!(self.contact, Some((_, None)));
        is_by_radii && !self.has_groups && self.query.exclusions().is_none()
    }

    /// Returns `true` if two spheres that the broad phase has found are a pair.
    pub fn accepts(&self, i: u32, j: u32) -> bool {
        // The exclusion lookup is the slowest test, so it comes last.
        !(self.has_groups && self.are_of_one_group(i, j))
            && self.contact.is_none_or(|(space, table)| self.touch(space, table, i.min(j), i.max(j)))
            && !self.query.exclusions().is_some_and(|exclusions| self.are_listed(exclusions, i, j))
    }

    fn of(&self, k: u32) -> (Spheres<'a>, usize) {
        let (k, first) = (k as usize, self.query.first());
        match self.query.second() {
            Some(second) if k >= first.len() => (second, k - first.len()),
            _ => (first, k),
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
        match self.query.split() {
            None => exclusions.contains(i, j),
            Some(split) => exclusions.contains(i.min(j), i.max(j) - split as u32),
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
