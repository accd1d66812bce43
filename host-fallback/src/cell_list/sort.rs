//! Sorts spheres by cell in two stable passes: into buckets of consecutive cells, then within buckets. The order does
//! not depend on threads.
//!
//! A single counting sort would miss every cache for large inputs. Bucket ends stay in cache in the first pass, and each
//! bucket in the second.

use bytemuck::Zeroable;

use super::CellLocator;
use crate::Error;
use crate::compare::{
    Columns, ColumnsMut, EffectiveLoop, EffectiveRows, PairTest, SimdTask, SimdWidth, Xyzr,
};
use crate::disjoint_writes::{DisjointSlice, split_at};
use crate::input::SearchInput;
use crate::memory::{try_collect, try_resize};

const CHUNK_SPHERES: std::ops::RangeInclusive<usize> = 1 << 12..=1 << 16;
/// Enough chunks to balance threads, few enough for a counter per chunk and bucket.
const MAX_CHUNKS: usize = 32;
/// Spheres per bucket: 48 KiB of records.
const BUCKET: usize = 1 << 11;
/// Few enough that one cache line per bucket stays in the second-level cache.
const MAX_BUCKETS: usize = 1 << 11;

#[derive(Clone, Copy, Debug, Default, Zeroable)]
#[repr(C)]
pub(crate) struct SortRecord {
    pub(crate) row: Xyzr,
    pub(crate) id: u32,
    pub(crate) key: u32,
}

#[derive(Debug, Default)]
pub(super) struct Sorter {
    keys: Vec<u32>,
    entries: Vec<SortRecord>,
    offsets: Vec<u32>,
    ends: Vec<usize>,
}

impl Sorter {
    pub(super) const BYTES_PER_SPHERE: u64 = 4 + size_of::<SortRecord>() as u64;

    pub(super) fn entries(&self) -> &[SortRecord] {
        &self.entries
    }

    pub(super) fn entries_mut(&mut self) -> &mut [SortRecord] {
        &mut self.entries
    }

    /// Entries of `starts` after the cells, which a search may read past the last cell.
    pub(super) const PADDING: usize = 3;

    /// `starts[k]` becomes the position of the first sphere of cell `k` or later. The padding repeats the end.
    pub(super) fn sort(
        &mut self,
        input: &SearchInput<'_>,
        locator: CellLocator<'_>,
        columns: &mut Columns,
        starts: &mut Vec<u32>,
    ) -> Result<(), Error> {
        let (n, cells) = (input.stats.spheres, locator.cells());
        let wanted = (n / BUCKET).next_power_of_two().min(MAX_BUCKETS);
        let shift = cells.div_ceil(wanted).next_power_of_two().trailing_zeros();
        let buckets = cells.div_ceil(1 << shift).max(1);
        try_resize(&mut self.keys, n, "cells of spheres")?;
        try_resize(&mut self.entries, n, "sorting spheres")?;
        try_resize(starts, cells + Self::PADDING, "the table of cells")?;
        let ColumnsMut { xyzr, id } = columns.resize(n)?;

        self.spread(input, locator, shift, buckets)?;
        let ends = &self.ends;
        let cut = || ends.iter().copied();
        let [x, y, z, r] = xyzr.map(|column| split_at(column, cut()));
        let columns = x?.into_iter().zip(y?).zip(z?).zip(r?).zip(split_at(id, cut())?);
        let cells = split_at(&mut starts[1..=cells], (0..buckets).map(|k| cells.min((k + 1) << shift)))?;
        let entries = split_at(&mut self.entries, cut())?;
        let mut bucket_slices =
            try_collect(entries.into_iter().zip(cells).zip(columns), "buckets of spheres")?;
        input.executor.for_each(&mut bucket_slices, |bucket, ((entries, cells), ((((x, y), z), r), id))| {
            let first = bucket << shift;
            count(entries, first, cells);
            for entry in entries.iter() {
                let next = &mut cells[entry.key as usize - first];
                let at = *next as usize;
                *next += 1;
                [x[at], y[at], z[at], r[at]] = entry.row;
                id[at] = entry.id;
            }
            // Each start has advanced to the start of the next cell.
            let before = (ends[bucket] - entries.len()) as u32;
            cells.iter_mut().for_each(|end| *end += before);
        });
        starts[0] = 0;
        starts[1 + locator.cells()..].fill(n as u32);
        Ok(())
    }

    fn spread(
        &mut self,
        input: &SearchInput<'_>,
        locator: CellLocator<'_>,
        shift: u32,
        buckets: usize,
    ) -> Result<(), Error> {
        let Self { keys, entries, offsets, ends } = self;
        let size = keys.len().div_ceil(MAX_CHUNKS).clamp(*CHUNK_SPHERES.start(), *CHUNK_SPHERES.end());
        try_resize(offsets, keys.len().div_ceil(size) * buckets, "buckets of spheres")?;
        let chunks = keys.chunks_mut(size).zip(offsets.chunks_mut(buckets));
        let mut chunks = try_collect(chunks, "buckets of spheres")?;
        input.executor.for_each(&mut chunks, |chunk, (keys, counts)| {
            let keys = &mut **keys;
            input.simd.run(Keys { test: &input.test, locator, first: chunk * size, keys }, None);
            counts.fill(0);
            for key in keys {
                counts[(*key >> shift) as usize] += 1;
            }
        });
        try_resize(ends, buckets, "buckets of spheres")?;
        let mut at = 0;
        for (bucket, end) in ends.iter_mut().enumerate() {
            for (_, counts) in &mut chunks {
                at += std::mem::replace(&mut counts[bucket], at);
            }
            *end = at as usize;
        }

        let entries = DisjointSlice::new(entries);
        input.executor.for_each(&mut chunks, |chunk, (keys, next)| {
            let mut write = |key: u32, id: usize, row: Xyzr| {
                let slot = &mut next[(key >> shift) as usize];
                // SAFETY: the exclusive prefix sums over (bucket, chunk) give every sphere a distinct slot below their
                // number, the length of `entries`.
                unsafe { entries.write(*slot as usize, SortRecord { row, id: id as u32, key }) };
                *slot += 1;
            };
            input.test.for_rows(WriteRows { keys, first: chunk * size, write: &mut write });
        });
        Ok(())
    }
}

struct Keys<'k> {
    test: &'k PairTest<'k>,
    locator: CellLocator<'k>,
    first: usize,
    keys: &'k mut [u32],
}

impl SimdTask for Keys<'_> {
    type Result = ();

    #[inline(always)]
    fn run<V: SimdWidth>(self, vector: V) {
        let Self { test, locator, first, keys } = self;
        test.for_rows(LocateRows { vector, locator, first, keys });
    }
}

struct LocateRows<'k, V> {
    vector: V,
    locator: CellLocator<'k>,
    first: usize,
    keys: &'k mut [u32],
}

impl<V: SimdWidth> EffectiveLoop for LocateRows<'_, V> {
    type Result = ();

    #[inline(always)]
    fn run(self, rows: impl EffectiveRows) {
        for (key, id) in self.keys.iter_mut().zip(self.first..) {
            *key = self.locator.cell_of(self.vector, id, rows.row(id));
        }
    }
}

struct WriteRows<'k, P> {
    keys: &'k [u32],
    first: usize,
    write: P,
}

impl<P: FnMut(u32, usize, Xyzr)> EffectiveLoop for WriteRows<'_, P> {
    type Result = ();

    #[inline(always)]
    fn run(mut self, rows: impl EffectiveRows) {
        for (&key, id) in self.keys.iter().zip(self.first..) {
            (self.write)(key, id, rows.row(id));
        }
    }
}

fn count(entries: &[SortRecord], first: usize, cells: &mut [u32]) {
    cells.fill(0);
    for entry in entries {
        cells[entry.key as usize - first] += 1;
    }
    let mut at = 0;
    for cell in cells {
        at += std::mem::replace(cell, at);
    }
}
