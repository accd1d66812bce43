//! Puts pairs in canonical order: by `i`, then `j`.
//!
//! One pass spreads the pairs over buckets of neighbouring `i`, small enough for the cache; each bucket is then
//! ordered on its own by a radix sort of `j` and `i`.

use lazygrid_kernels::Pair;
use rayon::prelude::*;

use crate::scatter::{Disjoint, split_at};

/// Pairs per piece of a pass.
const PIECE: usize = 1 << 16;
/// The most buckets: their write positions stay in the second-level cache.
const MAX_BUCKETS: usize = 1 << 11;
/// Pairs per bucket aimed at, 64 KiB.
const BUCKET: usize = 1 << 13;

/// Indices per bucket at most, where [`MAX_BUCKETS`] allows: their counters stay in the cache.
const MAX_WIDTH: usize = 1 << 15;
/// Bits of `j` per pass: counters of 8 KiB beside a bucket of 64 KiB.
const DIGIT: u32 = 11;

/// Buffers that survive between calls.
#[derive(Debug, Default)]
pub(crate) struct Canonical {
    scratch: Vec<Pair>,
    starts: Vec<usize>,
}

impl Canonical {
    /// Writes the pairs of `chunks` to `out` in canonical order; indices are below `spheres`.
    pub(crate) fn order(&mut self, chunks: &[Vec<Pair>], spheres: usize, out: &mut Vec<Pair>) {
        let total: usize = chunks.iter().map(Vec::len).sum();
        let buckets = (total / BUCKET).max(spheres / MAX_WIDTH).next_power_of_two().min(MAX_BUCKETS);
        let width = spheres.div_ceil(buckets).max(1).next_power_of_two();
        let shift = width.trailing_zeros();
        let buckets = spheres.div_ceil(width).max(1);
        self.scratch.resize(total, Pair::default());
        out.resize(total, Pair::default());

        let pieces: Vec<&[Pair]> = chunks.iter().flat_map(|chunk| chunk.chunks(PIECE)).collect();
        self.spread(&pieces, shift, buckets);

        let ends = self.starts[1..].iter().copied();
        let targets = split_at(out, ends.clone());
        let sources = split_at(&mut self.scratch, ends);
        let largest = spheres.saturating_sub(1) as u32;
        targets.into_par_iter().zip(sources).enumerate().for_each(|(bucket, (target, source))| {
            order_bucket(source, target, ((bucket << shift) as u32, width as u32), largest);
        });
    }

    /// Moves the pairs to `scratch`, bucket by bucket, and notes where each bucket starts.
    fn spread(&mut self, pieces: &[&[Pair]], shift: u32, buckets: usize) {
        let count = |piece: &&[Pair]| {
            let mut counts = vec![0_usize; buckets];
            for pair in *piece {
                counts[(pair.i >> shift) as usize] += 1;
            }
            counts
        };
        let mut offsets: Vec<Vec<usize>> = pieces.par_iter().map(count).collect();
        self.starts.clear();
        let mut at = 0;
        for bucket in 0..buckets {
            self.starts.push(at);
            for piece in &mut offsets {
                at += std::mem::replace(&mut piece[bucket], at);
            }
        }
        self.starts.push(at);

        let scratch = Disjoint::new(&mut self.scratch);
        pieces.par_iter().zip(offsets).for_each(|(piece, mut next)| {
            for &pair in *piece {
                let slot = &mut next[(pair.i >> shift) as usize];
                // SAFETY: the exclusive prefix sums over (bucket, piece) give every pair a slot of its own below
                // `total`, the length of `scratch`.
                unsafe { scratch.write(*slot, pair) };
                *slot += 1;
            }
        });
    }
}

/// Orders one bucket, whose `i` start at `first`, from `source` into `target`: a stable counting sort for each digit
/// of `j`, then one for `i`. An even number of passes before the last leaves the bucket where the last one reads it.
fn order_bucket(source: &mut [Pair], target: &mut [Pair], (first, width): (u32, u32), largest_j: u32) {
    let bits = 32 - largest_j.leading_zeros();
    let passes = bits.div_ceil(DIGIT).next_multiple_of(2).max(2);
    let digit = bits.div_ceil(passes);
    let mask = (1_u32 << digit) - 1;
    let mut counts = vec![0; 1 << digit];
    for pass in (0..passes).step_by(2) {
        let (low, high) = (pass * digit, (pass + 1) * digit);
        counting_sort(source, target, &mut counts, |pair| pair.j >> low & mask);
        counting_sort(target, source, &mut counts, |pair| pair.j.checked_shr(high).unwrap_or(0) & mask);
    }
    counting_sort(source, target, &mut vec![0; width as usize], |pair| pair.i - first);
}

/// One stable pass; `key` is below the number of `counts`, which are zero on entry and on return.
fn counting_sort(source: &[Pair], target: &mut [Pair], counts: &mut [u32], key: impl Fn(&Pair) -> u32) {
    for pair in source {
        counts[key(pair) as usize] += 1;
    }
    let mut at = 0;
    for count in counts.iter_mut() {
        at += std::mem::replace(count, at);
    }
    for pair in source {
        let slot = &mut counts[key(pair) as usize];
        target[*slot as usize] = *pair;
        *slot += 1;
    }
    counts.fill(0);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(spheres: u32, pairs: Vec<Pair>, pieces: usize) {
        let chunks: Vec<Vec<Pair>> = pairs.chunks(pieces).map(<[Pair]>::to_vec).collect();
        let mut expected = pairs;
        expected.sort_unstable();
        let (mut canonical, mut out) = (Canonical::default(), Vec::new());
        for _ in 0..2 {
            canonical.order(&chunks, spheres as usize, &mut out);
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
