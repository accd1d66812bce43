use std::ops::Range;

use super::columns::{Columns, MAX_LANES};
use super::pair_test::PairTest;
use super::simd::{SimdWidth, SphereRun};
use super::sink::Sink;

/// Estimated nanoseconds of a comparison.
pub(crate) const COMPARE_NS: f32 = 0.2;

#[derive(Clone, Copy)]
struct Lanes {
    certain: u32,
    possible: u32,
}

#[derive(Clone, Copy)]
struct VectorHits {
    at: usize,
    base: usize,
    lanes: Lanes,
}

#[derive(Clone, Copy)]
pub(crate) struct ScanInput<'c> {
    pub(crate) columns: &'c Columns,
    pub(crate) test: &'c PairTest<'c>,
}

/// The run must not contain `at`. Returns the number of vectors with hits.
#[inline(always)]
pub(crate) fn scan<V: SimdWidth, S: Sink>(
    vector: V,
    input: ScanInput<'_>,
    at: usize,
    run: Range<usize>,
    sink: &mut S,
) -> usize {
    let query = vector.query(input.columns.sphere(at));
    let (mut base, mut hit_vectors) = (run.start, 0);
    while base < run.end {
        let live = u32::MAX >> (32 - V::LANES.min(run.end - base));
        let distances = vector.squared_distances(input.columns, base, query);
        let possible = vector.possible(distances) & live;
        if possible != 0 {
            let certain = vector.certain(distances) & live;
            take(vector, input, VectorHits { at, base, lanes: Lanes { certain, possible } }, sink);
            hit_vectors += 1;
        }
        base += V::LANES;
    }
    hit_vectors
}

/// Appends without a branch, which hits in every second vector would mispredict.
pub(crate) struct HitQueue {
    at: [u32; Self::CAPACITY],
    base: [u32; Self::CAPACITY],
    /// Possible contacts in the lower half, certain in the upper.
    lanes: [u32; Self::CAPACITY],
    len: usize,
    hit_vectors: usize,
}

impl HitQueue {
    /// In vectors: 6 KiB, a small part of the first-level cache.
    const CAPACITY: usize = 512;

    pub(crate) fn new() -> Self {
        const { assert!(2 * MAX_LANES <= u32::BITS as usize) };
        Self {
            at: [0; Self::CAPACITY],
            base: [0; Self::CAPACITY],
            lanes: [0; Self::CAPACITY],
            len: 0,
            hit_vectors: 0,
        }
    }

    /// [`flush`](Self::flush) writes the last pairs.
    #[inline(always)]
    pub(crate) fn scan<V: SimdWidth, S: Sink>(
        &mut self,
        vector: V,
        input: ScanInput<'_>,
        sphere_run: SphereRun,
        sink: &mut S,
    ) {
        let SphereRun { at, run } = sphere_run;
        let query = vector.query(input.columns.sphere(at));
        let mut base = run.start;
        while base < run.end {
            let live = u32::MAX >> (32 - V::LANES.min(run.end - base));
            let distances = vector.squared_distances(input.columns, base, query);
            let (possible, certain) = (vector.possible(distances) & live, vector.certain(distances) & live);
            let len = self.len % Self::CAPACITY;
            (self.at[len], self.base[len]) = (at as u32, base as u32);
            self.lanes[len] = possible | (certain << MAX_LANES);
            self.len = len + usize::from(possible != 0);
            if self.len == Self::CAPACITY {
                self.write_pairs(vector, input, sink);
            }
            base += V::LANES;
        }
    }

    #[inline(always)]
    pub(crate) fn flush<V: SimdWidth, S: Sink>(
        &mut self,
        vector: V,
        input: ScanInput<'_>,
        sink: &mut S,
    ) -> usize {
        self.write_pairs(vector, input, sink);
        std::mem::take(&mut self.hit_vectors)
    }

    #[inline(always)]
    fn write_pairs<V: SimdWidth, S: Sink>(&mut self, vector: V, input: ScanInput<'_>, sink: &mut S) {
        for k in 0..self.len.min(Self::CAPACITY) {
            let (at, base) = (self.at[k] as usize, self.base[k] as usize);
            let (possible, certain) = (self.lanes[k] & (u32::MAX >> MAX_LANES), self.lanes[k] >> MAX_LANES);
            take(vector, input, VectorHits { at, base, lanes: Lanes { certain, possible } }, sink);
        }
        self.hit_vectors += self.len;
        self.len = 0;
    }
}

#[inline(always)]
fn take<V: SimdWidth, S: Sink>(vector: V, input: ScanInput<'_>, found: VectorHits, sink: &mut S) {
    let (ScanInput { columns, test }, VectorHits { at, base, lanes }) = (input, found);
    let (id, ids) = (columns.id(at), columns.ids(base));
    let hits = match test.is_plain() && lanes.certain == lanes.possible {
        true => lanes.certain,
        false => match sink.wanted(id, ids, lanes.possible) {
            0 => 0,
            possible => {
                decide(test, columns, at, base, Lanes { certain: lanes.certain & possible, possible })
            }
        },
    };
    if hits != 0 {
        sink.hits(vector, id, ids, hits);
    }
}

#[inline(never)]
fn decide(test: &PairTest<'_>, columns: &Columns, at: usize, base: usize, lanes: Lanes) -> u32 {
    let mut lanes = if test.is_plain() { lanes } else { Lanes { certain: 0, ..lanes } };
    if let Some(filter) = test.triclinic() {
        let [possible, certain] = filter.touching(columns, at, base);
        lanes = Lanes { certain: lanes.possible & certain, possible: lanes.possible & possible };
    }
    let mut hits = lanes.certain;
    let mut open = lanes.possible & !hits;
    while open != 0 {
        let lane = open.trailing_zeros();
        open &= open - 1;
        let (i, j) = (columns.id(at), columns.id(base + lane as usize));
        if test.is_candidate(i, j).unwrap_or_else(|| test.is_pair(i, j)) {
            hits |= 1 << lane;
        }
    }
    hits
}
