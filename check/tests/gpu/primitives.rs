//! Cases that the drivers of test machines do not show.

use std::mem::replace;

use crate::common::{device, download, limited, submit, upload};
use Access::{Read, ReadWrite};
use lazygrid::Error;
use lazygrid::gpu::wgpu::{self, Limits};
use lazygrid::gpu::{GpuDevice, KeyValueBuffers, PrefixScan, RadixSort};
use lazygrid_check::kernels::primitives;
use lazygrid_kernels::kernel::{Access, Kernel, RADIX_SCAN, RADIX_SCATTER, SCAN_SPINE, SCAN_TILE, Variant};
use lazygrid_kernels::layout::SortCounts;

/// Workgroups along one dimension, which each device supports: the digits of a sort pass.
const ROW: u32 = 256;
/// A partial last row of tiles.
const ITEMS: usize = 1_100_001;

#[test]
fn dispatch_over_several_dimensions() {
    let Some(gpu) = device() else { return };
    let gpu = limited(&gpu, |limits| Limits { max_compute_workgroups_per_dimension: ROW, ..limits });
    primitives::scan(&gpu, ITEMS).unwrap_or_else(|fault| panic!("scan: {fault}"));
    primitives::sort(&gpu, ITEMS).unwrap_or_else(|fault| panic!("sort: {fault}"));
}

fn run_text(gpu: &GpuDevice, name: &'static str, text: String, buffers: &[(Access, &wgpu::Buffer)]) {
    let accesses = buffers.iter().map(|(access, _)| *access);
    // SAFETY: the text is a kernel's with its threads in another order. `kernels/tests/loops.rs` checks its
    // loops.
    let (pipeline, layout) = unsafe { gpu.compile(name, accesses, text) }.expect("compiled");
    let resources = buffers.iter().map(|(_, buffer)| buffer.as_entire_binding());
    let entries: Vec<_> =
        (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
    let descriptor = wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries };
    let bindings = gpu.device.create_bind_group(&descriptor);
    submit(gpu, |encoder| {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups(1, 1, 1);
    });
}

/// Threads may run in any order between two barriers, but software adapters start with the first.
fn both_ways(kernel: &Kernel) -> [String; 2] {
    let forwards = kernel.wgsl(Variant::default());
    let backwards = forwards.replace("Thread(local_invocation)", "Thread(255u - local_invocation)");
    assert_ne!(forwards, backwards);
    [forwards, backwards]
}

/// The thread that starts a round must not change values that others still read.
#[test]
fn scan_of_many_tiles_continues_over_rounds() {
    let Some(gpu) = device() else { return };
    let tiles = 3 * 2048 + 5_u32;
    let sums = (0..tiles).map(|tile| u64::from(tile) << 20 | 1);
    let before: Vec<u64> = sums.clone().scan(0, |all, sum| Some(replace(all, *all + sum))).collect();
    let sums: Vec<u64> = sums.collect();
    let total: u64 = sums.iter().sum();
    for text in both_ways(&SCAN_SPINE) {
        let lengths = upload(&gpu, &[SortCounts { items: 0, counters: tiles * SCAN_TILE }]);
        let (found, all) = (upload(&gpu, &sums), upload(&gpu, &[0_u64; 2]));
        run_text(&gpu, "scan_spine", text, &[(Read, &lengths), (ReadWrite, &found), (ReadWrite, &all)]);
        assert!(download::<u64>(&gpu, &found, tiles as usize) == before);
        assert_eq!(download::<u64>(&gpu, &all, 1), [total]);
    }
    let [counts, before] =
        [sums, before].map(|values| values.iter().map(|&sum| sum as u32).collect::<Vec<_>>());
    for text in both_ways(&RADIX_SCAN) {
        let lengths = upload(&gpu, &[SortCounts { items: 0, counters: 256 * tiles }]);
        let (found, totals) = (upload(&gpu, &counts), upload(&gpu, &[0_u32; 256]));
        run_text(&gpu, "radix_scan", text, &[(Read, &lengths), (ReadWrite, &found), (ReadWrite, &totals)]);
        assert!(download::<u32>(&gpu, &found, tiles as usize) == before);
        assert_eq!(download::<u32>(&gpu, &totals, 1), [total as u32]);
    }
}

/// Subgroups may have up to 128 threads, but have far fewer on test machines.
#[test]
fn lowest_lane_of_any_subgroup_mask() {
    let Some(gpu) = device() else { return };
    let text = RADIX_SCATTER.wgsl(Variant { subgroups: Some(32), ..Variant::default() });
    let begin = text.find("fn lowest_lane").expect("ranking by subgroups");
    let function = &text[begin..begin + text[begin..].find("\n}\n").expect("its end") + 3];
    let masks: Vec<u128> = (0..128).map(|lane| 0xb5 << lane | 1 << 127).collect();
    let (input_buffer, found) = (upload(&gpu, &masks), upload(&gpu, &[0_u32; 128]));
    let harness = "@group(0) @binding(0) var<storage, read> masks: array<vec4<u32>>;
        @group(0) @binding(1) var<storage, read_write> lanes: array<u32>;
        @compute @workgroup_size(128)
        fn lowest(@builtin(local_invocation_index) k: u32) { lanes[k] = lowest_lane(masks[k]); }\n";
    let buffers = [(Read, &input_buffer), (ReadWrite, &found)];
    run_text(&gpu, "lowest", format!("{harness}{function}"), &buffers);
    let expected: Vec<u32> = masks.iter().map(|mask| mask.trailing_zeros()).collect();
    assert_eq!(download::<u32>(&gpu, &found, 128), expected);
}

#[test]
fn buffers_shorter_than_the_count_are_refused() {
    let Some(gpu) = device() else { return };
    let short = upload(&gpu, &[0_u32; 100]);
    let scan = PrefixScan::new(&gpu.device, true);
    let sort = RadixSort::new(&gpu.device, true);
    let input = KeyValueBuffers { keys: short.clone(), payload: short.clone() };
    scan.bind(&short, 100).expect("long enough");
    sort.bind(&input, 100, 8).expect("long enough");
    let needed = |error| matches!(error, Error::BufferSize { size: 400, needed: 404, .. });
    assert!(needed(scan.bind(&short, 101).expect_err("too short")));
    assert!(needed(sort.bind(&input, 101, 8).expect_err("too short")));
}
