//! The wrap kernel against `Space::wrap`, and the times of a call in parts.

use lazygrid_kernels::{Algorithm, Space, Sphere};

use super::*;
use crate::gpu::adapter::device_or_skip;
use crate::gpu::{GpuDevice, Phase};

/// What the kernel makes of these spheres.
fn wrapped(own: &GpuDevice, space: Space, spheres: &[Sphere]) -> Vec<Sphere> {
    let settings = GpuSettings { algorithm: Algorithm::Naive, space, ..GpuSettings::default() };
    let mut detector =
        GpuDetector::with_pipelines(&own.device, own.pipelines.clone(), settings).expect("made");
    let size = size_of_val(spheres) as u64;
    let buffer = |usage| {
        let descriptor =
            wgpu::BufferDescriptor { label: Some("test"), size, usage, mapped_at_creation: false };
        own.device.create_buffer(&descriptor)
    };
    let given = buffer(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST);
    let back = buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
    own.queue.write_buffer(&given, 0, bytemuck::cast_slice(spheres));
    let mut encoder = own.device.create_command_encoder(&Default::default());
    let count = Count::Host(spheres.len() as u32);
    let input = GpuSpheres { spheres: &given, count, species: None, window: 0..0 };
    detector.encode(&mut encoder, &input).expect("recorded");
    let buffers = &detector.prepared.as_ref().expect("recorded").buffers;
    encoder.copy_buffer_to_buffer(buffers.get(Slot::Wrapped), 0, &back, 0, size);
    own.queue.submit([encoder.finish()]);
    back.slice(..).map_async(wgpu::MapMode::Read, |result| result.expect("mapped"));
    own.device.poll(wgpu::PollType::wait_indefinitely()).expect("finished");
    bytemuck::pod_collect_to_vec(&back.slice(..).get_mapped_range().expect("mapped"))
}

#[test]
fn the_kernel_wraps_as_the_host_does() {
    let Some(own) = device_or_skip() else { return };
    let tiny = f32::from_bits(1);
    let lengths =
        [1.0, 0.1, 3.0, 1.0 / 3.0, 16_777_215.0, 1e-30, 1e30, f32::MAX, f32::MIN_POSITIVE, 3.0 * tiny, tiny];
    let mut state = 1_u64;
    for length in lengths {
        let space = Space::periodic([Some(length), None, Some(length)]).expect("a length");
        let mut coordinates = vec![0.0, -0.0, length, tiny, f32::MAX, f32::NAN, f32::INFINITY];
        for k in 0..3000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // Any float; some lengths; next to a tie, near and far.
            let any = f32::from_bits((state >> 32) as u32);
            let some = ((state >> 40) as f32 / (1 << 20) as f32) * length;
            let tie = (state >> 61) as f32 * 0.5 * length;
            let far = (state >> 50) as f32 * 8192.0 * length;
            coordinates.push([any, some, tie, tie.next_up(), tie.next_down(), far][k % 6]);
        }
        let spheres: Vec<Sphere> = coordinates.iter().map(|&x| Sphere::new([x, x, -x], 1.0)).collect();
        for (given, found) in spheres.iter().zip(wrapped(&own, space, &spheres)) {
            let expected = space.wrap(given.center);
            for axis in [0, 2] {
                let (x, y) = (expected[axis], found.center[axis]);
                // Zeroes compare equal; what is not finite stays so, for the quarantine to find.
                let same = if x.is_nan() { !y.is_finite() } else { x == y };
                assert!(same, "{:e} in {length:e}: {y:e} instead of {x:e}", given.center[axis]);
            }
            assert_eq!(given.center.y.to_bits(), found.center.y.to_bits());
            assert_eq!(found.radius, 1.0);
        }
    }
}

/// The ticks of the last recorded call or part, by phase.
fn ticks(own: &GpuDevice, detector: &GpuDetector, mut encoder: wgpu::CommandEncoder) -> Vec<[u64; 2]> {
    let ticks = detector.ticks().expect("timed");
    let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let descriptor =
        wgpu::BufferDescriptor { label: Some("test"), size: ticks.size(), usage, mapped_at_creation: false };
    let back = own.device.create_buffer(&descriptor);
    encoder.copy_buffer_to_buffer(ticks, 0, &back, 0, ticks.size());
    own.queue.submit([encoder.finish()]);
    back.slice(..).map_async(wgpu::MapMode::Read, |result| result.expect("mapped"));
    own.device.poll(wgpu::PollType::wait_indefinitely()).expect("finished");
    bytemuck::pod_collect_to_vec(&back.slice(..).get_mapped_range().expect("mapped"))
}

#[test]
fn a_further_part_is_timed_as_a_search() {
    let Some(own) = device_or_skip() else { return };
    if !own.adapter.has_timestamps {
        return;
    }
    let settings = GpuSettings { algorithm: Algorithm::ArrayGrid, timed: true, ..GpuSettings::default() };
    let mut detector =
        GpuDetector::with_pipelines(&own.device, own.pipelines.clone(), settings).expect("made");
    detector.set_part_tests(1 << 20);
    let spheres = vec![Sphere::new([1.0; 3], 0.5); 3000];
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    let size = size_of_val(&spheres[..]) as u64;
    let descriptor = wgpu::BufferDescriptor { label: Some("test"), size, usage, mapped_at_creation: false };
    let given = own.device.create_buffer(&descriptor);
    own.queue.write_buffer(&given, 0, bytemuck::cast_slice(&spheres));
    let mut encoder = own.device.create_command_encoder(&Default::default());
    let input =
        GpuSpheres { spheres: &given, count: Count::Host(3000), species: None, window: GpuSpheres::ALL };
    detector.encode(&mut encoder, &input).expect("recorded");
    let first = ticks(&own, &detector, encoder);
    let mut encoder = own.device.create_command_encoder(&Default::default());
    detector.encode_rest(&mut encoder);
    let rest = ticks(&own, &detector, encoder);
    for phase in Phase::ALL {
        let ([begin, end], [rest_begin, rest_end]) = (first[phase as usize], rest[phase as usize]);
        assert!(begin <= end && rest_begin <= rest_end, "{phase:?}: {first:?}, {rest:?}");
        if phase == Phase::Search {
            assert!(end <= rest_begin && begin < rest_begin, "{first:?}, {rest:?}");
        } else {
            assert_eq!([begin, end], [rest_begin, rest_end], "{phase:?}");
        }
    }
}
