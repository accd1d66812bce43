//! The paper's HashGrid: a hash table with chaining, and an entry for every cell that a sphere overlaps. Cells of equal
//! hash share a chain.

use std::sync::atomic::Ordering::Relaxed;

use bytemuck::Zeroable;
use glam::UVec3;

use super::cell::{Batch, CellMember};
use super::entries::{accumulate, most_entries};
use super::overfull_cells::OverfullCells;
use super::uniform_grid::{CellBox, UniformGrid};
use super::workspace::{Workspaces, most_members};
use crate::Error;
use crate::compare::Output;
use crate::disjoint_writes::{shared, split_at};
use crate::input::{Division, SearchInput, search_chunks};
use crate::memory::{try_push, try_resize, with_growth};
use crate::report::Report;

const CHUNK_SPHERES: usize = 1 << 14;
const CHUNK_CHAINS: usize = 1 << 11;
const BATCH_SPHERES: usize = 1 << 11;
const END: u32 = u32::MAX;

#[derive(Debug, Default)]
pub(crate) struct HashGrid {
    heads: Vec<u32>,
    entries: Vec<ChainEntry>,
    offsets: Vec<usize>,
    chains: Workspaces<Vec<ChainMember>>,
    batches: Workspaces<Batch>,
    overfull: OverfullCells,
}

#[derive(Clone, Copy, Debug, Zeroable)]
struct ChainEntry {
    cell: UVec3,
    corner_mask: u32,
    id: u32,
    next: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct ChainMember {
    cell: [u32; 3],
    corner_mask: u32,
    id: u32,
}

impl CellMember for ChainMember {
    fn id(&self) -> u32 {
        self.id
    }

    fn corner_mask(&self) -> usize {
        self.corner_mask as usize
    }
}

impl HashGrid {
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
        self.chains.keep_largest(Vec::capacity);
        let grid = report.time("count", || self.count::<PERIODIC>(input))?;
        let total = self.offsets.last().copied().unwrap_or(0);
        log::trace!("{total} entries");
        report.time("insert", || {
            let chains = total.next_power_of_two().max(2);
            try_resize(&mut self.heads, chains, "chains of a hash table")?;
            input.executor.for_each_chunk(&mut self.heads, CHUNK_SPHERES, |_, heads| heads.fill(END));
            try_resize(&mut self.entries, total, "entries of cells")?;
            self.insert::<PERIODIC>(input, &grid)
        })
    }

    /// Shifts the grid if it has too many entries, and doubles its cells until 32 bits number the entries.
    fn count<const PERIODIC: bool>(&mut self, input: &SearchInput<'_>) -> Result<UniformGrid, Error> {
        let (n, ratio, lengths) = (input.stats.spheres, input.settings.cell_ratio, input.test.lengths());
        let mut grid = UniformGrid::new(&input.stats, ratio, lengths);
        let mut most = most_entries(n, ratio);
        try_resize(&mut self.offsets, n.div_ceil(CHUNK_SPHERES), "counting entries of cells")?;
        loop {
            let cells = |id| cover::<PERIODIC>(input, &grid, id).cells();
            input.executor.for_each(&mut self.offsets, |chunk, count| {
                *count = spheres(input, chunk).map(cells).sum();
            });
            let total = accumulate(&mut self.offsets);
            if total <= most.min(END as usize - 1) {
                return Ok(grid);
            }
            grid = if total > most {
                most = usize::MAX;
                let sphere = |k: usize| input.test.effective(k as u32);
                grid.shifted::<PERIODIC>(ratio, sphere, n, input.executor)
            } else {
                grid.coarser(lengths)
            };
        }
    }

    fn insert<const PERIODIC: bool>(
        &mut self,
        input: &SearchInput<'_>,
        grid: &UniformGrid,
    ) -> Result<(), Error> {
        let Self { heads, entries, offsets, .. } = self;
        let shift = shift(heads.len());
        let heads = shared(heads);
        let mut targets = split_at(entries, offsets.iter().copied())?;
        input.executor.for_each(&mut targets, |chunk, target| {
            let mut number = if chunk == 0 { 0 } else { offsets[chunk - 1] as u32 };
            let mut slots = target.iter_mut();
            for id in spheres(input, chunk) {
                cover::<PERIODIC>(input, grid, id).for_each(|cell, corner_mask| {
                    let cell = grid.wrap::<PERIODIC>(cell);
                    if let Some(slot) = slots.next() {
                        let next = heads[chain_of(cell, shift)].swap(number, Relaxed);
                        *slot = ChainEntry { cell, corner_mask: u32::from(corner_mask), id, next };
                        number += 1;
                    }
                });
            }
        });
        Ok(())
    }

    pub(crate) fn search<'o, O: Output>(
        &self,
        input: &SearchInput<'_>,
        output: &'o O,
    ) -> Result<O::Sink<'o>, Error> {
        let chunks = self.heads.len().div_ceil(CHUNK_CHAINS);
        let search = Search { grid: self, input, output };
        search_chunks(output, input, chunks, usize::MAX, |sink, chunk| {
            let heads = &self.heads[chunk * CHUNK_CHAINS..self.heads.len().min((chunk + 1) * CHUNK_CHAINS)];
            self.chains.lend(|chain| search.chains(heads, chain, sink))
        })
    }

    /// The order does not depend on insertion.
    fn collect(&self, head: u32, chain: &mut Vec<ChainMember>) -> Result<(), Error> {
        chain.clear();
        let mut at = head;
        while at != END {
            let ChainEntry { cell, corner_mask, id, next } = self.entries[at as usize];
            try_push(
                chain,
                ChainMember { cell: cell.to_array(), corner_mask, id },
                "a chain of a hash table",
            )?;
            at = next;
        }
        if chain.len() > 1 {
            chain.sort_unstable();
        }
        Ok(())
    }

    pub(crate) fn memory_for(spheres: u64, ratio: f32, threads: u64) -> u64 {
        let entries = most_entries(spheres as usize, ratio) as u64;
        let table = entries.next_power_of_two() * size_of::<u32>() as u64;
        let batches = threads * Batch::memory_for(entries.min(2 * BATCH_SPHERES as u64));
        let chains = with_growth(most_members(spheres, entries, threads) * size_of::<ChainMember>() as u64);
        let overfull = OverfullCells::memory_for(spheres, threads);
        with_growth(entries * size_of::<ChainEntry>() as u64 + table) + batches + chains + overfull
    }
}

struct Search<'s, 'o, O> {
    grid: &'s HashGrid,
    input: &'s SearchInput<'s>,
    output: &'o O,
}

impl<'o, O: Output> Search<'_, 'o, O> {
    fn chains(
        &self,
        heads: &[u32],
        chain: &mut Vec<ChainMember>,
        mut sink: O::Sink<'o>,
    ) -> Result<O::Sink<'o>, Error> {
        let &Self { grid, input, output } = self;
        let grouping = input.grouping(Division::ByPartners);
        let mut batch = grid.batches.take();
        for &head in heads {
            grid.collect(head, chain)?;
            for run in chain.chunk_by(|a, b| a.cell == b.cell).filter(|run| run.len() > 1) {
                if run.len() > BATCH_SPHERES {
                    batch.search(input, &mut sink)?;
                    grid.batches.give_back(batch)?;
                    sink = grid.overfull.within(input, run, output, sink)?;
                    batch = grid.batches.take();
                } else {
                    batch.push(run, &grouping)?;
                }
            }
            if batch.len() > BATCH_SPHERES {
                batch.search(input, &mut sink)?;
            }
        }
        batch.search(input, &mut sink)?;
        grid.batches.give_back(batch)?;
        Ok(sink)
    }
}

fn spheres<'i>(input: &'i SearchInput<'_>, chunk: usize) -> impl Iterator<Item = u32> + 'i {
    let range = chunk * CHUNK_SPHERES..input.stats.spheres.min((chunk + 1) * CHUNK_SPHERES);
    let grouping = input.grouping(Division::ByPartners);
    let paired = grouping.paired();
    range.filter(move |&k| paired >> grouping.group_of(k) & 1 == 1).map(|k| k as u32)
}

#[inline(always)]
fn cover<const PERIODIC: bool>(input: &SearchInput<'_>, grid: &UniformGrid, id: u32) -> CellBox {
    let (center, radius) = input.test.effective(id);
    grid.cover::<PERIODIC>(center, radius)
}

/// `chains` is a power of two, at least 2.
fn shift(chains: usize) -> u32 {
    u64::BITS - chains.trailing_zeros()
}

/// Upper bits of products with odd constants are well mixed.
#[inline(always)]
fn chain_of(cell: UVec3, shift: u32) -> usize {
    let [x, y, z] = cell.to_array().map(u64::from);
    let mixed = x.wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ y.wrapping_mul(0xC2B2_AE3D_27D4_EB4F)
        ^ z.wrapping_mul(0x1656_67B1_9E37_79F9);
    (mixed.wrapping_mul(0xFF51_AFD7_ED55_8CCD) >> shift) as usize
}
