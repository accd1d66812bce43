//! Puts pairs in canonical order: by `i`, then `j`.
//!
//! One pass spreads the pairs over buckets of neighbouring `i`, small enough for the cache; each bucket is then
//! ordered on its own by a radix sort of `j` and `i`.

use lazygrid_kernels::Pair;

use crate::Error;
use crate::memory::{collect, resize};
use crate::scatter::{Disjoint, split_at};
use crate::threads::Threads;

/// Pieces of the first pass at most: enough for any number of threads, few enough for a counter per piece and bucket.
const PIECES: usize = 128;
/// The most buckets: their write positions stay in the second-level cache.
const MAX_BUCKETS: usize = 1 << 11;
/// Pairs per bucket aimed at, 64 KiB.
const BUCKET: usize = 1 << 13;

/// Indices per bucket at most, where [`MAX_BUCKETS`] allows: their counters stay in the cache.
const MAX_WIDTH: usize = 1 << 15;
/// Bits per pass at most: counters of 8 KiB beside a bucket of 64 KiB.
const DIGIT: u32 = 11;

/// Puts pairs in canonical order, by `i`, then `j`, in buffers that survive between calls.
#[derive(Debug, Default)]
pub struct Canonical {
    scratch: Vec<Pair>,
    starts: Vec<usize>,
    /// By piece and bucket: first how many pairs there are, then where the next one goes.
    offsets: Vec<usize>,
}

impl Canonical {
    /// Writes the pairs of `chunks` to `out` in canonical order. Indices must be below `spheres`. Threads share the
    /// chunks out, so that a hundred are better than one.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`], [`Error::Threads`].
    ///
    /// # Panics
    /// Where an `i` is far from below `spheres`.
    pub fn order(&mut self, chunks: &[&[Pair]], spheres: usize, out: &mut Vec<Pair>) -> Result<(), Error> {
        self.order_with(Threads::here()?, chunks, spheres, out)
    }

    /// The same with these threads.
    pub(crate) fn order_with(
        &mut self,
        threads: Threads,
        chunks: &[&[Pair]],
        spheres: usize,
        out: &mut Vec<Pair>,
    ) -> Result<(), Error> {
        let total: usize = chunks.iter().map(|chunk| chunk.len()).sum();
        resize(&mut self.scratch, total, "ordering pairs")?;
        resize(out, total, "pairs")?;
        let buckets = (total / BUCKET).max(spheres / MAX_WIDTH).next_power_of_two().min(MAX_BUCKETS);
        let width = spheres.div_ceil(buckets).max(1).next_power_of_two();
        let shift = width.trailing_zeros();
        let buckets = spheres.div_ceil(width).max(1);
        self.spread(threads, chunks, (shift, buckets))?;

        let ends = self.starts[1..].iter().copied();
        let targets = split_at(out, ends.clone())?;
        let sources = split_at(&mut self.scratch, ends)?;
        let bits = (shift, usize::BITS - spheres.saturating_sub(1).leading_zeros());
        let mut pieces = collect(targets.into_iter().zip(sources), "buckets of pairs")?;
        threads.each(&mut pieces, |bucket, (target, source)| {
            order_bucket(source, target, (bucket << shift) as u32, bits);
        });
        Ok(())
    }

    /// Moves the pairs to `scratch`, bucket by bucket, and notes where each bucket starts.
    fn spread(
        &mut self,
        threads: Threads,
        chunks: &[&[Pair]],
        (shift, buckets): (u32, usize),
    ) -> Result<(), Error> {
        let Self { scratch, starts, offsets } = self;
        let share = chunks.len().div_ceil(PIECES).max(1);
        let pieces = chunks.len().div_ceil(share);
        let piece = |k: usize| chunks[k * share..chunks.len().min((k + 1) * share)].iter().copied().flatten();
        resize(offsets, pieces * buckets, "buckets of pairs")?;
        let mut rows = collect(offsets.chunks_mut(buckets), "buckets of pairs")?;
        threads.each(&mut rows, |k, counts| {
            counts.fill(0);
            for pair in piece(k) {
                counts[(pair.i >> shift) as usize] += 1;
            }
        });
        resize(starts, buckets + 1, "buckets of pairs")?;
        let mut at = 0;
        for bucket in 0..buckets {
            starts[bucket] = at;
            for row in &mut rows {
                at += std::mem::replace(&mut row[bucket], at);
            }
        }
        starts[buckets] = at;

        let scratch = Disjoint::new(scratch);
        threads.each(&mut rows, |k, next| {
            for &pair in piece(k) {
                let slot = &mut next[(pair.i >> shift) as usize];
                // SAFETY: the exclusive prefix sums over (bucket, piece) give every pair a slot of its own below
                // `total`, the length of `scratch`.
                unsafe { scratch.write(*slot, pair) };
                *slot += 1;
            }
        });
        Ok(())
    }
}

/// Orders one bucket, whose `i` start at `first`, into `target`: a radix sort of `i - first` and `j`, digit by digit
/// from the lowest.
fn order_bucket(source: &mut [Pair], target: &mut [Pair], first: u32, (i_bits, j_bits): (u32, u32)) {
    let passes = (i_bits + j_bits).div_ceil(DIGIT).max(1);
    let digit = (i_bits + j_bits).div_ceil(passes);
    let mut counts = [0_u32; 1 << DIGIT];
    let counts = &mut counts[..1 << digit];
    let (mut from, mut to) = (&mut *source, &mut *target);
    for pass in 0..passes {
        let key = |pair: &Pair| {
            let key = (u64::from(pair.i - first) << j_bits) | u64::from(pair.j);
            (key >> (pass * digit)) as usize & ((1 << digit) - 1)
        };
        from.iter().for_each(|pair| counts[key(pair)] += 1);
        let mut at = 0;
        for count in &mut *counts {
            at += std::mem::replace(count, at);
        }
        for pair in from.iter() {
            let slot = &mut counts[key(pair)];
            to[*slot as usize] = *pair;
            *slot += 1;
        }
        counts.fill(0);
        (from, to) = (to, from);
    }
    if passes % 2 == 0 {
        target.copy_from_slice(source);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(spheres: u32, pairs: Vec<Pair>, pieces: usize) {
        let chunks: Vec<&[Pair]> = pairs.chunks(pieces).collect();
        let mut expected = pairs.clone();
        expected.sort_unstable();
        let (mut canonical, mut out) = (Canonical::default(), Vec::new());
        for _ in 0..2 {
            canonical.order(&chunks, spheres as usize, &mut out).expect("there is memory");
            assert_eq!(out, expected);
        }
    }

    #[test]
    fn any_number_of_pairs_in_any_order() {
        for spheres in [2, 3, 255, 256, 257, 100_000] {
            for count in [0, 1, 2, 255, 256, 257, 70_000] {
                let mix = |k: u32| k.wrapping_mul(2_654_435_761) >> 7;
                let pairs = (0..count).filter_map(|k| {
                    let (a, b) = (mix(k) % spheres, mix(k + 77) % spheres);
                    (a != b).then(|| Pair::new(a, b))
                });
                check(spheres, pairs.collect(), 1000);
            }
        }
    }

    #[test]
    fn one_sphere_in_every_pair() {
        check(50_001, (1..50_001).rev().map(|j| Pair::new(0, j)).collect(), 777);
        check(50_001, (0..50_000).rev().map(|i| Pair::new(i, 50_000)).collect(), 777);
    }
}
