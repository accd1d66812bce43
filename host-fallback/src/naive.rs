//! Compares all pairs of groups that may pair: the reference for all other algorithms.

use std::ops::Range;

use crate::Error;
use crate::compare::{COMPARE_NS, Columns, Output, PairTest, ScanInput, SimdTask, SimdWidth, Sink, scan};
use crate::input::{Division, SearchInput, search_chunks, sort_by_group};
use crate::memory::{try_push, with_growth};

/// Spheres per tile, so that the columns of two tiles, 40 KiB, stay near the first-level cache.
const TILE: usize = 1024;

struct Tile<'t, S> {
    columns: &'t Columns,
    test: &'t PairTest<'t>,
    a: Range<usize>,
    b: Range<usize>,
    sink: &'t mut S,
}

impl<S: Sink> SimdTask for Tile<'_, S> {
    type Result = ();

    #[inline(always)]
    fn run<V: SimdWidth>(self, vector: V) {
        for at in self.a.clone() {
            let run = self.b.start.max(if self.a == self.b { at + 1 } else { 0 })..self.b.end;
            scan(vector, ScanInput { columns: self.columns, test: self.test }, at, run, self.sink);
        }
    }
}

/// Estimates the nanoseconds of a search.
pub(crate) fn time(spheres: usize) -> f32 {
    spheres as f32 * spheres as f32 * COMPARE_NS / 2.0
}

#[derive(Debug, Default)]
pub(crate) struct Naive {
    columns: Columns,
    order: Vec<u32>,
    rows: Vec<TileRow>,
}

/// The ranges overlap only within a group.
#[derive(Clone, Debug)]
struct TileRow {
    tile: Range<usize>,
    others: Range<usize>,
}

impl Naive {
    pub(crate) fn memory_for(spheres: u64) -> u64 {
        with_growth(spheres * (Columns::BYTES_PER_SPHERE + size_of::<u32>() as u64))
    }

    pub(crate) fn build(&mut self, input: &SearchInput<'_>) -> Result<(), Error> {
        let grouping = input.grouping(Division::ByPartners);
        let ends = sort_by_group(&grouping, input.stats.spheres, &mut self.order)?;
        self.columns.gather(&input.test, self.order.iter().copied())?;
        self.rows.clear();
        for (a, b) in grouping.paired_groups() {
            let [first, second] =
                [a, b].map(|group| if group == 0 { 0 } else { ends[group - 1] }..ends[group]);
            for start in first.clone().step_by(TILE) {
                let tile = start..first.end.min(start + TILE);
                let others = if a == b { start } else { second.start }..second.end;
                try_push(&mut self.rows, TileRow { tile, others }, "tiles of spheres")?;
            }
        }
        Ok(())
    }

    pub(crate) fn search<'o, O: Output>(
        &self,
        input: &SearchInput<'_>,
        output: &'o O,
    ) -> Result<O::Sink<'o>, Error> {
        search_chunks(output, input, self.rows.len(), 1, |mut sink, k| {
            let TileRow { tile, others } = &self.rows[k];
            for start in others.clone().step_by(TILE) {
                if input.is_stopped() {
                    return Err(Error::Cancelled);
                }
                if !sink.stopped() {
                    let (a, b) = (tile.clone(), start..others.end.min(start + TILE));
                    input.run(Tile { columns: &self.columns, test: &input.test, a, b, sink: &mut sink });
                }
            }
            Ok(sink)
        })
    }
}
