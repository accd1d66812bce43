//! All-pairs comparison, the reference of every other algorithm.

use std::ops::Range;

use crate::Error;
use crate::compare::{COMPARE_NS, Columns, Output, PairTest, SimdTask, SimdWidth, Sink, scan};
use crate::input::{SearchInput, search_pieces};

/// Spheres per tile: the columns of two tiles, 40 KiB, stay near the first-level cache.
const TILE: usize = 1024;

/// Compares every sphere of `columns[a]` with every later one of `columns[b]`; the ranges are equal or disjoint.
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
            scan(vector, (self.columns, self.test), at, run, self.sink);
        }
    }
}

/// The estimated time of one thread for this number of spheres, in nanoseconds.
pub(crate) fn time(spheres: usize) -> f32 {
    spheres as f32 * spheres as f32 * COMPARE_NS / 2.0
}

/// Finds all pairs among the spheres of `columns`, in tiles spread over the threads.
///
/// # Errors
/// [`Error::OutOfMemory`], [`Error::Cancelled`].
pub(crate) fn search<'o, O: Output>(
    input: &SearchInput<'_>,
    columns: &Columns,
    output: &'o O,
) -> Result<O::Sink<'o>, Error> {
    let tiles = |range: Range<usize>| range.len().div_ceil(TILE);
    let tile = |of: &Range<usize>, k: usize| of.start + k * TILE..of.end.min(of.start + (k + 1) * TILE);
    let n = columns.len();
    // All with all, or the first ones with the others.
    let (rows, others) = match input.split {
        None => (0..n, 0..n),
        Some(split) => (0..split, split..n),
    };
    search_pieces((output, input), (tiles(rows.clone()), 1), |mut sink, k| {
        let first = if input.split.is_none() { k } else { 0 };
        for other in first..tiles(others.clone()) {
            if input.is_stopped() {
                return Err(Error::Cancelled);
            }
            if !sink.stopped() {
                let sink = &mut sink;
                let (a, b) = (tile(&rows, k), tile(&others, other));
                input.run(Tile { columns, test: &input.test, a, b, sink });
            }
        }
        Ok(sink)
    })
}
