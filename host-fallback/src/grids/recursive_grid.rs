//! The paper's RecursiveGrid: a grid for the largest spheres, whose overfull cells are split for the smaller ones.
//!
//! In each cell, large spheres (too large for a finer grid) are compared with all. If more than τ smaller spheres
//! remain, the cell is split into a finer grid, else they are compared with each other. Finer cells are a power of two
//! smaller and nest, so a pair's own cell lies in its own coarser cell. A finer entry's corner mask has only bits of
//! the coarser one.
//!
//! A split goes directly to the cell size that the largest remaining sphere requires, or, for few spheres, to cells
//! with a handful. Spheres as large as the extent of the rest are large too, since no split separates the centers. So
//! every step halves the largest size or the extent, and a recursion ends after some tens of steps.

use glam::{DVec3, UVec3, Vec3};

use super::cell::{Batch, CellMember, owns_pairs};
use super::entries::{
    ENTRY, Entries, EntryBuffers, KeyLayout, SphereCells, Visit, cells_of_chunk, memory_of_entries,
    most_entries, runs,
};
use super::nested_cell::{FinerCells, NestedCell};
use super::overfull_cells::{CellMembers, OverfullCells};
use super::uniform_grid::UniformGrid;
use super::workspace::{Workspaces, most_members};
use crate::Error;
use crate::compare::{Output, Sink};
use crate::input::{Division, SearchInput, search_chunks};
use crate::memory::{try_extend, try_reserve};
use crate::radix::{KeyedSphere, Radix, RadixKey};
use crate::report::Report;

/// Entries per chunk of work: the columns of their spheres take 40 KiB.
const CHUNK_ENTRIES: usize = 1 << 11;
/// Desired spheres per finer cell. Fewer mean more entries, more mean more comparisons.
const PER_CELL: f64 = 16.0;
/// Maximum halvings of a split by count, so that 32 bits suffice for a finer cell's key.
const MAX_HALVINGS: f64 = 7.0;

#[derive(Debug, Default)]
pub(crate) struct RecursiveGrid {
    entries: Entries,
    batches: Workspaces<Batch>,
    splits: Workspaces<CellSplit>,
    overfull: OverfullCells,
}

#[derive(Debug, Default)]
struct CellSplit {
    large: Vec<Member>,
    small: Vec<Member>,
    finer: Radix<u32>,
    offsets: Vec<usize>,
}

#[derive(Clone, Copy, Debug)]
struct Member {
    center: Vec3,
    radius: f32,
    id: u32,
    corner_mask: u8,
}

impl CellMember for Member {
    fn id(&self) -> u32 {
        self.id
    }

    fn corner_mask(&self) -> usize {
        self.corner_mask.into()
    }
}

impl CellSplit {
    fn bytes(&self) -> usize {
        let Self { large, small, finer, offsets } = self;
        (large.capacity() + small.capacity()) * size_of::<Member>()
            + finer.bytes()
            + offsets.capacity() * size_of::<usize>()
    }

    fn start(&mut self, input: &SearchInput<'_>, run: &[impl CellMember]) -> Result<(), Error> {
        self.small.clear();
        let members = run.iter().map(|entry| {
            let (center, radius) = input.test.effective(entry.id());
            Member { center, radius, id: entry.id(), corner_mask: entry.corner_mask() as u8 }
        });
        try_extend(&mut self.small, members, "spheres of an overfull cell")
    }

    fn separate_large(&mut self, limit: f64) -> Result<(), Error> {
        let Self { large, small, .. } = self;
        large.clear();
        let is_large = |member: &Member| f64::from(member.radius) > limit;
        let count = small.iter().filter(|member| is_large(member)).count();
        try_reserve(large, count, "spheres of an overfull cell")?;
        #[expect(clippy::disallowed_methods, reason = "there is room for all that are large")]
        large.extend(small.extract_if(.., |member| is_large(member)));
        Ok(())
    }

    fn merge_large(&mut self) -> Result<(), Error> {
        let Self { large, small, .. } = self;
        let joined = !large.is_empty();
        // The capacity suffices: `small` had all spheres before.
        try_extend(small, large.drain(..), "spheres of an overfull cell")?;
        std::mem::swap(large, small);
        if joined {
            large.sort_unstable_by_key(|member| (member.corner_mask, member.id));
        }
        Ok(())
    }

    fn extent<const PERIODIC: bool>(&self, grid: &UniformGrid, cell: &NestedCell) -> Extent {
        let radius = self.small.iter().fold(0.0_f32, |radius, member| radius.max(member.radius));
        if PERIODIC {
            let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let ([low, min], [high, max]) =
                self.small.iter().fold(([empty.0; 2], [empty.1; 2]), |([low, min], [high, max]), member| {
                    let (from, to) = cell.bounds::<true>(grid, member.center, member.radius);
                    let center = 0.5 * (from + to);
                    ([low.min(from), min.min(center)], [high.max(to), max.max(center)])
                });
            return Extent { low, high, wide: grid.widest(max - min), radius };
        }
        let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (min, max) = self
            .small
            .iter()
            .fold(empty, |(min, max), member| (min.min(member.center), max.max(member.center)));
        let wide = (max.as_dvec3() - min.as_dvec3()).max_element();
        let (low, high) = (grid.bounds::<false>(min, radius).0, grid.bounds::<false>(max, radius).1);
        Extent { low, high, wide, radius }
    }
}

#[derive(Clone, Copy, Debug)]
struct Extent {
    low: DVec3,
    high: DVec3,
    /// Largest extent of the centers, in the unit of length.
    wide: f64,
    radius: f32,
}

enum SplitDecision {
    /// Parts per axis, a power of two.
    Split(f64),
    /// Compares spheres above this radius with all, then decides again.
    CompareLarge(f64),
    /// No finer grid separates the spheres.
    BruteForce,
}

impl RecursiveGrid {
    pub(crate) fn build(&mut self, input: &SearchInput<'_>, report: &mut Report) -> Result<(), Error> {
        self.splits.keep_largest(CellSplit::bytes);
        self.entries.build(input, report)
    }

    pub(crate) fn search<'o, O: Output>(
        &self,
        input: &SearchInput<'_>,
        output: &'o O,
    ) -> Result<O::Sink<'o>, Error> {
        match input.is_periodic() {
            true => self.entries.visit(Search::<O, true> { grid: self, input, output }),
            false => self.entries.visit(Search::<O, false> { grid: self, input, output }),
        }
    }

    /// Assumes narrow keys and no nested overfull cells.
    pub(crate) fn memory_for(spheres: u64, ratio: f32, threads: u64) -> u64 {
        let entries = most_entries(spheres as usize, ratio) as u64;
        let batches = threads * Batch::memory_for(entries.min(2 * CHUNK_ENTRIES as u64));
        let members = most_members(spheres, entries, threads) * size_of::<Member>() as u64;
        // With several threads, the largest workspace of earlier calls adds to those of a call.
        let finer = spheres * threads.min(2) * 8 * ENTRY;
        memory_of_entries(entries) + members + finer + batches + OverfullCells::memory_for(spheres, threads)
    }
}

struct Search<'s, 'o, O, const PERIODIC: bool> {
    grid: &'s RecursiveGrid,
    input: &'s SearchInput<'s>,
    output: &'o O,
}

impl<'o, O: Output, const PERIODIC: bool> Visit for Search<'_, 'o, O, PERIODIC> {
    type Result = Result<O::Sink<'o>, Error>;

    fn visit<K: RadixKey>(self, entries: &[KeyedSphere<K>], layout: KeyLayout) -> Self::Result {
        self.level(
            entries,
            |key| NestedCell::top(&self.grid.entries.grid, layout.cell(key)),
            self.output.open(),
        )
    }
}

impl<'o, O: Output, const PERIODIC: bool> Search<'_, 'o, O, PERIODIC> {
    fn level<K: RadixKey>(
        &self,
        entries: &[KeyedSphere<K>],
        cell: impl Fn(K) -> NestedCell + Sync,
        sink: O::Sink<'o>,
    ) -> Result<O::Sink<'o>, Error> {
        let fold_chunk = |sink: O::Sink<'o>, chunk: usize| {
            self.grid
                .splits
                .lend(|split| self.cells(cells_of_chunk(entries, chunk, CHUNK_ENTRIES), &cell, split, sink))
        };
        match entries.len().div_ceil(CHUNK_ENTRIES) {
            0 | 1 if sink.stopped() => Ok(sink),
            chunks @ (0 | 1) => (0..chunks).try_fold(sink, fold_chunk)?.checked(),
            chunks => sink.merge(search_chunks(self.output, self.input, chunks, usize::MAX, fold_chunk)?),
        }
    }

    fn cells<K: RadixKey>(
        &self,
        entries: &[KeyedSphere<K>],
        cell: impl Fn(K) -> NestedCell,
        split: &mut CellSplit,
        mut sink: O::Sink<'o>,
    ) -> Result<O::Sink<'o>, Error> {
        let grouping = self.input.grouping(Division::ByPartners);
        let batches = &self.grid.batches;
        let mut batch = batches.take();
        for run in runs(entries) {
            if run.len() <= self.tau().min(CHUNK_ENTRIES) {
                batch.push(run, &grouping)?;
            } else if owns_pairs(run) {
                batch.search(self.input, &mut sink)?;
                split.start(self.input, run)?;
                batches.give_back(batch)?;
                sink = self.overfull(cell(run[0].key), split, sink)?;
                batch = batches.take();
            }
            if batch.len() > CHUNK_ENTRIES {
                batch.search(self.input, &mut sink)?;
            }
        }
        batch.search(self.input, &mut sink)?;
        batches.give_back(batch)?;
        Ok(sink)
    }

    fn tau(&self) -> usize {
        self.input.settings.tau as usize
    }

    fn overfull(
        &self,
        cell: NestedCell,
        split: &mut CellSplit,
        mut sink: O::Sink<'o>,
    ) -> Result<O::Sink<'o>, Error> {
        let cell_size = self.grid.entries.grid.cell_size() / cell.fineness;
        let mut limit = cell_size / 4.0;
        loop {
            split.separate_large(limit)?;
            let extent = split.extent::<PERIODIC>(&self.grid.entries.grid, &cell);
            let few = split.small.len() <= self.tau();
            let step = if few {
                SplitDecision::BruteForce
            } else {
                decide(&cell, cell_size, split.small.len(), &extent)
            };
            if let SplitDecision::BruteForce = step {
                split.merge_large()?;
            }
            if !split.large.is_empty() {
                let members = CellMembers { large: &split.large, small: &split.small };
                sink = self.grid.overfull.among(self.input, members, self.output, sink)?;
            }
            match step {
                SplitDecision::BruteForce => return Ok(sink),
                SplitDecision::CompareLarge(radius) => limit = radius,
                SplitDecision::Split(divisions) => {
                    let finer = FinerCells::new(&cell, divisions, extent.low, extent.high);
                    return self.split(&finer, split, sink);
                }
            }
        }
    }

    fn split(
        &self,
        cells: &FinerCells,
        split: &mut CellSplit,
        sink: O::Sink<'o>,
    ) -> Result<O::Sink<'o>, Error> {
        let CellSplit { small, finer, offsets, .. } = split;
        let (grid, executor, layout) = (&self.grid.entries.grid, self.input.executor, cells.layout);
        let cover = |k: usize| {
            let Member { center, radius, id, corner_mask } = small[k];
            Some((cells.cover::<PERIODIC>(grid, center, radius), corner_mask, id))
        };
        let spheres = SphereCells { count: small.len(), cover, wrap: |at: UVec3| at };
        EntryBuffers { radix: finer, offsets }.fill(spheres, layout, usize::MAX, executor)?;
        finer.sort(layout.bits(), executor)?;
        self.level(&finer.entries, |key| cells.cell_of(key), sink)
    }
}

fn decide(cell: &NestedCell, cell_size: f64, count: usize, extent: &Extent) -> SplitDecision {
    let wide = extent.wide;
    // Centers of small spheres lie within one and a half cell sizes, except for rounding, which no split separates.
    if wide == 0.0 || wide > 2.0 * cell_size {
        return SplitDecision::BruteForce;
    }
    let by_count = ((count as f64 / PER_CELL).log2() / 3.0).ceil().clamp(1.0, MAX_HALVINGS);
    let by_count = by_count + (cell_size / wide).log2().floor().max(0.0);
    let by_size = (cell_size / (2.0 * f64::from(extent.radius))).log2().floor();
    let halvings = by_count.min(by_size).max(1.0);
    if by_size < by_count && cell_size / halvings.exp2() > wide {
        return SplitDecision::CompareLarge(f64::from(extent.radius) / 2.0);
    }
    let (axes, most) = cell.divisible();
    if axes.any() { SplitDecision::Split(halvings.min(most).exp2()) } else { SplitDecision::BruteForce }
}
