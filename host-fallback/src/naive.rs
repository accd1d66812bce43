//! All pairs: the judge of every other detector.

use std::ops::Range;

use crate::Error;
use crate::columns::Columns;
use crate::contact::{Rule, scan};
use crate::detector::Input;
use crate::simd::{Task, Vector};
use crate::sink::{Output, Sink, search_pieces};

/// Spheres per tile: the columns of two tiles, 40 KiB, stay in the first-level cache's reach.
const TILE: usize = 1024;

/// Compares every sphere of `columns[a]` with every later one of `columns[b]`; the ranges are equal or disjoint.
struct Tile<'t, S> {
    columns: &'t Columns,
    rule: &'t Rule<'t>,
    a: Range<usize>,
    b: Range<usize>,
    sink: &'t mut S,
}

impl<S: Sink> Task for Tile<'_, S> {
    type Result = ();

    #[inline(always)]
    fn run<V: Vector>(self, vector: V) {
        for at in self.a.clone() {
            let run = self.b.start.max(if self.a == self.b { at + 1 } else { 0 })..self.b.end;
            scan(vector, (self.columns, self.rule), at, run, self.sink);
        }
    }
}

/// Finds all pairs among the spheres of `columns`, in tiles spread over the threads.
///
/// # Errors
/// [`Error::OutOfMemory`], [`Error::Stopped`].
pub(crate) fn search<'o, O: Output>(
    input: &Input<'_>,
    columns: &Columns,
    output: &'o O,
) -> Result<O::Sink<'o>, Error> {
    let tiles = columns.len().div_ceil(TILE);
    let range = |tile: usize| tile * TILE..columns.len().min((tile + 1) * TILE);
    search_pieces((output, input), (tiles, 1), |mut sink, a| {
        for b in a..tiles {
            if input.is_stopped() {
                return Err(Error::Stopped);
            }
            if !sink.stopped() {
                let sink = &mut sink;
                input.run(Tile { columns, rule: &input.rule, a: range(a), b: range(b), sink });
            }
        }
        Ok(sink)
    })
}
