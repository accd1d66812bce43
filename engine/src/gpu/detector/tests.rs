use std::collections::HashSet;

use bytemuck::Pod;
use encase::{ShaderType, StorageBuffer};
use lazygrid_kernels::layout::Grid;
use lazygrid_kernels::{Algorithm, Interaction, Interactions, Space, Sphere};

use super::*;
use crate::gpu::Outcome;
use crate::gpu::device::device_or_skip;
use crate::gpu::plan::BufferId;
use crate::gpu::test_support::{Random, download};
use crate::gpu::{GpuDevice, GpuPhase};

fn upload<T: Pod>(gpu: &GpuDevice, data: &[T]) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    let size = size_of_val(data) as u64;
    let descriptor = wgpu::BufferDescriptor { label: Some("test"), size, usage, mapped_at_creation: false };
    let buffer = gpu.device.create_buffer(&descriptor);
    gpu.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(data));
    buffer
}

fn encoder(gpu: &GpuDevice) -> wgpu::CommandEncoder {
    gpu.device.create_command_encoder(&Default::default())
}

fn detector(gpu: &GpuDevice, settings: GpuConfig) -> GpuDetector {
    GpuDetector::with_pipelines(&gpu.device, gpu.pipelines.clone(), settings).expect("made")
}

fn wrapped(gpu: &GpuDevice, space: Space, spheres: &[Sphere]) -> Vec<Sphere> {
    let mut detector = detector(gpu, GpuConfig::default().algorithm(Algorithm::Naive).space(space));
    let buffer = upload(gpu, spheres);
    let mut encoder = encoder(gpu);
    let input = GpuSpheres::new(&buffer, spheres.len() as u32).in_window(0..0);
    detector.encode(&mut encoder, &input).expect("recorded");
    let buffers = &detector.prepared.as_ref().expect("recorded").buffers;
    download(gpu, encoder, buffers.get(BufferId::Wrapped), spheres.len())
}

#[test]
fn the_kernel_wraps_as_the_host_does() {
    let Some(gpu) = device_or_skip() else { return };
    let tiny = f32::from_bits(1);
    let lengths =
        [1.0, 0.1, 3.0, 1.0 / 3.0, 16_777_215.0, 1e-30, 1e30, f32::MAX, f32::MIN_POSITIVE, 3.0 * tiny, tiny];
    let mut random = Random(1);
    for length in lengths {
        let both = Some(f64::from(length));
        let space = Space::periodic([both, None, both]).expect("a length");
        let mut coordinates = vec![0.0, -0.0, length, tiny, f32::MAX, f32::NAN, f32::INFINITY];
        for k in 0..3000 {
            let state = random.bits();
            let any = f32::from_bits((state >> 32) as u32);
            let some = ((state >> 40) as f32 / (1 << 20) as f32) * length;
            let tie = (state >> 61) as f32 * 0.5 * length;
            let far = (state >> 50) as f32 * 8192.0 * length;
            coordinates.push([any, some, tie, tie.next_up(), tie.next_down(), far][k % 6]);
        }
        let spheres: Vec<Sphere> = coordinates.iter().map(|&x| Sphere::new([x, x, -x], 1.0)).collect();
        for (sphere, found) in spheres.iter().zip(wrapped(&gpu, space, &spheres)) {
            let expected = space.wrap(sphere.center);
            for axis in [0, 2] {
                let (x, y) = (expected[axis], found.center[axis]);
                // Zeroes compare equal. Non-finite values stay non-finite, so that kernels reject them.
                let same = if x.is_nan() { !y.is_finite() } else { x == y };
                assert!(same, "{:e} in {length:e}: {y:e} instead of {x:e}", sphere.center[axis]);
            }
            assert_eq!(sphere.center.y.to_bits(), found.center.y.to_bits());
            assert_eq!(found.radius, 1.0);
        }
    }
}

#[test]
fn continuation_is_timed_as_a_search() {
    let Some(gpu) = device_or_skip() else { return };
    if !gpu.adapter.has_timestamps {
        return;
    }
    let settings = GpuConfig::default().algorithm(Algorithm::ArrayGrid).timestamps(true);
    let mut detector = detector(&gpu, settings.max_tests_per_dispatch(1 << 20));
    let buffer = upload(&gpu, &[Sphere::new([1.0; 3], 0.5); 3000]);
    let ticks = |detector: &GpuDetector, encoder| -> Vec<[u64; 2]> {
        download(&gpu, encoder, detector.ticks().expect("timed"), GpuPhase::ALL.len())
    };
    let mut call = encoder(&gpu);
    detector.encode(&mut call, &GpuSpheres::new(&buffer, 3000)).expect("recorded");
    let first = ticks(&detector, call);
    let mut continuation = encoder(&gpu);
    detector.encode_continuation(&mut continuation);
    let rest = ticks(&detector, continuation);
    for &phase in GpuPhase::ALL {
        let ([begin, end], [rest_begin, rest_end]) = (first[phase as usize], rest[phase as usize]);
        assert!(begin <= end && rest_begin <= rest_end, "{phase:?}: {first:?}, {rest:?}");
        if phase == GpuPhase::Search {
            assert!(end <= rest_begin && begin < rest_begin, "{first:?}, {rest:?}");
        } else {
            assert_eq!([begin, end], [rest_begin, rest_end], "{phase:?}");
        }
    }
}

fn entries_of(gpu: &GpuDevice, tau: u32, spheres: &[Sphere]) -> Vec<(bool, u32)> {
    let settings = GpuConfig::default().algorithm(Algorithm::LazyGrid).tau(tau);
    let mut detector = detector(gpu, settings);
    let buffer = upload(gpu, spheres);
    let mut call = encoder(gpu);
    detector.encode(&mut call, &GpuSpheres::new(&buffer, spheres.len() as u32)).expect("recorded");
    let PreparedCall { plan, buffers, .. } = detector.prepared.as_ref().expect("recorded");
    let outcome: Vec<Outcome> = download(gpu, call, buffers.get(BufferId::Outcome), 1);
    let grid: Vec<u8> =
        download(gpu, encoder(gpu), buffers.get(BufferId::Grid), Grid::min_size().get() as usize);
    let grid: Grid = StorageBuffer::new(grid).create().expect("all of it");
    let front = plan.passes() % 2 == 1;
    let count = outcome[0].entries_needed() as usize;
    let [keys, objects]: [Vec<u32>; 2] = [BufferId::Keys(front), BufferId::Objects(front)]
        .map(|id| download(gpu, encoder(gpu), buffers.get(id), count));
    let first_keys = 1 << grid.levels[0].bits.element_sum();
    let entries = keys.iter().zip(objects);
    entries.map(|(key, object)| (key >> grid.passive < first_keys, object & 0x1fff_ffff)).collect()
}

#[test]
fn split_and_unsplit_cells_share_spheres() {
    let Some(gpu) = device_or_skip() else { return };
    // Cells are 4.1 wide with a corner at the median. Only the largest sphere has its depth, so only unsplit cells have
    // entries of others.
    let mut spheres = vec![Sphere::new([40.0; 3], 1.0)];
    let mut random = Random(40);
    let mut unit = || random.unit();
    for k in 0..300 {
        let x = if k % 10 == 0 { unit() * 4.0 - 4.0 } else { unit() * 0.8 };
        spheres.push(Sphere::new([x, unit() * 0.8, unit() * 0.8], 0.1));
    }
    spheres.extend((0..40).map(|k| Sphere::new([0.0, k as f32 * 0.02, 0.4], 0.15)));
    let sharing = (0..=350).step_by(20).map(|tau| {
        let entries = entries_of(&gpu, tau, &spheres);
        let [unsplit, split] = [true, false].map(|at_first| -> HashSet<u32> {
            entries.iter().filter(|entry| entry.0 == at_first).map(|entry| entry.1).collect()
        });
        unsplit.intersection(&split).count()
    });
    let sharing: Vec<usize> = sharing.collect();
    assert!(
        sharing.iter().filter(|&&count| count > 20).count() > 1,
        "spheres in cells of both kinds: {sharing:?}"
    );
}

#[test]
fn empty_table_of_interactions_quarantines_all_spheres() {
    let Some(gpu) = device_or_skip() else { return };
    let table = Interactions::new(0, Interaction::Touch).expect("an empty table");
    let spheres = upload(&gpu, &[Sphere::new([1.0; 3], 0.5); 600]);
    let species = upload(&gpu, &[0_u32; 600]);
    for (&algorithm, radix_sort_from) in
        Algorithm::GPU.iter().flat_map(|algorithm| [(algorithm, 0), (algorithm, u32::MAX)])
    {
        let settings = GpuConfig::default().algorithm(algorithm).interactions(table.clone());
        let mut detector = detector(&gpu, settings.radix_sort_from(radix_sort_from));
        let mut call = encoder(&gpu);
        let input = GpuSpheres::new(&spheres, 600).with_species(&species);
        let output = detector.encode(&mut call, &input).expect("recorded");
        let outcome: Vec<Outcome> = download(&gpu, call, &output.outcome, 1);
        assert_eq!((outcome[0].quarantined, outcome[0].found()), (600, 0), "{algorithm}");
    }
}
