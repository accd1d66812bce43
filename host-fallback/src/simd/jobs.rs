use std::ops::Range;

use super::MAX_LANES;

/// Runs of spheres that are found but not compared yet: sphere `at` against those at `start..end`.
///
/// How many rows a sphere has to look at, and how many of them are empty, no branch predictor can tell. So finding
/// runs is kept apart from comparing: it appends without a branch.
pub(crate) struct Jobs {
    pub(super) at: [u32; Self::ROOM],
    pub(super) start: [u32; Self::ROOM],
    pub(super) end: [u32; Self::ROOM],
    pub(super) len: usize,
}

impl Jobs {
    /// 6 KiB in all, a small part of the first-level cache.
    const ROOM: usize = 512;
    /// The most before they must be worked off.
    pub(super) const FULL: usize = Self::ROOM - MAX_LANES;

    pub(crate) fn new() -> Self {
        Self { at: [0; Self::ROOM], start: [0; Self::ROOM], end: [0; Self::ROOM], len: 0 }
    }

    /// Whether there may be no room for the runs of another vector.
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
