//! A parallel stable radix sort of (key, sphere) entries, least significant digit first, independent of threads.
//!
//! Each chunk counts its digits, gets positions from a prefix sum over (digit, chunk), and moves its entries.

use bytemuck::Zeroable;

use crate::Error;
use crate::disjoint_writes::DisjointSlice;
use crate::executor::Executor;
use crate::memory::{try_resize, with_growth};

/// Entries per chunk: 128 KiB with narrow keys, and far more than digits.
const CHUNK_RECORDS: usize = 1 << 14;
/// One thread sums the counts of all chunks.
const MAX_CHUNKS: usize = 64;
/// Bits per pass, so that the written cache lines stay in the first-level cache.
const DIGIT: u32 = 8;
const DIGITS: usize = 1 << DIGIT;

pub(crate) trait RadixKey: Copy + Ord + Zeroable + Send + Sync + From<u32> {
    /// Appends `low` as the lowest `bits`, fewer than the type has.
    fn append(self, low: u32, bits: u32) -> Self;
    /// Drops the lowest `bits`, fewer than the type has.
    fn without(self, bits: u32) -> Self;
    fn low(self) -> u32;
}

macro_rules! key {
    ($type:ty) => {
        impl RadixKey for $type {
            #[inline(always)]
            fn append(self, low: u32, bits: u32) -> Self {
                self << bits | Self::from(low)
            }

            #[inline(always)]
            fn without(self, bits: u32) -> Self {
                self >> bits
            }

            #[inline(always)]
            fn low(self) -> u32 {
                self as u32
            }
        }
    };
}

key!(u32);
key!(u128);

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Zeroable)]
pub(crate) struct KeyedSphere<K> {
    pub(crate) key: K,
    pub(crate) id: u32,
}

#[derive(Debug, Default)]
pub(crate) struct Radix<K> {
    pub(crate) entries: Vec<KeyedSphere<K>>,
    spare: Vec<KeyedSphere<K>>,
    counts: Vec<[usize; DIGITS]>,
}

impl<K: RadixKey> Radix<K> {
    const BYTES_PER_ENTRY: u64 = 2 * size_of::<KeyedSphere<K>>() as u64;

    pub(crate) fn memory_for(entries: u64) -> u64 {
        let chunks = entries.div_ceil(CHUNK_RECORDS as u64).min(MAX_CHUNKS as u64);
        with_growth(entries * Self::BYTES_PER_ENTRY + chunks * size_of::<[usize; DIGITS]>() as u64)
    }

    pub(crate) fn bytes(&self) -> usize {
        (self.entries.capacity() + self.spare.capacity()) * size_of::<KeyedSphere<K>>()
            + self.counts.capacity() * size_of::<[usize; DIGITS]>()
    }

    /// Keys must be below 2^`bits`.
    pub(crate) fn sort(&mut self, bits: u32, executor: Executor) -> Result<(), Error> {
        try_resize(&mut self.spare, self.entries.len(), "sorting entries of cells")?;
        for shift in (0..bits).step_by(DIGIT as usize) {
            if self.pass(shift, executor)? {
                std::mem::swap(&mut self.entries, &mut self.spare);
            }
        }
        Ok(())
    }

    /// Returns `false`, without a sort, if all digits agree.
    fn pass(&mut self, shift: u32, executor: Executor) -> Result<bool, Error> {
        let Self { entries, spare, counts } = self;
        let Some(first) = entries.first() else { return Ok(false) };
        let digit = |key: K| key.without(shift).low() as usize % DIGITS;
        let size = entries.len().div_ceil(MAX_CHUNKS).max(CHUNK_RECORDS);
        let chunk = |k: usize| &entries[k * size..entries.len().min((k + 1) * size)];
        try_resize(counts, entries.len().div_ceil(size), "counting entries of cells")?;
        executor.for_each(counts, |k, counts| {
            // With counters on the stack, the compiler knows that no entry aliases them.
            let mut own = [0; DIGITS];
            for entry in chunk(k) {
                own[digit(entry.key)] += 1;
            }
            *counts = own;
        });
        let alike: usize = counts.iter().map(|counts| counts[digit(first.key)]).sum();
        if alike == entries.len() {
            return Ok(false);
        }

        let mut at = 0;
        for digit in 0..DIGITS {
            for counts in &mut *counts {
                at += std::mem::replace(&mut counts[digit], at);
            }
        }
        let target = DisjointSlice::new(spare);
        executor.for_each(counts, |k, positions| {
            let mut own = *positions;
            for &entry in chunk(k) {
                let position = &mut own[digit(entry.key)];
                // SAFETY: the exclusive prefix sums over (digit, chunk) give every entry a distinct position below
                // their number, the length of `spare`.
                unsafe { target.write(*position, entry) };
                *position += 1;
            }
        });
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(bits: u32, keys: Vec<u128>) {
        let entries = (0..).zip(&keys).map(|(id, &key)| KeyedSphere { key, id }).collect();
        let mut wide = Radix::<u128> { entries, ..Radix::default() };
        let mut expected = wide.entries.clone();
        expected.sort_by_key(|entry| entry.key);
        if bits <= 32 {
            let entries = wide.entries.iter().map(|e| KeyedSphere { key: e.key as u32, id: e.id }).collect();
            let mut narrow = Radix::<u32> { entries, ..Radix::default() };
            narrow.sort(bits, Executor::Pool).expect("there is memory");
            let sorted: Vec<_> =
                narrow.entries.iter().map(|e| KeyedSphere { key: u128::from(e.key), id: e.id }).collect();
            assert!(sorted == expected, "{} narrow entries of {bits} bits", keys.len());
        }
        wide.sort(bits, Executor::Pool).expect("there is memory");
        assert!(wide.entries == expected, "{} wide entries of {bits} bits", keys.len());
    }

    #[test]
    fn agrees_with_a_sequential_stable_sort() {
        for len in
            [0, 1, 2, 1000, CHUNK_RECORDS - 1, CHUNK_RECORDS, CHUNK_RECORDS + 1, 3 * CHUNK_RECORDS + 17]
        {
            for bits in [1, 3, 11, 12, 29, 32, 99] {
                let mut state = len as u128 + 1;
                let mut random = || {
                    state = state.wrapping_mul(0x2360_ED05_1FC6_5DA4_4385_DF64_9FCC_F645).wrapping_add(1);
                    state >> (128 - bits)
                };
                check(bits, (0..len).map(|_| random()).collect());
            }
        }
    }

    #[test]
    fn equal_keys_stay_in_order() {
        check(32, vec![0xFFFF_FFFF; 2 * CHUNK_RECORDS + 1]);
        check(99, (0..2 * CHUNK_RECORDS as u128).map(|k| (k & 1) << 98).collect());
        check(0, vec![0; 5]);
    }
}
