use std::ops::Range;

use super::MAX_LANES;

/// The own row, and the four adjacent ones later in the table.
const ROWS: usize = 5;

/// Touching spheres must be in adjacent cells.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NeighborRows {
    /// Spheres touch lower cells only if center less radius is below this.
    pub(crate) low: [f32; 3],
    /// Spheres touch higher cells only if center plus radius is above this.
    pub(crate) high: [f32; 3],
    /// Starts of cells `x - 1`, `x` and `x + 1`, and the end. Rows inside replace rows outside the grid; `low` and
    /// `high` exclude the replacements.
    pub(crate) rows: [[u32; 4]; ROWS],
}

#[derive(Debug)]
pub(crate) struct SphereRun {
    pub(crate) at: usize,
    pub(crate) run: Range<usize>,
}

/// Appends without a branch, which searched and empty rows would mispredict.
pub(crate) struct RunQueue {
    pub(super) at: [u32; Self::CAPACITY],
    pub(super) start: [u32; Self::CAPACITY],
    pub(super) end: [u32; Self::CAPACITY],
    pub(super) len: usize,
}

impl RunQueue {
    /// In runs: 6 KiB, a small part of the first-level cache.
    const CAPACITY: usize = 512;
    /// Length at which only the runs of one more vector of spheres fit.
    pub(super) const FULL: usize = Self::CAPACITY - (ROWS + 1) * MAX_LANES;

    pub(crate) fn new() -> Self {
        Self { at: [0; Self::CAPACITY], start: [0; Self::CAPACITY], end: [0; Self::CAPACITY], len: 0 }
    }

    #[inline(always)]
    pub(crate) fn is_full(&self) -> bool {
        self.len >= Self::FULL
    }

    #[inline(always)]
    pub(crate) fn push(&mut self, at: u32, run: Range<u32>, wanted: bool) {
        let len = self.len % Self::CAPACITY;
        (self.at[len], self.start[len], self.end[len]) = (at, run.start, run.end);
        self.len = len + usize::from(wanted & (run.start < run.end));
    }

    #[inline(always)]
    pub(crate) fn get(&self, k: usize) -> SphereRun {
        SphereRun { at: self.at[k] as usize, run: self.start[k] as usize..self.end[k] as usize }
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
