use std::ops::Range;

use super::MAX_LANES;

/// Rows of cells around a cell that matter to its spheres: its own, and the four next to it that come later in the
/// table: that of higher `y`, and of higher `z` those of lower, equal and higher `y`.
const ROWS: usize = 5;

/// What lies around one cell, in a grid whose cells are so wide that nothing beyond the next is in reach.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NeighborRows {
    /// A sphere reaches lower cells along an axis only if its centre less its radius is below this.
    pub(crate) low: [f32; 3],
    /// A sphere reaches higher cells along an axis only if its centre plus its radius is above this.
    pub(crate) high: [f32; 3],
    /// Where each row's cell `x - 1` starts, its cell `x`, its cell `x + 1`, and where that ends. Rows outside the
    /// grid are replaced by some inside; `low` and `high` keep all spheres from asking for them.
    pub(crate) rows: [[u32; 4]; ROWS],
}

/// Runs of spheres that are found but not compared yet: sphere `at` against those at `start..end`.
///
/// How many rows a sphere has to look at, and how many of them are empty, no branch predictor can tell. So finding
/// runs is kept apart from comparing: it appends without a branch.
pub(crate) struct RunQueue {
    pub(super) at: [u32; Self::ROOM],
    pub(super) start: [u32; Self::ROOM],
    pub(super) end: [u32; Self::ROOM],
    pub(super) len: usize,
}

impl RunQueue {
    /// 6 KiB in all, a small part of the first-level cache.
    const ROOM: usize = 512;
    /// The most before they must be worked off: then the runs of one more vector of spheres fit.
    pub(super) const FULL: usize = Self::ROOM - (ROWS + 1) * MAX_LANES;

    pub(crate) fn new() -> Self {
        Self { at: [0; Self::ROOM], start: [0; Self::ROOM], end: [0; Self::ROOM], len: 0 }
    }

    /// Returns `true` if there may be no room for the runs of another vector of spheres.
    #[inline(always)]
    pub(crate) fn is_full(&self) -> bool {
        self.len >= Self::FULL
    }

    /// Appends one run, if it is wanted and not empty. They must not be full.
    #[inline(always)]
    pub(crate) fn push(&mut self, at: u32, run: Range<u32>, wanted: bool) {
        let len = self.len % Self::ROOM;
        (self.at[len], self.start[len], self.end[len]) = (at, run.start, run.end);
        self.len = len + usize::from(wanted & (run.start < run.end));
    }

    /// The sphere and the run of job `k`.
    #[inline(always)]
    pub(crate) fn get(&self, k: usize) -> (usize, Range<usize>) {
        (self.at[k] as usize, self.start[k] as usize..self.end[k] as usize)
    }

    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }
}
