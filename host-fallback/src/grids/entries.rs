//! (cell, sphere) entries, one for every cell that a sphere overlaps, sorted by cell and corner mask.

use glam::UVec3;

use super::uniform_grid::{ALL_AXES, CellBox, UniformGrid};
use crate::Error;
use crate::disjoint_writes::split_at;
use crate::executor::Executor;
use crate::input::{Division, SearchInput};
use crate::memory::{try_reserve, try_resize};
use crate::radix::{KeyedSphere, Radix, RadixKey};
use crate::report::Report;

const CHUNK_SPHERES: usize = 1 << 14;
/// Low bits of a key for the corner mask.
pub(crate) const MASK_BITS: u32 = 3;

impl<K: RadixKey> KeyedSphere<K> {
    #[inline(always)]
    pub(crate) fn cell(self) -> K {
        self.key.without(MASK_BITS)
    }
}

/// Bits of a key: the cell relative to the lowest one, as wide as the highest needs, then the corner mask.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct KeyLayout {
    low: UVec3,
    bits: UVec3,
}

impl KeyLayout {
    pub(crate) fn new(low: UVec3, high: UVec3) -> Self {
        let bits = (high - low).to_array().map(|extent| u32::BITS - extent.leading_zeros());
        Self { low, bits: bits.into() }
    }

    pub(crate) fn bits(&self) -> u32 {
        self.bits.element_sum() + MASK_BITS
    }

    fn is_narrow(&self) -> bool {
        self.bits() <= u32::BITS
    }

    #[inline(always)]
    pub(crate) fn key<K: RadixKey>(&self, cell: UVec3, corner_mask: u8) -> K {
        let at = cell - self.low;
        let number = K::from(at.z).append(at.y, self.bits.y).append(at.x, self.bits.x);
        number.append(u32::from(corner_mask), MASK_BITS)
    }

    pub(crate) fn cell<K: RadixKey>(&self, key: K) -> UVec3 {
        let mut number = key.without(MASK_BITS);
        let mut take = |bits: u32| {
            let axis = u64::from(number.low()) & ((1 << bits) - 1);
            number = number.without(bits);
            axis as u32
        };
        let (x, y) = (take(self.bits.x), take(self.bits.y));
        self.low + UVec3::new(x, y, number.low())
    }
}

#[derive(Debug, Default)]
pub(crate) struct Entries {
    pub(crate) grid: UniformGrid,
    layout: KeyLayout,
    offsets: Vec<usize>,
    /// Keys of 32 bits suffice unless space has very many cells.
    narrow: Radix<u32>,
    /// Three coordinates of 32 bits always fit.
    wide: Radix<u128>,
}

pub(crate) trait Visit {
    type Result;
    fn visit<K: RadixKey>(self, entries: &[KeyedSphere<K>], layout: KeyLayout) -> Self::Result;
}

impl Entries {
    pub(crate) fn build(&mut self, input: &SearchInput<'_>, report: &mut Report) -> Result<(), Error> {
        match input.is_periodic() {
            true => self.build_in::<true>(input, report),
            false => self.build_in::<false>(input, report),
        }
    }

    fn build_in<const PERIODIC: bool>(
        &mut self,
        input: &SearchInput<'_>,
        report: &mut Report,
    ) -> Result<(), Error> {
        let stats = &input.stats;
        let (n, ratio) = (stats.spheres, input.settings.cell_ratio);
        let executor = input.executor.for_light_work(n);
        let sphere = |k: usize| input.test.effective(k as u32);
        let grouping = input.grouping(Division::ByPartners);
        let paired = grouping.paired();
        let (mut grid, mut most) =
            (UniformGrid::new(stats, ratio, input.test.lengths()), most_entries(n, ratio));
        let Self { layout, offsets, narrow, wide, .. } = self;
        // A second attempt shifts the grid to the fewest entries.
        while !report.time("map", || {
            if n > 0 {
                let (low, high) = grid.bounds_of(stats.min, stats.max, stats.largest_radius());
                *layout = KeyLayout::new(low, high);
            }
            let cover = |k: usize| {
                let (center, radius) = sphere(k);
                let cover = || (grid.cover::<PERIODIC>(center, radius), ALL_AXES, k as u32);
                (paired >> grouping.group_of(k) & 1 == 1).then(cover)
            };
            let wrap = |cell| grid.wrap::<PERIODIC>(cell);
            narrow.entries.clear();
            wide.entries.clear();
            let cells = SphereCells { count: n, cover, wrap };
            match layout.is_narrow() {
                true => EntryBuffers { radix: narrow, offsets }.fill(cells, *layout, most, executor),
                false => EntryBuffers { radix: wide, offsets }.fill(cells, *layout, most, executor),
            }
        })? {
            grid = report.time("map", || grid.shifted::<PERIODIC>(ratio, sphere, n, executor));
            most = usize::MAX;
        }
        self.grid = grid;
        report.time("sort", || match layout.is_narrow() {
            true => narrow.sort(layout.bits(), executor),
            false => wide.sort(layout.bits(), executor),
        })?;
        log::trace!("{} entries, {} key bits", narrow.entries.len() + wide.entries.len(), layout.bits());
        Ok(())
    }

    pub(crate) fn visit<V: Visit>(&self, visitor: V) -> V::Result {
        match self.layout.is_narrow() {
            true => visitor.visit(&self.narrow.entries, self.layout),
            false => visitor.visit(&self.wide.entries, self.layout),
        }
    }
}

/// Bytes per entry in both buffers of the sort, with a narrow key, for up to 2²⁹ cells. A wide entry takes four
/// times as much.
pub(crate) const ENTRY: u64 = 2 * size_of::<KeyedSphere<u32>>() as u64;

pub(crate) fn memory_of_entries(entries: u64) -> u64 {
    Radix::<u32>::memory_for(entries)
}

/// Returns the most entries of an unshifted grid: the bound of the mean, plus 5 % and 64 for chance.
pub(crate) fn most_entries(spheres: usize, ratio: f32) -> usize {
    (1.05 * UniformGrid::most_cells(ratio) * spheres as f64) as usize + 64
}

pub(crate) struct SphereCells<C, W> {
    pub(crate) count: usize,
    /// Returns the cells of the `k`-th sphere, a mask for its corner masks, and its id, or `None` to omit it.
    pub(crate) cover: C,
    pub(crate) wrap: W,
}

pub(crate) struct EntryBuffers<'b, K: RadixKey> {
    pub(crate) radix: &'b mut Radix<K>,
    pub(crate) offsets: &'b mut Vec<usize>,
}

impl<K: RadixKey> EntryBuffers<'_, K> {
    /// For many spheres, `cover` is called twice. Returns `false`, without entries, if there would be more than `most`.
    pub(crate) fn fill<C, W>(
        self,
        cells: SphereCells<C, W>,
        layout: KeyLayout,
        most: usize,
        executor: Executor,
    ) -> Result<bool, Error>
    where
        C: Fn(usize) -> Option<(CellBox, u8, u32)> + Sync,
        W: Fn(UVec3) -> UVec3 + Sync,
    {
        let SphereCells { count: n, cover: sphere, wrap } = cells;
        let Self { radix, offsets } = self;
        let entries = &mut radix.entries;
        entries.clear();
        if n <= CHUNK_SPHERES {
            for (cover, masks, id) in (0..n).filter_map(&sphere) {
                if cover.cells() > most - entries.len() {
                    entries.clear();
                    return Ok(false);
                }
                try_reserve(entries, cover.cells(), "entries of cells")?;
                #[expect(clippy::disallowed_methods, reason = "there is room for all cells of the sphere")]
                cover.for_each(|cell, corner_mask| {
                    entries.push(KeyedSphere { key: layout.key(wrap(cell), corner_mask & masks), id });
                });
            }
            return Ok(true);
        }
        let range = |chunk: usize| chunk * CHUNK_SPHERES..n.min((chunk + 1) * CHUNK_SPHERES);
        try_resize(offsets, n.div_ceil(CHUNK_SPHERES), "counting entries of cells")?;
        executor.for_each(offsets, |chunk, count| {
            *count = range(chunk).filter_map(&sphere).map(|(cover, ..)| cover.cells()).sum();
        });
        let total = accumulate(offsets);
        if total > most {
            return Ok(false);
        }
        try_resize(entries, total, "entries of cells")?;
        let mut targets = split_at(entries, offsets.iter().copied())?;
        executor.for_each(&mut targets, |chunk, target| {
            let mut slots = target.iter_mut();
            for (cover, masks, id) in range(chunk).filter_map(&sphere) {
                cover.for_each(|cell, corner_mask| {
                    if let Some(slot) = slots.next() {
                        *slot = KeyedSphere { key: layout.key(wrap(cell), corner_mask & masks), id };
                    }
                });
            }
        });
        Ok(true)
    }
}

pub(crate) fn accumulate(lengths: &mut [usize]) -> usize {
    lengths.iter_mut().fold(0, |total, length| {
        *length += total;
        *length
    })
}

#[inline]
pub(crate) fn runs<K: RadixKey>(mut rest: &[KeyedSphere<K>]) -> impl Iterator<Item = &[KeyedSphere<K>]> {
    std::iter::from_fn(move || {
        let (run, others) = (!rest.is_empty()).then(|| rest.split_at(run_end(rest, 0)))?;
        rest = others;
        Some(run)
    })
}

/// Searches exponentially, because most runs are short.
#[inline]
fn run_end<K: RadixKey>(entries: &[KeyedSphere<K>], from: usize) -> usize {
    let cell = entries[from].cell();
    let (mut last, mut step) = (from, 1);
    while last + step < entries.len() && entries[last + step].cell() == cell {
        last += step;
        step *= 2;
    }
    let window = &entries[last..entries.len().min(last + step)];
    last + window.partition_point(|entry| entry.cell() == cell)
}

/// Moves both ends of a chunk to ends of cells.
pub(crate) fn cells_of_chunk<K: RadixKey>(
    entries: &[KeyedSphere<K>],
    chunk: usize,
    size: usize,
) -> &[KeyedSphere<K>] {
    let cut = |at: usize| match at {
        0 => 0,
        _ if at >= entries.len() => entries.len(),
        _ if entries[at - 1].cell() == entries[at].cell() => run_end(entries, at),
        _ => at,
    };
    &entries[cut(chunk * size)..cut((chunk + 1) * size)]
}
