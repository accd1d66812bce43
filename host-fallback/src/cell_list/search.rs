//! Looks around every sphere of a built cell list.

use std::ops::Range;

use rayon::prelude::*;

use super::raster::Block;
use super::{CellList, Placed};
use crate::contact::{Rule, scan};
use crate::detector::Input;
use crate::simd::{Task, Vector};
use crate::sink::{Output, Sink};

/// Spheres per piece of work: some tens of microseconds where space is not crowded.
const PIECE: usize = 1 << 10;
/// Runs in the queue: 3 KiB, a small part of the first-level cache.
const QUEUE: usize = 256;

/// Finds all pairs of the list, piece by piece over the threads.
pub(super) fn search<'o, O: Output>(list: &CellList, input: &Input<'_>, output: &'o O) -> O::Sink<'o> {
    let n = list.columns.len();
    let piece = |mut sink: O::Sink<'o>, piece: usize| {
        if !sink.stopped() {
            let range = piece * PIECE..n.min((piece + 1) * PIECE);
            input.simd.run(Piece { list, rule: &input.rule, range, sink: &mut sink });
        }
        sink
    };
    (0..n.div_ceil(PIECE))
        .into_par_iter()
        .fold(|| output.open(), piece)
        .reduce(|| output.open(), Sink::merge)
}

struct Piece<'p, S> {
    list: &'p CellList,
    rule: &'p Rule<'p>,
    range: Range<usize>,
    sink: &'p mut S,
}

impl<S: Sink> Task for Piece<'_, S> {
    type Result = ();

    #[inline(always)]
    fn run<V: Vector>(self, vector: V) {
        let Self { list, rule, range, sink } = self;
        let mut queue = Queue { vector, list, rule, sink, jobs: [Job::default(); QUEUE], len: 0 };
        for (k, level) in list.levels.iter().enumerate() {
            for at in range.start.max(level.members.start)..range.end.min(level.members.end) {
                // At its own level a sphere meets the later ones only, so that each pair is met once.
                queue.look_around(level, at, at + 1);
                for coarser in &list.levels[..k] {
                    queue.look_around(coarser, at, 0);
                }
            }
        }
        queue.drain();
    }
}

/// Sphere `at` against the run of spheres `start..end`.
#[derive(Clone, Copy, Default)]
struct Job {
    at: u32,
    start: u32,
    end: u32,
}

/// Runs that are found but not compared yet.
///
/// How many rows a sphere has to look at, and how many of them are empty, no branch predictor can tell. So finding
/// runs is kept apart from comparing: it appends without a branch, an empty run being overwritten by the next.
struct Queue<'p, V, S> {
    vector: V,
    list: &'p CellList,
    rule: &'p Rule<'p>,
    sink: &'p mut S,
    jobs: [Job; QUEUE],
    len: usize,
}

impl<V: Vector, S: Sink> Queue<'_, V, S> {
    /// Queues the runs of `level` within reach of the sphere at `at`, without what lies before place `from`.
    #[inline(always)]
    fn look_around(&mut self, level: &Placed, at: usize, from: usize) {
        let block = level.raster.block(self.list.columns.sphere(at));
        let count = block.count();
        if level.raster.folded || count[1] > 2 || count[2] > 2 {
            return self.rows(level, block, (at, from));
        }
        if self.len > QUEUE - 4 {
            self.drain();
        }
        let [size_x, size_y, _] = level.raster.size.map(|k| k as usize);
        let [width, more_y, more_z] = [count[0] as usize, count[1] as usize - 1, count[2] as usize - 1];
        let row = level.base + level.raster.index(block.first);
        let (next_y, next_z) = (size_x * more_y, size_x * size_y * more_z);
        // A second row that is the first again gets no cells.
        self.push(at, row, width, from);
        self.push(at, row + next_y, width * more_y, from);
        self.push(at, row + next_z, width * more_z, from);
        self.push(at, row + next_y + next_z, width * more_y * more_z, from);
    }

    /// Queues the rows of any block. Where the raster wraps around, no axis is followed for longer than it is, so no
    /// row is met twice.
    #[inline(always)]
    fn rows(&mut self, level: &Placed, block: Block, (at, from): (usize, usize)) {
        let (size, first, count) = (level.raster.size, block.first, block.count());
        let before = count[0].min(size[0] - first[0]);
        for z in 0..count[2] {
            for y in 0..count[1] {
                if self.len > QUEUE - 4 {
                    self.drain();
                }
                let (y, z) = ((first[1] + y) % size[1], (first[2] + z) % size[2]);
                let row = level.base + level.raster.index([0, y, z]);
                self.push(at, row + first[0] as usize, before as usize, from);
                self.push(at, row, (count[0] - before) as usize, from);
            }
        }
    }

    /// Queues the spheres in `count` cells from `first` on, those before place `from` left out. There must be room.
    #[inline(always)]
    fn push(&mut self, at: usize, first: usize, count: usize, from: usize) {
        let start = self.list.starts[first].max(from as u32);
        let end = self.list.starts[first + count];
        self.jobs[self.len & (QUEUE - 1)] = Job { at: at as u32, start, end };
        self.len += usize::from(start < end);
    }

    /// Compares what is queued.
    #[inline(always)]
    fn drain(&mut self) {
        for job in &self.jobs[..self.len.min(QUEUE)] {
            let run = job.start as usize..job.end as usize;
            scan(self.vector, (&self.list.columns, self.rule), job.at as usize, run, self.sink);
        }
        self.len = 0;
    }
}
