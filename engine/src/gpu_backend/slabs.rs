//! Division of a call with more spheres than a device can bind.
//!
//! Slabs divide one axis. A slab *owns* the spheres whose lower end it contains; its *ghosts* extend into it from
//! below.
//!
//! For a *range* of indices, only pairs whose smaller index is in the range are found. Spheres of smaller indices are
//! omitted, so the spheres of the range come first, and the search window ends with them. Pairs of two ghosts are
//! dropped: the slab that owns one of the spheres finds the pair, too.
//!
//! No range exceeds the first of two sets, which has the smaller indices. Its spheres outside the range are omitted, so
//! it also comes first in a slab.

use std::ops::Range;

use lazygrid_host::SpeciesPartition;
use lazygrid_kernels::{EffectiveRadius, Interactions, Pair, Space, Sphere, Spheres, try_reserve};

use crate::Error;

/// Spheres whose lower ends are sampled to choose boundaries.
const SAMPLE: usize = 1 << 14;
const MAX_BOUNDARIES: usize = 1 << 10;
/// Ends are moved outwards by this fraction of the radius, and of a periodic length: above the rounding error and the 4
/// ulp of a GPU.
const MARGIN: f64 = 1.0 / (1 << 20) as f64;
/// If at most one in this many spheres is a ghost, further axes are not tried.
const SPHERES_PER_GHOST: usize = 16;

#[derive(Debug)]
pub(crate) struct SlabInput<'a> {
    spheres: Spheres<'a>,
    split: u32,
    effective_radii: Vec<EffectiveRadius>,
    are_idle: Vec<bool>,
    space: Space,
}

#[derive(Debug)]
pub(crate) struct Slabs {
    axis: usize,
    /// Ascending lower ends, and the most spheres of each slab.
    slabs: Vec<(f64, usize)>,
}

#[derive(Debug, Default)]
pub(crate) struct Slab {
    /// Owned spheres of the range, ghosts of the range, other owned spheres, other ghosts.
    spheres: Vec<Sphere>,
    species: Vec<u32>,
    indices: Vec<u32>,
    /// Groups two to four, during gathering.
    later: [Vec<u32>; 3],
    /// Ends of the first three groups.
    ends: [u32; 3],
    /// `true` if the first two groups are the first set.
    has_two_sets: bool,
}

impl<'a> SlabInput<'a> {
    pub(crate) fn new(spheres: Spheres<'a>, interactions: Option<&Interactions>, space: Space) -> Self {
        let of_table = |table: &Interactions| {
            let [partition, _] = SpeciesPartition::from_table(table);
            let is_idle = |id: u32| partition.is_idle(partition.group_of(id));
            (0..table.species()).map(|id| (table.effective_radius(id), is_idle(id))).unzip()
        };
        let (effective_radii, are_idle) = interactions.map_or_else(Default::default, of_table);
        Self { spheres, split: 0, effective_radii, are_idle, space }
    }

    fn is_idle(&self, k: usize) -> bool {
        let species = self.spheres.species().filter(|_| !self.are_idle.is_empty());
        species.is_some_and(|species| self.are_idle[species[k] as usize])
    }

    pub(crate) fn across(self, split: u32) -> Self {
        Self { split, ..self }
    }

    fn first_indices(&self, range: &Range<u32>) -> Range<u32> {
        if self.split == 0 { range.clone() } else { range.start..range.end.min(self.split) }
    }

    /// Returns the ends of a sphere. On a periodic axis the lower end is wrapped; the upper end may be outside the box.
    fn ends(&self, k: usize, axis: usize) -> [f64; 2] {
        let Sphere { center, radius } = self.spheres.get(k);
        let radius = match self.spheres.species() {
            Some(species) if !self.effective_radii.is_empty() => {
                self.effective_radii[species[k] as usize].for_radius(radius)
            }
            _ => radius,
        };
        let half = f64::from(radius) * (1.0 + MARGIN);
        match self.space.lengths()[axis] {
            None => {
                let at = f64::from(center[axis]);
                [at - half, at + half]
            }
            Some(length) => {
                let (at, half) = (f64::from(self.space.wrap(center)[axis]), half + MARGIN * length);
                let begin = (at - half).max(-1.5 * length);
                let begin = if begin < -length / 2.0 { begin + length } else { begin };
                [begin, begin + 2.0 * half]
            }
        }
    }

    fn period(&self, axis: usize) -> Option<f64> {
        self.space.lengths()[axis]
    }

    /// Returns possible cuts with about equally many spheres between them; the first is below all spheres.
    fn boundaries(&self, axis: usize) -> Vec<f64> {
        let step = (self.spheres.len() / SAMPLE).max(1);
        let mut begins: Vec<f64> =
            (0..self.spheres.len()).step_by(step).map(|k| self.ends(k, axis)[0]).collect();
        begins.sort_unstable_by(f64::total_cmp);
        let mut boundaries = vec![self.period(axis).map_or(f64::NEG_INFINITY, |length| -length / 2.0)];
        boundaries.extend(begins.iter().copied().step_by(begins.len().div_ceil(MAX_BOUNDARIES).max(1)));
        boundaries.dedup();
        boundaries
    }

    /// Returns slabs of at most `most` spheres, and the number of ghosts; `None` if `axis` cannot be divided.
    fn cut(&self, axis: usize, most: usize) -> Option<(Slabs, usize)> {
        let boundaries = self.boundaries(axis);
        let period = self.period(axis);
        let mut owned = vec![0_usize; boundaries.len()];
        // Ghosts of each boundary, as differences between boundaries.
        let mut ghosts = vec![0_isize; boundaries.len() + 1];
        let interval = |end: f64| boundaries.partition_point(|&boundary| boundary <= end) - 1;
        let mut widest = 0.0_f64;
        for k in (0..self.spheres.len()).filter(|&k| !self.is_idle(k)) {
            let [begin, end] = self.ends(k, axis);
            widest = widest.max(end - begin);
            let [from, to] = [begin, end].map(interval);
            owned[from] += 1;
            ghosts[from + 1] += 1;
            ghosts[to + 1] -= 1;
            if let Some(length) = period.filter(|length| end >= length / 2.0) {
                ghosts[0] += 1;
                ghosts[interval((end - length).max(boundaries[0])) + 1] -= 1;
            }
        }
        // Narrower slabs cannot find a pair twice across the periodic boundary.
        let width = period.map_or(f64::INFINITY, |length| length - 2.0 * widest);
        let mut slabs: Vec<(f64, usize)> = Vec::new();
        let (mut ghosts_here, mut all_ghosts) = (0, 0);
        for (k, &boundary) in boundaries.iter().enumerate() {
            ghosts_here += ghosts[k];
            let ghosts = ghosts_here.max(0) as usize;
            let next =
                boundaries.get(k + 1).copied().or(period.map(|length| length / 2.0)).unwrap_or(boundary);
            let is_narrow = |begin: f64| period.is_none() || next - begin < width;
            match slabs.last_mut() {
                Some((begin, count)) if *count + owned[k] <= most && is_narrow(*begin) => *count += owned[k],
                _ if owned[k] + ghosts > most || !is_narrow(boundary) => return None,
                _ => {
                    slabs.push((boundary, owned[k] + ghosts));
                    all_ghosts += ghosts;
                }
            }
        }
        Some((Slabs { axis, slabs }, all_ghosts))
    }
}

impl Slabs {
    /// Divides the axis with the fewest ghosts into slabs of at most `most` spheres; `None` if too many spheres
    /// overlap.
    pub(crate) fn new(input: &SlabInput<'_>, most: usize) -> Option<Self> {
        let mut best: Option<(Self, usize)> = None;
        for axis in 0..3 {
            if let Some((slabs, ghosts)) = input.cut(axis, most)
                && best.as_ref().is_none_or(|(_, least)| ghosts < *least)
            {
                best = Some((slabs, ghosts));
            }
            if best.as_ref().is_some_and(|(_, least)| *least <= input.spheres.len() / SPHERES_PER_GHOST) {
                break;
            }
        }
        best.map(|(slabs, _)| slabs)
    }

    pub(crate) fn len(&self) -> usize {
        self.slabs.len()
    }

    pub(crate) fn gather(
        &self,
        number: usize,
        input: &SlabInput<'_>,
        range: &Range<u32>,
        slab: &mut Slab,
    ) -> Result<(), Error> {
        let (from, count) = self.slabs[number];
        let to = self.slabs.get(number + 1).map_or(f64::INFINITY, |slab| slab.0);
        let period = input.period(self.axis);
        let range = input.first_indices(range);
        slab.has_two_sets = input.split != 0;
        let Slab { spheres, species, indices, later, ends, .. } = slab;
        indices.clear();
        try_reserve(indices, count, "the spheres of a slab")?;
        later.iter_mut().for_each(Vec::clear);
        let is_owned = |[begin, _]: [f64; 2]| from <= begin && begin < to;
        let is_ghost = |[begin, end]: [f64; 2]| {
            begin < from && from <= end || period.is_some_and(|length| from <= end - length)
        };
        let omitted = range.end..input.split;
        for k in range.start as usize..input.spheres.len() {
            if omitted.contains(&(k as u32)) || input.is_idle(k) {
                continue;
            }
            let ends = input.ends(k, self.axis);
            let group = match (range.contains(&(k as u32)), is_owned(ends)) {
                (_, false) if !is_ghost(ends) => continue,
                (true, true) => &mut *indices,
                (true, false) => &mut later[0],
                (false, true) => &mut later[1],
                (false, false) => &mut later[2],
            };
            try_reserve(group, 1, "the spheres of a slab")?;
            group.push(k as u32);
        }
        for (group, end) in later.iter_mut().zip(ends) {
            *end = indices.len() as u32;
            try_reserve(indices, group.len(), "the spheres of a slab")?;
            indices.append(group);
        }
        spheres.clear();
        try_reserve(spheres, indices.len(), "the spheres of a slab")?;
        spheres.extend(indices.iter().map(|&k| input.spheres.get(k as usize)));
        species.clear();
        if let Some(of_all) = input.spheres.species() {
            try_reserve(species, indices.len(), "the spheres of a slab")?;
            species.extend(indices.iter().map(|&k| of_all[k as usize]));
        }
        Ok(())
    }
}

impl Slab {
    pub(crate) fn spheres(&self) -> Result<Spheres<'_>, Error> {
        let spheres = Spheres::from(&self.spheres);
        Ok(if self.species.is_empty() { spheres } else { spheres.with_species(&self.species)? })
    }

    /// Returns the size of the first of two sets: 0 for one set, and if the [window](Self::window) is empty.
    pub(crate) fn split(&self) -> u32 {
        if self.has_two_sets { self.ends[1] } else { 0 }
    }

    pub(crate) fn window(&self) -> Range<u32> {
        let [owned, of_range, _] = self.ends;
        // Without other spheres, this slab owns no pair of two ghosts.
        0..if of_range as usize == self.indices.len() { owned } else { of_range }
    }

    /// Also drops pairs of two ghosts.
    pub(crate) fn restore_indices(&self, pairs: &mut Vec<Pair>) {
        let [owned, of_range, others] = self.ends;
        let is_owned = |k: u32| k < owned || (of_range..others).contains(&k);
        pairs.retain_mut(|pair| {
            let is_retained = is_owned(pair.i) || is_owned(pair.j);
            let [a, b] = [pair.i, pair.j].map(|k| self.indices[k as usize]);
            (pair.i, pair.j) = (a.min(b), a.max(b));
            is_retained
        });
    }
}

#[cfg(test)]
mod tests;
