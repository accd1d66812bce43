use std::ops::Range;

use lazygrid_kernels::{Error, ImageVector, Pair};

use super::{CHUNK_ROWS, ContactTest, ListOptions, PeriodicImages};
use crate::compare::PairFilter;
use crate::memory::{prefetch_row, try_collect, try_push};
use crate::output::Neighbors;

/// Fraction of a length below which a difference of coordinates is the minimum image, with a margin for rounding.
const NEAR: f64 = 0.49;
/// Neighbors beyond the current row that are prefetched.
const PREFETCHED: usize = 16;

pub(super) struct Fill<'a> {
    pub contact: ContactTest<'a>,
    pub first: &'a [[f64; 4]],
    pub second: &'a [[f64; 4]],
    pub images: Option<&'a PeriodicImages>,
    pub options: ListOptions,
    /// For groups and exclusions that the search has ignored.
    pub filter: Option<PairFilter<'a>>,
    /// Indices of spheres or images.
    pub candidates: Neighbors<'a>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbor {
    pub i: u32,
    pub j: u32,
}

/// A shift of `i32::MIN` or `i32::MAX` is out of range.
struct Entry {
    pair: Pair,
    bond: ImageVector,
}

pub(super) struct OutputSlices<'s> {
    pub pairs: &'s mut [Pair],
    pub shifts: &'s mut [[i32; 3]],
    pub vectors: &'s mut [[f64; 3]],
    pub distances: &'s mut [f64],
}

impl<'s> OutputSlices<'s> {
    fn split(self, at: usize) -> (Self, Self) {
        fn split_clamped<T>(all: &mut [T], at: usize) -> (&mut [T], &mut [T]) {
            all.split_at_mut(at.min(all.len()))
        }
        let (pairs, shifts) = (split_clamped(self.pairs, at), split_clamped(self.shifts, at));
        let (vectors, distances) = (split_clamped(self.vectors, at), split_clamped(self.distances, at));
        let first = Self { pairs: pairs.0, shifts: shifts.0, vectors: vectors.0, distances: distances.0 };
        (first, Self { pairs: pairs.1, shifts: shifts.1, vectors: vectors.1, distances: distances.1 })
    }

    #[inline(always)]
    fn put(&mut self, at: usize, Entry { pair, bond }: &Entry) {
        if let Some(slot) = self.pairs.get_mut(at) {
            *slot = *pair;
        }
        if let Some(slot) = self.shifts.get_mut(at) {
            *slot = bond.shift;
        }
        if let Some(slot) = self.vectors.get_mut(at) {
            *slot = bond.vector;
        }
        if let Some(slot) = self.distances.get_mut(at) {
            *slot = bond.length();
        }
    }
}

#[inline(always)]
fn unshifted(vector: [f64; 3]) -> ImageVector {
    let mut image = ImageVector::default();
    image.vector = vector;
    image
}

pub(super) struct RowChunk<'s> {
    rows: Range<usize>,
    slices: OutputSlices<'s>,
    counts: &'s mut [u64],
    pub start: usize,
    pub filled: usize,
    pub too_far: Option<Neighbor>,
}

impl<'s> RowChunk<'s> {
    pub(super) fn all(
        fill: &Fill<'_>,
        all: OutputSlices<'s>,
        counts: &'s mut [u64],
    ) -> Result<Vec<Self>, Error> {
        let mut chunks = try_collect([].into_iter(), "chunks of a list")?;
        let (mut slices, mut start) = (all, 0);
        for (chunk, counts) in counts.chunks_mut(CHUNK_ROWS).enumerate() {
            let rows = chunk * CHUNK_ROWS..chunk * CHUNK_ROWS + counts.len();
            let offsets = fill.candidates.offsets();
            let found = (offsets[rows.end] - offsets[rows.start]) as usize;
            let count = found + if fill.options.has_self { rows.len() } else { 0 };
            let (own, rest) = slices.split(count);
            slices = rest;
            let chunk = Self { rows, slices: own, counts, start, filled: 0, too_far: None };
            try_push(&mut chunks, chunk, "chunks of a list")?;
            start += count;
        }
        Ok(chunks)
    }

    pub(super) fn fill(&mut self, fill: &Fill<'_>) {
        let near = fill.near();
        let mut requested = fill.candidates.offsets()[self.rows.start] as usize;
        for row in self.rows.clone() {
            let before = self.filled;
            fill.prefetch(&mut requested, row);
            match near {
                Some(near) => self.fill_near(fill, row as u32, near),
                None => fill.row(row as u32, |entry| self.take(&entry)),
            }
            self.counts[row - self.rows.start] = (self.filled - before) as u64;
        }
    }

    /// Uses minimum images with shift 0 for differences of coordinates below `near`.
    fn fill_near(&mut self, fill: &Fill<'_>, i: u32, near: [f64; 3]) {
        let neighbors = fill.candidates.neighbors_of(i as usize);
        let mirrored = match fill.contact.query.second() {
            None => neighbors.partition_point(|&j| j < i),
            Some(_) => 0,
        };
        let (before, after) = neighbors.split_at(mirrored);
        self.fill_side::<true>(fill, i, before, near);
        self.fill_side::<false>(fill, i, after, near);
    }

    /// If `MIRRORED`, `i` is the second sphere of the pairs.
    #[inline(always)]
    fn fill_side<const MIRRORED: bool>(
        &mut self,
        fill: &Fill<'_>,
        i: u32,
        neighbors: &[u32],
        near: [f64; 3],
    ) {
        let (a, is_open) = (fill.first[i as usize], fill.options.is_open);
        for &j in neighbors {
            let b = fill.second[j as usize];
            let along = |axis: usize| if MIRRORED { -(a[axis] - b[axis]) } else { b[axis] - a[axis] };
            let vector = [along(0), along(1), along(2)];
            let is_near = vector[0].abs() < near[0];
            let is_near = is_near & (vector[1].abs() < near[1]) & (vector[2].abs() < near[2]);
            if !is_near {
                if let Some(entry) = fill.nearest(i, j) {
                    self.take(&entry);
                }
            } else if !is_open || fill.is_closer(i, j, vector) {
                self.slices.put(self.filled, &Entry { pair: Pair { i, j }, bond: unshifted(vector) });
                self.filled += 1;
            }
        }
    }

    #[inline(always)]
    fn take(&mut self, entry: &Entry) {
        if entry.bond.shift.iter().any(|&count| count == i32::MIN || count == i32::MAX) {
            self.too_far.get_or_insert(Neighbor { i: entry.pair.i, j: entry.pair.j });
        }
        self.slices.put(self.filled, entry);
        self.filled += 1;
    }
}

impl Fill<'_> {
    /// Returns the differences below which minimum images have shift 0; `None` if rows need other images.
    fn near(&self) -> Option<[f64; 3]> {
        let ContactTest { space, .. } = self.contact;
        let is_plain = self.images.is_none() && !self.options.has_self && space.triclinic_cell().is_none();
        is_plain.then(|| space.lengths().map(|length| NEAR * length.unwrap_or(f64::INFINITY)))
    }

    /// Prefetches neighbors, whose memory accesses would take most of the time.
    #[inline]
    fn prefetch(&self, requested: &mut usize, row: usize) {
        if self.images.is_some() {
            return;
        }
        let (offsets, indices) = (self.candidates.offsets(), self.candidates.indices());
        let until = indices.len().min(offsets[row + 1] as usize + PREFETCHED);
        for &j in &indices[until.min(*requested)..until] {
            prefetch_row(self.second, j as usize);
        }
        *requested = until;
    }

    #[inline]
    fn row(&self, i: u32, mut take: impl FnMut(Entry)) {
        let candidates = self.candidates.neighbors_of(i as usize);
        match self.images {
            Some(images) => {
                candidates.iter().filter_map(|&image| self.image(images, i, image)).for_each(take);
            }
            None => {
                let mut own = self.itself(i);
                for &j in candidates {
                    let before = if j > i { own.take() } else { None };
                    before.into_iter().chain(self.nearest(i, j)).for_each(&mut take);
                }
                own.into_iter().for_each(take);
            }
        }
    }

    fn itself(&self, i: u32) -> Option<Entry> {
        let is_requested = self.options.has_self && self.contact.query.second().is_none();
        if !is_requested || self.cutoff(i, i)? <= 0.0 {
            return None;
        }
        Some(Entry { pair: Pair { i, j: i }, bond: ImageVector::default() })
    }

    #[inline(never)]
    fn nearest(&self, i: u32, j: u32) -> Option<Entry> {
        let ContactTest { query, space, .. } = self.contact;
        // The order of the pair, not of the entry, decides between two equally distant images.
        let is_mirrored = query.second().is_none() && j < i;
        let (from, to) = if is_mirrored { (j, i) } else { (i, j) };
        let mut bond =
            space.minimum_image(center(self.first[from as usize]), center(self.second[to as usize]));
        if is_mirrored {
            bond.shift = bond.shift.map(|count| count.saturating_neg());
            bond.vector = bond.vector.map(|number| -number);
        }
        self.entry(i, j, bond)
    }

    #[inline(never)]
    fn image(&self, images: &PeriodicImages, i: u32, image: u32) -> Option<Entry> {
        let ContactTest { query, space, .. } = self.contact;
        let (j, shift) = images.shift(i, image);
        if query.second().is_none() && i == j && shift == [0.0; 3] {
            return self.itself(i);
        }
        let is_second_half = i > j || (i == j && shift < [0.0; 3]);
        if self.options.is_half && query.second().is_none() && is_second_half {
            return None;
        }
        let (a, b) = (self.first[i as usize], self.second[j as usize]);
        let distance = self.distance(i, j)?;
        let split = query.split().unwrap_or(0) as u32;
        if !space.touch_image(a, b, shift, distance)
            || self.filter.as_ref().is_some_and(|filter| !filter.accepts(i, split + j))
        {
            return None;
        }
        let apart = [0, 1, 2].map(|axis| b[axis] - a[axis]);
        let mut bond = ImageVector::default();
        bond.shift = shift.map(|count| count as i32);
        bond.vector = space.image(apart, shift);
        self.entry(i, j, bond)
    }

    #[inline(always)]
    fn entry(&self, i: u32, j: u32, bond: ImageVector) -> Option<Entry> {
        let is_listed = !self.options.is_open || self.is_closer(i, j, bond.vector);
        is_listed.then_some(Entry { pair: Pair { i, j }, bond })
    }

    #[inline(always)]
    fn is_closer(&self, i: u32, j: u32, vector: [f64; 3]) -> bool {
        self.cutoff(i, j)
            .is_some_and(|cutoff| is_clear(vector, cutoff) || unshifted(vector).length() < cutoff)
    }

    /// Returns the cutoff, `Some(None)` if radii decide it, and `None` if the spheres never pair.
    #[inline]
    fn distance(&self, i: u32, j: u32) -> Option<Option<f64>> {
        let ContactTest { query, table, .. } = self.contact;
        let Some(table) = table else { return Some(None) };
        let second = query.second().unwrap_or(query.first());
        let (Some(species), Some(others)) = (query.first().species(), second.species()) else {
            return Some(None);
        };
        table.get(species[i as usize], others[j as usize]).distance()
    }

    #[inline]
    fn cutoff(&self, i: u32, j: u32) -> Option<f64> {
        let radii = || self.first[i as usize][3] + self.second[j as usize][3];
        Some(self.distance(i, j)?.unwrap_or_else(radii))
    }
}

/// Returns `true`, without a square root, if a vector is shorter than `cutoff` by more than rounding.
#[inline]
fn is_clear([x, y, z]: [f64; 3], cutoff: f64) -> bool {
    const SQUARE_MARGIN: f64 = 1.0 - 1.0 / (1_u64 << 40) as f64;
    let (squared, most) = (x * x + y * y + z * z, cutoff * cutoff * SQUARE_MARGIN);
    // Squares that underflow prove nothing.
    squared < most && most > 1e-280
}

#[inline]
fn center([x, y, z, _]: [f64; 4]) -> [f64; 3] {
    [x, y, z]
}
