//! Radix sort and prefix scan on the device against plain sequential functions.

mod common;

use common::{Random, device, download, submit, upload};
use lazygrid::gpu::{GpuDevice, PrefixScan, RadixSort, Sorted};

/// Around a workgroup, a tile, and what one dimension of a dispatch holds.
const SIZES: [usize; 12] = [0, 1, 255, 256, 257, 2047, 2048, 4095, 4096, 4097, 300_000, 65_535 * 256 + 1];

fn scan_on(own: &GpuDevice, scan: &mut PrefixScan, values: &[u32]) -> (Vec<u32>, u64) {
    let buffer = upload(own, values);
    let total = submit(own, |encoder| scan.encode(encoder, &buffer, values.len() as u32)).expect("recorded");
    let total = download::<u32>(own, &total, 2);
    (download(own, &buffer, values.len()), u64::from(total[1]) << 32 | u64::from(total[0]))
}

fn scan_plain(values: &[u32]) -> (Vec<u32>, u64) {
    let mut total = 0_u64;
    let before = values.iter().map(|value| {
        let before = total as u32;
        total += u64::from(*value);
        before
    });
    (before.collect(), total)
}

#[test]
fn scan_agrees_with_a_running_sum() {
    let Some(own) = device() else { return };
    for subgroups in [false, true] {
        let mut scan = PrefixScan::new(&own.device, subgroups);
        for size in SIZES {
            let mut random = Random(size as u64);
            // Random values sum to far more than 32 bits hold.
            let random = (0..size).map(|_| random.word()).collect();
            for values in [random, vec![1; size], vec![u32::MAX; size]] {
                assert!(
                    scan_on(&own, &mut scan, &values) == scan_plain(&values),
                    "{size} values, subgroups {subgroups}"
                );
            }
        }
    }
}

fn check_sort(own: &GpuDevice, sort: &mut RadixSort, keys: &[u32], bits: u32) {
    let count = keys.len();
    let payload: Vec<u32> = (0..count as u32).collect();
    let input = Sorted { keys: upload(own, keys), payload: upload(own, &payload) };
    let sorted = submit(own, |encoder| sort.encode(encoder, &input, count as u32, bits)).expect("recorded");
    let mut expected = payload;
    let mask = u32::MAX >> (32 - bits);
    expected.sort_by_key(|&index| keys[index as usize] & mask);
    let found_keys: Vec<u32> = download(own, &sorted.keys, count);
    let found: Vec<u32> = download(own, &sorted.payload, count);
    assert!(found == expected, "payload of {count} keys by {bits} bits");
    assert!(
        found_keys.iter().zip(&expected).all(|(key, &index)| *key == keys[index as usize]),
        "{count} keys by {bits} bits"
    );
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

#[test]
fn sort_agrees_with_a_stable_sort() {
    let Some(own) = device() else { return };
    for subgroups in [false, true] {
        let mut sort = RadixSort::new(&own.device, subgroups);
        for size in SIZES.into_iter().filter(|size| *size <= 300_000) {
            for keys in keys_of_each_kind(size) {
                for bits in [1, 8, 13, 20, 25, 32] {
                    check_sort(&own, &mut sort, &keys, bits);
                }
            }
        }
    }
}

#[test]
fn sort_of_more_than_one_dimension_of_groups() {
    let Some(own) = device() else { return };
    for subgroups in [false, true] {
        let mut sort = RadixSort::new(&own.device, subgroups);
        let [random, ..] = keys_of_each_kind(65_535 * 256 + 1);
        check_sort(&own, &mut sort, &random, 24);
    }
}
