//! Puts pairs in canonical order: by `i`, then `j`.
//!
//! One pass distributes pairs to buckets of consecutive `i` that fit the cache, as keys of the low digits of `i` and of
//! `j`. With all buckets, a key is half as large as a pair for up to 2²¹ spheres. A radix sort orders each bucket; its
//! last pass turns keys into pairs.

use bytemuck::{Pod, cast_slice_mut};
use lazygrid_kernels::Pair;

use crate::Error;
use crate::disjoint_writes::{DisjointSlice, split_at};
use crate::executor::Executor;
use crate::memory::{try_collect, try_resize};

/// Enough chunks for any number of threads, few enough for a counter per chunk and bucket.
const MAX_CHUNKS: usize = 128;
/// Few enough that their write positions stay in the second-level cache.
const MAX_BUCKETS: usize = 1 << 11;
/// Pairs per bucket: 64 KiB.
const BUCKET: usize = 1 << 13;
/// With more values of `i` per bucket, pairs get more buckets for shorter keys.
const MAX_WIDTH: usize = 1 << 15;
/// Maximum bits of a digit: 8 KiB of counters for a bucket of 64 KiB.
const DIGIT: u32 = 11;
/// Fewer pairs are sorted by comparisons.
const MIN_RADIX_KEYS: usize = 256;

#[derive(Debug, Default)]
pub(crate) struct PairSorter {
    scratch: Vec<u32>,
    starts: Vec<usize>,
    offsets: Vec<usize>,
}

trait PairKey: Pod + Send {
    fn new(bits: u64) -> Self;
    fn bits(self) -> u64;
}

impl PairKey for u32 {
    #[inline(always)]
    fn new(bits: u64) -> Self {
        bits as Self
    }

    #[inline(always)]
    fn bits(self) -> u64 {
        self.into()
    }
}

impl PairKey for [u32; 2] {
    #[inline(always)]
    fn new(bits: u64) -> Self {
        [bits as u32, (bits >> 32) as u32]
    }

    #[inline(always)]
    fn bits(self) -> u64 {
        u64::from(self[0]) | (u64::from(self[1]) << 32)
    }
}

#[derive(Clone, Copy)]
struct BucketLayout {
    buckets: usize,
    i_bits: u32,
    j_bits: u32,
}

impl BucketLayout {
    fn new(total: usize, spheres: usize) -> Self {
        let buckets = (total / BUCKET).max(spheres / MAX_WIDTH).next_power_of_two().min(MAX_BUCKETS);
        let width = spheres.div_ceil(buckets).max(1).next_power_of_two();
        let j_bits = usize::BITS - spheres.saturating_sub(1).leading_zeros();
        Self { buckets: spheres.div_ceil(width).max(1), i_bits: width.trailing_zeros(), j_bits }
    }

    fn bits(self) -> u32 {
        self.i_bits + self.j_bits
    }

    #[inline(always)]
    fn bucket(self, pair: Pair) -> usize {
        (pair.i >> self.i_bits) as usize
    }

    #[inline(always)]
    fn key<K: PairKey>(self, pair: Pair) -> K {
        let open = u64::from(pair.i) & ((1 << self.i_bits) - 1);
        K::new((open << self.j_bits) | u64::from(pair.j))
    }

    #[inline(always)]
    fn pair<K: PairKey>(self, bucket: usize, key: K) -> Pair {
        let open = (key.bits() >> self.j_bits) as u32;
        let j = key.bits() & ((1 << self.j_bits) - 1);
        Pair { i: ((bucket << self.i_bits) as u32) | open, j: j as u32 }
    }
}

impl PairSorter {
    /// Indices must be below `spheres`. Threads divide the chunks, of which about a hundred are best.
    pub(crate) fn order(
        &mut self,
        executor: Executor,
        chunks: &[&[Pair]],
        spheres: usize,
        out: &mut Vec<Pair>,
    ) -> Result<(), Error> {
        let total: usize = chunks.iter().map(|chunk| chunk.len()).sum();
        try_resize(out, total, "pairs")?;
        let layout = BucketLayout::new(total, spheres);
        match layout.bits() <= u32::BITS {
            true => self.order_as::<u32>(executor, layout, chunks, out),
            false => self.order_as::<[u32; 2]>(executor, layout, chunks, out),
        }
    }

    fn order_as<K: PairKey>(
        &mut self,
        executor: Executor,
        layout: BucketLayout,
        chunks: &[&[Pair]],
        out: &mut [Pair],
    ) -> Result<(), Error> {
        let total = out.len();
        try_resize(&mut self.scratch, total * size_of::<K>() / size_of::<u32>(), "ordering pairs")?;
        let mut scratch = std::mem::take(&mut self.scratch);
        let keys = cast_slice_mut::<_, K>(&mut scratch);
        let ordered = self.spread(executor, layout, chunks, keys).and_then(|()| {
            let ends = self.starts[1..].iter().copied();
            let (targets, sources) = (split_at(out, ends.clone())?, split_at(keys, ends)?);
            let mut bucket_slices = try_collect(targets.into_iter().zip(sources), "buckets of pairs")?;
            executor.for_each(&mut bucket_slices, |bucket, (target, source)| {
                order_bucket(source, target, bucket, layout)
            });
            Ok(())
        });
        self.scratch = scratch;
        ordered
    }

    fn spread<K: PairKey>(
        &mut self,
        executor: Executor,
        layout: BucketLayout,
        chunks: &[&[Pair]],
        keys: &mut [K],
    ) -> Result<(), Error> {
        let Self { starts, offsets, .. } = self;
        let buckets = layout.buckets;
        let chunks_per_task = chunks.len().div_ceil(MAX_CHUNKS).max(1);
        let tasks = chunks.len().div_ceil(chunks_per_task);
        let task_pairs = |k: usize| {
            chunks[k * chunks_per_task..chunks.len().min((k + 1) * chunks_per_task)].iter().copied().flatten()
        };
        try_resize(offsets, tasks * buckets, "buckets of pairs")?;
        let mut rows = try_collect(offsets.chunks_mut(buckets), "buckets of pairs")?;
        executor.for_each(&mut rows, |k, counts| {
            counts.fill(0);
            for &pair in task_pairs(k) {
                counts[layout.bucket(pair)] += 1;
            }
        });
        try_resize(starts, buckets + 1, "buckets of pairs")?;
        let mut at = 0;
        for bucket in 0..buckets {
            starts[bucket] = at;
            for row in &mut rows {
                at += std::mem::replace(&mut row[bucket], at);
            }
        }
        starts[buckets] = at;

        let keys = DisjointSlice::new(keys);
        executor.for_each(&mut rows, |k, next| {
            for &pair in task_pairs(k) {
                let slot = &mut next[layout.bucket(pair)];
                // SAFETY: the exclusive prefix sums over (bucket, chunk) give every pair a distinct slot below the
                // number of all pairs, the length of `keys`.
                unsafe { keys.write(*slot, layout.key(pair)) };
                *slot += 1;
            }
        });
        Ok(())
    }
}

/// Counters of the radix sort have 32 bits.
fn are_radix_sorted(keys: usize) -> bool {
    keys >= MIN_RADIX_KEYS && u32::try_from(keys).is_ok()
}

fn order_bucket<K: PairKey>(source: &mut [K], target: &mut [Pair], bucket: usize, layout: BucketLayout) {
    if !are_radix_sorted(source.len()) {
        source.sort_unstable_by_key(|key| key.bits());
        let pairs = source.iter().map(|&key| layout.pair(bucket, key));
        return target.iter_mut().zip(pairs).for_each(|(to, pair)| *to = pair);
    }
    let passes = layout.bits().div_ceil(DIGIT).max(1);
    let digit = layout.bits().div_ceil(passes);
    let digit_of = |key: K, pass: u32| (key.bits() >> (pass * digit)) as usize & ((1 << digit) - 1);
    let (mut positions, mut counts) = ([0_u32; 1 << DIGIT], [0_u32; 1 << DIGIT]);
    for &key in source.iter() {
        counts[digit_of(key, 0)] += 1;
    }

    // The memory for pairs holds keys until the last pass.
    let spare = &mut cast_slice_mut::<_, K>(target)[..source.len()];
    let (mut from, mut to) = (&mut *source, spare);
    for pass in 0..passes - 1 {
        starts(&mut counts[..1 << digit], &mut positions);
        for &key in from.iter() {
            let position = &mut positions[digit_of(key, pass)];
            to[*position as usize] = key;
            *position += 1;
            counts[digit_of(key, pass + 1)] += 1;
        }
        (from, to) = (to, from);
    }
    if passes.is_multiple_of(2) {
        to.copy_from_slice(from);
    }
    starts(&mut counts[..1 << digit], &mut positions);
    for &key in source.iter() {
        let position = &mut positions[digit_of(key, passes - 1)];
        target[*position as usize] = layout.pair(bucket, key);
        *position += 1;
    }
}

fn starts(counts: &mut [u32], positions: &mut [u32]) {
    let mut at = 0;
    for (count, position) in counts.iter_mut().zip(positions) {
        *position = at;
        at += std::mem::take(count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(spheres: u32, pairs: Vec<Pair>, chunk_size: usize) {
        let chunks: Vec<&[Pair]> = pairs.chunks(chunk_size).collect();
        let mut expected = pairs.clone();
        expected.sort_unstable();
        let (mut sorter, mut out) = (PairSorter::default(), Vec::new());
        for _ in 0..2 {
            sorter.order(Executor::Pool, &chunks, spheres as usize, &mut out).expect("there is memory");
            assert_eq!(out, expected);
        }
    }

    #[test]
    fn any_number_of_pairs_in_any_order() {
        for spheres in [2, 3, 255, 256, 257, 100_000, 5_000_000, u32::MAX] {
            for count in [0, 1, 2, 255, 256, 257, 70_000] {
                let mix = |k: u32| k.wrapping_mul(2_654_435_761) >> 7;
                let pairs = (0..count).filter_map(|k| {
                    let (a, b) = (mix(k) % spheres, !mix(k + 77) % spheres);
                    (a != b).then(|| Pair::new(a, b))
                });
                check(spheres, pairs.collect(), 1000);
            }
        }
    }

    #[test]
    fn buckets_beyond_the_counters_are_sorted_by_comparisons() {
        assert!(are_radix_sorted(MIN_RADIX_KEYS) && are_radix_sorted(u32::MAX as usize));
        assert!(!are_radix_sorted(MIN_RADIX_KEYS - 1) && !are_radix_sorted(u32::MAX as usize + 1));
    }

    #[test]
    fn one_sphere_in_every_pair() {
        check(50_001, (1..50_001).rev().map(|j| Pair::new(0, j)).collect(), 777);
        check(50_001, (0..50_000).rev().map(|i| Pair::new(i, 50_000)).collect(), 777);
    }
}
