use lazygrid::gpu::{GpuDevice, KeyValueBuffers, PrefixScan, RadixSort};
use lazygrid_kernels::kernel::{SCAN_ONCE, SCANNED_AT_ONCE};
use lazygrid_kernels::layout::SortCounts;

use super::kernel_call::KernelCall;
use super::support::{KernelError, same, variants};
use crate::Random;
use crate::device::{download, submit, upload};

/// Sizes around a workgroup and a tile, and of many tiles.
pub const SIZES: [usize; 12] = [0, 1, 255, 256, 257, 2047, 2048, 2049, 4095, 4096, 4097, 300_000];
/// Number of keys at or above which only random keys are sorted, by two numbers of bits.
const MIN_LARGE_SIZE: usize = 100_000;

fn scan_plain(values: &[u32]) -> (Vec<u32>, u64) {
    let mut total = 0_u64;
    let before = values.iter().map(|value| {
        let before = total as u32;
        total += u64::from(*value);
        before
    });
    (before.collect(), total)
}

pub fn scan(gpu: &GpuDevice, size: usize) -> Result<(), KernelError> {
    for subgroups in [false, true] {
        let scan = PrefixScan::new(&gpu.device, subgroups);
        let mut random = Random(size as u64);
        let random = (0..size).map(|_| random.word()).collect();
        for values in [random, vec![1; size], vec![u32::MAX; size]] {
            let buffer = upload(gpu, &values)?;
            let scan = scan.bind(&buffer, size as u32)?;
            submit(gpu, |encoder| {
                scan.encode(encoder);
                Ok(())
            })?;
            let total = download::<u32>(gpu, scan.total(), 2)?;
            let total = u64::from(total[1]) << 32 | u64::from(total[0]);
            let found = (download(gpu, &buffer, size)?, total);
            same(|| format!("{size} values, subgroups {subgroups}"), &found, &scan_plain(&values))?;
        }
    }
    Ok(())
}

pub(crate) fn scan_once(gpu: &GpuDevice) -> Result<(), KernelError> {
    for variant in variants(gpu) {
        for size in [0, 1, 255, 256, 257, 30_002, SCANNED_AT_ONCE as usize] {
            let mut random = Random(size as u64);
            let mut values: Vec<u32> = (0..size).map(|_| random.word() >> 16).collect();
            let largest = values.iter().copied().max().unwrap_or(0);
            // The kernel reads four values at once and stores the largest after the last.
            values.resize((size + 1).next_multiple_of(4), 0);
            let lengths = SortCounts { items: 0, counters: size as u32 };
            let call = KernelCall::new(gpu).with("sort_counts", &[lengths])?.with("values", &values)?;
            call.run(&SCAN_ONCE, variant, 1)?;
            let found = call.read::<u32>("values", size + 1)?;
            let mut expected = scan_plain(&values[..size]).0;
            expected.push(largest);
            same(|| format!("{size} values, {variant:?}"), &found, &expected)?;
        }
    }
    Ok(())
}

fn sort_one(gpu: &GpuDevice, sort: &RadixSort, keys: &[u32], bits: u32) -> Result<(), KernelError> {
    let count = keys.len();
    let payload: Vec<u32> = (0..count as u32).collect();
    let input = KeyValueBuffers { keys: upload(gpu, keys)?, payload: upload(gpu, &payload)? };
    let sort = sort.bind(&input, count as u32, bits)?;
    submit(gpu, |encoder| {
        sort.encode(encoder);
        Ok(())
    })?;
    let sorted = sort.sorted();
    let mut expected = payload;
    let mask = u32::MAX >> (32 - bits);
    expected.sort_by_key(|&index| keys[index as usize] & mask);
    let moved: Vec<u32> = expected.iter().map(|&index| keys[index as usize]).collect();
    let found: [Vec<u32>; 2] = [download(gpu, &sorted.payload, count)?, download(gpu, &sorted.keys, count)?];
    same(|| format!("payload and keys, {count} by {bits} bits"), &found, &[expected, moved])
}

fn keys_of_each_kind(size: usize) -> [Vec<u32>; 4] {
    let mut random = Random(size as u64);
    [
        (0..size).map(|_| random.word()).collect(),
        (0..size as u32).collect(),
        (0..size as u32).rev().collect(),
        vec![0xabcd_ef01; size],
    ]
}

pub fn sort(gpu: &GpuDevice, size: usize) -> Result<(), KernelError> {
    for subgroups in [false, true] {
        let sort = RadixSort::new(&gpu.device, subgroups);
        let [random, others @ ..] = keys_of_each_kind(size);
        if size >= MIN_LARGE_SIZE {
            [24, 32].into_iter().try_for_each(|bits| sort_one(gpu, &sort, &random, bits))?;
            continue;
        }
        [1, 8, 13, 24, 25, 32].into_iter().try_for_each(|bits| sort_one(gpu, &sort, &random, bits))?;
        for keys in others {
            [13, 32].into_iter().try_for_each(|bits| sort_one(gpu, &sort, &keys, bits))?;
        }
    }
    Ok(())
}
