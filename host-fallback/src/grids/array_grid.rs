//! The paper's ArrayGrid: (cell, sphere) entries for every cell that a sphere overlaps, sorted by cell.

use super::cell::Batch;
use super::entries::{Entries, KeyLayout, Visit, cells_of_chunk, memory_of_entries, most_entries, runs};
use super::overfull_cells::OverfullCells;
use super::workspace::Workspaces;
use crate::Error;
use crate::compare::Output;
use crate::input::{Division, SearchInput, search_chunks};
use crate::radix::{KeyedSphere, RadixKey};
use crate::report::Report;

const CHUNK_ENTRIES: usize = 1 << 11;
/// Entries of a cell above which it is overfull.
const MAX_BATCHED_ENTRIES: usize = CHUNK_ENTRIES;

#[derive(Debug, Default)]
pub(crate) struct ArrayGrid {
    entries: Entries,
    batches: Workspaces<Batch>,
    overfull: OverfullCells,
}

impl ArrayGrid {
    pub(crate) fn build(&mut self, input: &SearchInput<'_>, report: &mut Report) -> Result<(), Error> {
        self.entries.build(input, report)
    }

    pub(crate) fn search<'o, O: Output>(
        &self,
        input: &SearchInput<'_>,
        output: &'o O,
    ) -> Result<O::Sink<'o>, Error> {
        self.entries.visit(Search { grid: self, input, output })
    }

    pub(crate) fn memory_for(spheres: u64, ratio: f32, threads: u64) -> u64 {
        let entries = most_entries(spheres as usize, ratio) as u64;
        let batches = threads * Batch::memory_for(entries.min((CHUNK_ENTRIES + MAX_BATCHED_ENTRIES) as u64));
        memory_of_entries(entries) + batches + OverfullCells::memory_for(spheres, threads)
    }
}

struct Search<'s, 'o, O> {
    grid: &'s ArrayGrid,
    input: &'s SearchInput<'s>,
    output: &'o O,
}

impl<'o, O: Output> Visit for Search<'_, 'o, O> {
    type Result = Result<O::Sink<'o>, Error>;

    fn visit<K: RadixKey>(self, entries: &[KeyedSphere<K>], _: KeyLayout) -> Self::Result {
        let Self { grid, input, output } = self;
        let chunks = entries.len().div_ceil(CHUNK_ENTRIES);
        search_chunks(output, input, chunks, usize::MAX, |sink, chunk| {
            cells(grid, cells_of_chunk(entries, chunk, CHUNK_ENTRIES), input, output, sink)
        })
    }
}

fn cells<'o, K: RadixKey, O: Output>(
    grid: &ArrayGrid,
    entries: &[KeyedSphere<K>],
    input: &SearchInput<'_>,
    output: &'o O,
    mut sink: O::Sink<'o>,
) -> Result<O::Sink<'o>, Error> {
    let grouping = input.grouping(Division::ByPartners);
    let mut batch = grid.batches.take();
    for run in runs(entries) {
        if run.len() <= MAX_BATCHED_ENTRIES {
            batch.push(run, &grouping)?;
        } else {
            batch.search(input, &mut sink)?;
            grid.batches.give_back(batch)?;
            sink = grid.overfull.within(input, run, output, sink)?;
            batch = grid.batches.take();
        }
    }
    batch.search(input, &mut sink)?;
    grid.batches.give_back(batch)?;
    Ok(sink)
}
