use super::species_partition::{GroupInteraction, SpeciesPartition};
use crate::Error;
use crate::compare::PairTest;
use crate::memory::{try_collect, try_resize};

/// Groups that a search keeps apart: two sets, each divided by species.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grouping<'a> {
    split: Option<usize>,
    species: Option<(&'a SpeciesPartition, &'a [u32])>,
}

impl<'a> Grouping<'a> {
    pub(crate) fn new(split: Option<usize>, species: Option<(&'a SpeciesPartition, &'a [u32])>) -> Self {
        Self { split, species }
    }

    fn per_set(&self) -> usize {
        self.species.map_or(1, |(partition, _)| partition.count)
    }

    pub(crate) fn count(&self) -> usize {
        self.per_set() * if self.split.is_some() { 2 } else { 1 }
    }

    /// Returns the split if the two sets are the only groups.
    pub(crate) fn sets(&self) -> Option<usize> {
        self.split.filter(|_| self.species.is_none_or(|(partition, _)| partition.count == 1))
    }

    pub(crate) fn is_by_radii(&self) -> bool {
        self.species.is_some_and(|(partition, _)| {
            partition.group_interactions.iter().flatten().all(|pairs| pairs.is_by_radii)
        })
    }

    #[inline(always)]
    pub(crate) fn group_of(&self, id: usize) -> usize {
        let set = usize::from(self.split.is_some_and(|split| id >= split));
        match self.species {
            None => set,
            Some((partition, ids)) => {
                set * partition.count + usize::from(partition.of_species[ids[id] as usize])
            }
        }
    }

    /// Returns `true` if some group pairs farther with others than within itself.
    pub(crate) fn is_narrow(&self) -> bool {
        self.species.is_some_and(|(partition, _)| !partition.narrow.is_empty())
    }

    #[inline(always)]
    pub(crate) fn radius(&self, test: &PairTest<'_>, id: usize, effective: f32) -> f32 {
        match self.species {
            Some((partition, ids)) if !partition.narrow.is_empty() => {
                test.radius_within(id as u32, partition.narrow[ids[id] as usize])
            }
            _ => effective,
        }
    }

    pub(crate) fn paired(&self) -> u32 {
        self.paired_groups().fold(0, |paired, (a, b)| paired | 1 << a | 1 << b)
    }

    pub(crate) fn pairs_within(&self, group: usize) -> bool {
        self.group_interaction(group, group).is_some()
    }

    pub(crate) fn paired_groups(&self) -> impl Iterator<Item = (usize, usize)> {
        let groups = self.count();
        let all = (0..groups).flat_map(move |a| (a..groups).map(move |b| (a, b)));
        all.filter(|&(a, b)| self.group_interaction(a, b).is_some())
    }

    /// Returns `None` if the groups never pair.
    pub(crate) fn group_interaction(&self, a: usize, b: usize) -> Option<GroupInteraction> {
        let per_set = self.per_set();
        if self.split.is_some() && a / per_set == b / per_set {
            return None;
        }
        self.species.map_or(Some(GroupInteraction::ANY), |(partition, _)| {
            partition.group_interactions[a % per_set * per_set + b % per_set]
        })
    }
}

/// Writes the spheres group by group, ascending, to `order`. Returns the groups' ends.
pub(crate) fn sort_by_group(
    grouping: &Grouping<'_>,
    spheres: usize,
    order: &mut Vec<u32>,
) -> Result<Vec<usize>, Error> {
    try_resize(order, spheres, "spheres in the order of groups")?;
    let mut ends = try_collect(std::iter::repeat_n(0, grouping.count()), "groups of spheres")?;
    if let [end] = &mut *ends {
        order.iter_mut().zip(0..).for_each(|(at, id)| *at = id);
        *end = spheres;
        return Ok(ends);
    }
    (0..spheres).for_each(|id| ends[grouping.group_of(id)] += 1);
    let mut start = 0;
    for end in &mut ends {
        start += std::mem::replace(end, start);
    }
    for id in 0..spheres {
        let end = &mut ends[grouping.group_of(id)];
        order[*end] = id as u32;
        *end += 1;
    }
    Ok(ends)
}
