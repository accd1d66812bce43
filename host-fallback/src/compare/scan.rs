//! Comparing one sphere with a run of others.

use std::ops::Range;

use super::columns::{Columns, MAX_LANES};
use super::rule::Rule;
use super::simd::Vector;
use super::sink::Sink;

/// Estimated time to compare with one sphere of a long run, in nanoseconds.
pub(crate) const COMPARE: f32 = 0.2;

#[derive(Clone, Copy)]
struct Lanes {
    certain: u32,
    possible: u32,
}

/// The columns to look in, and the rule that decides.
type Among<'c> = (&'c Columns, &'c Rule<'c>);

/// Compares the sphere at `at` with a run of others and hands the pairs to `sink`. The run must not contain `at`. Returns
/// how many vectors held any that may touch it.
#[inline(always)]
pub(crate) fn scan<V: Vector, S: Sink>(
    vector: V,
    among: Among<'_>,
    at: usize,
    run: Range<usize>,
    sink: &mut S,
) -> usize {
    let query = vector.query(among.0.sphere(at));
    let (mut base, mut held) = (run.start, 0);
    while base < run.end {
        let live = u32::MAX >> (32 - V::LANES.min(run.end - base));
        let gaps = vector.gaps(among.0, base, query);
        let possible = vector.possible(gaps) & live;
        if possible != 0 {
            let certain = vector.certain(gaps) & live;
            take(vector, among, (at, base), Lanes { certain, possible }, sink);
            held += 1;
        }
        base += V::LANES;
    }
    held
}

/// Vectors in which some may touch a sphere, and which do not wait for their turn.
///
/// Where about every second vector holds some, no branch predictor can tell which. So comparing is kept apart from
/// taking pairs: it appends without a branch.
pub(crate) struct Touches {
    at: [u32; Self::ROOM],
    base: [u32; Self::ROOM],
    /// Those that may touch in the lower half, those that do without doubt in the upper.
    lanes: [u32; Self::ROOM],
    len: usize,
    /// The number of vectors that held any.
    held: usize,
}

impl Touches {
    /// 6 KiB in all, a small part of the first-level cache.
    const ROOM: usize = 512;

    pub(crate) fn new() -> Self {
        const { assert!(2 * MAX_LANES <= u32::BITS as usize) };
        Self { at: [0; Self::ROOM], base: [0; Self::ROOM], lanes: [0; Self::ROOM], len: 0, held: 0 }
    }

    /// The same as [`scan`], for crowds: the last pairs are handed over by [`settle`](Self::settle).
    #[inline(always)]
    pub(crate) fn scan<V: Vector, S: Sink>(
        &mut self,
        vector: V,
        among: Among<'_>,
        (at, run): (usize, Range<usize>),
        sink: &mut S,
    ) {
        let query = vector.query(among.0.sphere(at));
        let mut base = run.start;
        while base < run.end {
            let live = u32::MAX >> (32 - V::LANES.min(run.end - base));
            let gaps = vector.gaps(among.0, base, query);
            let (possible, certain) = (vector.possible(gaps) & live, vector.certain(gaps) & live);
            let len = self.len % Self::ROOM;
            (self.at[len], self.base[len]) = (at as u32, base as u32);
            self.lanes[len] = possible | (certain << MAX_LANES);
            self.len = len + usize::from(possible != 0);
            if self.len == Self::ROOM {
                self.flush(vector, among, sink);
            }
            base += V::LANES;
        }
    }

    /// Hands over what is left. Returns how many vectors held any since the last time.
    #[inline(always)]
    pub(crate) fn settle<V: Vector, S: Sink>(&mut self, vector: V, among: Among<'_>, sink: &mut S) -> usize {
        self.flush(vector, among, sink);
        std::mem::take(&mut self.held)
    }

    #[inline(always)]
    fn flush<V: Vector, S: Sink>(&mut self, vector: V, among: Among<'_>, sink: &mut S) {
        for k in 0..self.len.min(Self::ROOM) {
            let (at, base) = (self.at[k] as usize, self.base[k] as usize);
            let (possible, certain) = (self.lanes[k] & (u32::MAX >> MAX_LANES), self.lanes[k] >> MAX_LANES);
            take(vector, among, (at, base), Lanes { certain, possible }, sink);
        }
        self.held += self.len;
        self.len = 0;
    }
}

/// Hands over those lanes from `base` on that are pairs with the sphere at `at`.
#[inline(always)]
fn take<V: Vector, S: Sink>(
    vector: V,
    (columns, rule): Among<'_>,
    (at, base): (usize, usize),
    lanes: Lanes,
    sink: &mut S,
) {
    let hits = match rule.is_plain() && lanes.certain == lanes.possible {
        true => lanes.certain,
        false => decide(rule, columns, at, base, lanes),
    };
    if hits != 0 {
        sink.hits(vector, columns.id(at), columns.ids(base), hits);
    }
}

/// Returns the lanes that are pairs with the sphere at `at`, of those that may be.
#[inline(never)]
fn decide(rule: &Rule<'_>, columns: &Columns, at: usize, base: usize, lanes: Lanes) -> u32 {
    let mut hits = if rule.is_plain() { lanes.certain } else { 0 };
    let mut open = lanes.possible & !hits;
    while open != 0 {
        let lane = open.trailing_zeros();
        open &= open - 1;
        let (i, j) = (columns.id(at), columns.id(base + lane as usize));
        if rule.candidates(i, j).unwrap_or_else(|| rule.pairs(i, j)) {
            hits |= 1 << lane;
        }
    }
    hits
}
