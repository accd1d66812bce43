use std::ops::ControlFlow;

use lazygrid_kernels::{Algorithm, Pair, Sphere, Spheres};

use super::call_buffers::CallBuffers;
use super::*;
use crate::gpu::detector::{BufferRange, GpuSkinDetector, GpuSpheres};
use crate::gpu::device::device_or_skip;
use crate::gpu::test_support::{Random, download};

fn spheres() -> Vec<Sphere> {
    let mut random = Random(7);
    let crowd = (0..2600).map(|k| Sphere::new([0.5 + 1e-4 * k as f32, 0.5, 0.5], 1.1e-4));
    let mut all: Vec<Sphere> = crowd.collect();
    all.extend((0..1500).map(|_| Sphere::new([(); 3].map(|()| 10.0 * random.unit()), 0.2)));
    all
}

fn sorted(pairs: &[Pair]) -> Vec<Pair> {
    let mut pairs = pairs.to_vec();
    pairs.sort_unstable();
    pairs
}

fn finish(session: &mut GpuSession, spheres: &[Sphere]) -> Vec<Pair> {
    let ticket = session.begin(Spheres::from(spheres)).expect("begun");
    sorted(session.finish(ticket, u64::MAX).expect("found"))
}

#[test]
fn sessions_with_a_tiny_budget_find_equal_pairs_in_many_parts() {
    let Some(gpu) = device_or_skip() else { return };
    let spheres = spheres();
    for &algorithm in Algorithm::GPU {
        let settings = GpuConfig::default().algorithm(algorithm).timestamps(true);
        let mut whole = GpuSession::new(gpu.clone(), settings.clone()).expect("made");
        let mut parted =
            GpuSession::new(gpu.clone(), settings.max_tests_per_dispatch(1 << 18)).expect("made");
        let expected = finish(&mut whole, &spheres);
        assert!(expected.len() > 3000, "{algorithm}: {} pairs", expected.len());
        assert_eq!(finish(&mut parted, &spheres), expected, "{algorithm}");
        let counts = parted.submissions();
        assert!(counts.parts > 9 && counts.parts > whole.submissions().parts, "{algorithm}: {counts:?}");
        let is_timed = parted.timings().iter().any(|timing| timing.name == "search");
        assert!(is_timed || !gpu.adapter.has_timestamps, "{:?}", parted.timings());
    }
}

#[test]
fn candidate_lists_with_a_tiny_budget_find_equal_pairs() {
    let Some(gpu) = device_or_skip() else { return };
    let mut spheres = spheres();
    let settings = GpuConfig::default().algorithm(Algorithm::CellList).max_tests_per_dispatch(1 << 18);
    let mut parted = GpuSession::new(gpu.clone(), settings).expect("made");
    parted.set_skin(Some(0.05)).expect("valid");
    let mut whole = GpuSession::new(gpu, GpuConfig::default()).expect("made");
    for _ in 0..3 {
        let expected = finish(&mut whole, &spheres);
        assert_eq!(finish(&mut parted, &spheres), expected);
        assert!(parted.candidate_list_stats().is_some(), "the list did not fit");
        spheres[0].center.y += 0.01;
    }
}

fn encode(gpu: &GpuDevice, detector: &mut GpuDetector, input: &GpuSpheres<'_>) -> (Vec<Outcome>, Vec<Pair>) {
    let mut outcomes = Vec::new();
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let output = detector.encode(&mut encoder, input).expect("recorded");
    loop {
        let bytes = read(gpu, encoder, &output.outcome);
        let outcome = crate::gpu::read_outcome(&bytes).expect("an outcome");
        outcomes.push(outcome);
        encoder = gpu.device.create_command_encoder(&Default::default());
        if !outcome.has_remaining_work() {
            let bytes = read(gpu, encoder, &output.pairs);
            let pairs: &[Pair] = bytemuck::cast_slice(&bytes[..outcome.found() as usize * 8]);
            return (outcomes, sorted(pairs));
        }
        assert_ne!(outcome.overflow & Outcome::OVERFLOW_WORK, 0, "{outcome:?}");
        detector.encode_continuation(&mut encoder);
    }
}

fn read(gpu: &GpuDevice, encoder: wgpu::CommandEncoder, from: &wgpu::Buffer) -> Vec<u8> {
    download(gpu, encoder, from, from.size() as usize)
}

#[test]
fn encoders_of_the_caller_get_bounded_dispatches_and_continuations() {
    let Some(gpu) = device_or_skip() else { return };
    let spheres = spheres();
    let mut call_buffers = CallBuffers::default();
    call_buffers.upload(&gpu, Spheres::from(&spheres)).expect("uploaded");
    let buffer = call_buffers.spheres.clone().expect("uploaded");
    let input = GpuSpheres::new(&buffer, call_buffers.count);
    for &algorithm in Algorithm::GPU {
        let settings = GpuConfig::default().algorithm(algorithm).pair_capacity(1 << 16);
        let mut whole = GpuDetector::new(&gpu.device, settings.clone()).expect("made");
        let (outcomes, expected) = encode(&gpu, &mut whole, &input);
        assert_eq!((outcomes.len(), outcomes[0].overflow), (1, 0), "{algorithm}");
        let settings = settings.max_tests_per_dispatch(1 << 18);
        let mut parted = GpuDetector::new(&gpu.device, settings).expect("made");
        let (outcomes, found) = encode(&gpu, &mut parted, &input);
        assert_eq!(found, expected, "{algorithm}");
        let cost = parted.cost(call_buffers.count).expect("fits");
        assert!(cost.parts > 9 && cost.parts == parted.parts(), "{algorithm}: {cost:?}");
        let last = outcomes.last().expect("one call");
        assert_eq!(last.overflow, 0, "{algorithm}: {last:?}");
        parted.set_deferred_parts(parted.needed_deferred_parts(last));
        let (outcomes, found) = encode(&gpu, &mut parted, &input);
        assert_eq!((outcomes.len(), &found), (1, &expected), "{algorithm}");
    }
}

#[test]
fn candidate_search_of_the_caller_reports_unfinished_work() {
    let Some(gpu) = device_or_skip() else { return };
    // Few spheres would have a fixed number of workgroups.
    let mut spheres = vec![Sphere::new([1.0; 3], 0.1); 2600];
    spheres.extend((0..32_000).map(|k| Sphere::new([10.0 + k as f32, 0.0, 0.0], 0.1)));
    let mut call_buffers = CallBuffers::default();
    call_buffers.upload(&gpu, Spheres::from(&spheres)).expect("uploaded");
    let buffer = call_buffers.spheres.clone().expect("uploaded");
    let settings = GpuConfig::default().algorithm(Algorithm::CellList).pair_capacity(1 << 22);
    let mut detector =
        GpuSkinDetector::new(&gpu.device, settings.max_tests_per_dispatch(1 << 18), 0.01).expect("made");
    let call = |detector: &mut GpuSkinDetector| {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let output =
            detector.encode(&mut encoder, &GpuSpheres::new(&buffer, call_buffers.count)).expect("recorded");
        crate::gpu::read_outcome(&read(&gpu, encoder, &output.outcome)).expect("an outcome")
    };
    let outcome = call(&mut detector);
    assert_ne!(outcome.overflow & Outcome::OVERFLOW_WORK, 0, "{outcome:?}");
    let parts = detector.needed_deferred_parts(&outcome);
    assert!(parts > 1, "{outcome:?}");
    detector.set_deferred_parts(parts);
    let outcome = call(&mut detector);
    assert_eq!((outcome.overflow, outcome.found()), (0, 2600 * 2599 / 2), "{outcome:?}");
}

#[test]
fn unfinished_search_for_candidates_leaves_no_list() {
    let Some(gpu) = device_or_skip() else { return };
    let mut spheres = spheres();
    let settings = GpuConfig::default().algorithm(Algorithm::CellList).max_tests_per_dispatch(1 << 18);
    let mut skin = GpuSkinDetector::new(&gpu.device, settings.clone(), 0.05).expect("made");
    let mut call_buffers = CallBuffers::default();
    for last_part in [u32::MAX, 0, u32::MAX] {
        call_buffers.upload(&gpu, Spheres::from(&spheres)).expect("uploaded");
        let buffer = call_buffers.spheres.clone().expect("uploaded");
        let input = GpuSpheres::new(&buffer, call_buffers.count);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let output = skin.bind(&input).expect("bound");
        assert!(skin.parts() > 9);
        (0..skin.parts()).take_while(|&part| part <= last_part).for_each(|part| {
            skin.encode_part(&mut encoder, part);
        });
        let outcome = crate::gpu::read_outcome(&read(&gpu, encoder, &output.outcome)).expect("an outcome");
        if last_part == u32::MAX {
            let mut whole = GpuDetector::new(&gpu.device, settings.clone()).expect("made");
            let (_, expected) = encode(&gpu, &mut whole, &input);
            assert_eq!((outcome.found(), outcome.overflow), (expected.len() as u64, 0));
            spheres.iter_mut().for_each(|sphere| sphere.center.x *= 1.5);
        }
    }
}

#[test]
fn result_above_the_staged_pairs_is_copied_without_a_search() {
    let Some(gpu) = device_or_skip() else { return };
    // 6048 pairs, more than `FIRST_PAIRS`, of clumps that do not overfill cells.
    let spheres: Vec<_> =
        (0..192).map(|i| Sphere::new([f32::from(i / 64_u8) * 10.0, 1.0, 1.0], 0.5)).collect();
    for skin in [None, Some(0.5)] {
        let mut session = GpuSession::new(gpu.clone(), GpuConfig::default()).expect("made");
        session.set_skin(skin).expect("valid");
        assert_eq!(finish(&mut session, &spheres).len(), 6048);
        let counts = session.submissions();
        assert_eq!((counts.searches, counts.copies), (1, 1), "skin {skin:?}");
        let is_rebuilt = session.candidate_list_stats().is_some_and(|list| list.rebuilt.is_some());
        assert_eq!(is_rebuilt, skin.is_some());
        assert_eq!(finish(&mut session, &spheres).len(), 6048);
        assert_eq!((session.submissions().searches, session.submissions().copies), (1, 0));
    }
    let mut session = GpuSession::new(gpu.clone(), GpuConfig::default()).expect("made");
    let ticket = session.begin(Spheres::from(&spheres)).expect("begun");
    let mut parts = Vec::new();
    let take = |pairs: &mut Vec<Pair>| {
        parts.push(pairs.len());
        ControlFlow::Continue(())
    };
    session.finish_in_parts(ticket, take).expect("found");
    assert_eq!((parts, session.submissions().searches), (vec![6048], 1));
    let mut session = GpuSession::new(gpu, GpuConfig::default()).expect("made");
    let [first, second] = [(); 2].map(|()| session.begin(Spheres::from(&spheres)).expect("begun"));
    assert_eq!(session.finish(first, u64::MAX).map(<[Pair]>::len), Ok(6048));
    assert_eq!((session.submissions().searches, session.submissions().copies), (2, 0));
    assert_eq!(session.finish(second, u64::MAX).map(<[Pair]>::len), Ok(6048));
}

#[test]
fn ranges_of_a_pooled_buffer_above_the_binding_limit_are_searched() {
    let Some(gpu) = device_or_skip() else { return };
    let limits = gpu.device.limits();
    let (offset, size) = (1 << 20, limits.max_storage_buffer_binding_size + (2 << 20));
    if size > limits.max_buffer_size.min(1 << 30) {
        return;
    }
    let spheres = spheres();
    let pool = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("pool"),
        size,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.queue.write_buffer(&pool, offset, bytemuck::cast_slice(&spheres));
    let mut session = GpuSession::new(gpu.clone(), GpuConfig::default()).expect("made");
    let expected = finish(&mut session, &spheres);
    let count = spheres.len() as u32;
    for &algorithm in Algorithm::GPU {
        let settings = GpuConfig::default().algorithm(algorithm);
        let mut detector = GpuDetector::new(&gpu.device, settings.clone()).expect("made");
        let (_, found) =
            encode(&gpu, &mut detector, &GpuSpheres::new(BufferRange::new(&pool, offset), count));
        assert_eq!(found, expected, "{algorithm}");
        let slice = pool.slice(offset + 16 * 256..);
        let (_, found) = encode(&gpu, &mut detector, &GpuSpheres::new(slice, count - 256));
        let later = expected.iter().filter(|pair| pair.i >= 256);
        let later: Vec<Pair> = later.map(|pair| Pair { i: pair.i - 256, j: pair.j - 256 }).collect();
        assert_eq!(found, later, "{algorithm}");
        if algorithm != Algorithm::CellList {
            continue;
        }
        let mut skin = GpuSkinDetector::new(&gpu.device, settings, 0.1).expect("made");
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let input = GpuSpheres::new(BufferRange::new(&pool, offset), count);
        let output = skin.encode(&mut encoder, &input).expect("recorded");
        let outcome = crate::gpu::read_outcome(&read(&gpu, encoder, &output.outcome)).expect("an outcome");
        assert_eq!((outcome.found(), outcome.overflow), (expected.len() as u64, 0), "{algorithm}");
    }
    let mut detector = GpuDetector::new(&gpu.device, GpuConfig::default()).expect("made");
    let refused = |detector: &mut GpuDetector, range: BufferRange<'_>| {
        detector.bind(&GpuSpheres::new(range, count)).expect_err("refused").to_string()
    };
    assert!(refused(&mut detector, BufferRange::new(&pool, 4)).contains("buffer offset"));
    assert!(refused(&mut detector, pool.slice(offset..offset + 160).into()).contains("160"));
}

#[test]
fn cells_of_another_space_or_algorithm_are_not_reused() {
    let Some(gpu) = device_or_skip() else { return };
    let spheres: Vec<Sphere> = spheres().split_off(2600);
    let space = |length: f64| Space::periodic([Some(length); 3]).expect("valid");
    let settings = GpuConfig::default().algorithm(Algorithm::CellList).space(space(10.0));
    let mut session = GpuSession::new(gpu, settings).expect("made");
    let call = |session: &mut GpuSession, expected_reuse: u32| {
        let found = finish(session, &spheres);
        assert_eq!(
            (session.submissions().searches, session.submissions().reused_layouts),
            (1, expected_reuse)
        );
        found
    };
    let wide = call(&mut session, 0);
    assert_eq!(call(&mut session, 1), wide);
    session.set_space(space(9.0)).expect("of the same axes");
    let narrow = call(&mut session, 0);
    assert_ne!(narrow, wide);
    assert_eq!(call(&mut session, 1), narrow);
    session.set_algorithm(Algorithm::LazyGrid).expect("on the GPU");
    assert_eq!(call(&mut session, 0), narrow);
    session.set_algorithm(Algorithm::CellList).expect("on the GPU");
    assert_eq!(call(&mut session, 0), narrow);
    assert_eq!(call(&mut session, 1), narrow);
    session.set_space(space(10.0)).expect("of the same axes");
    assert_eq!(call(&mut session, 0), wide);
}

/// The end of an abandoned call must not end the next call with its buffers. Needs a driver with an asynchronous queue,
/// such as SwiftShader.
#[test]
fn abandoned_call_does_not_answer_a_later_one() {
    let Some(gpu) = device_or_skip() else { return };
    let settings = GpuConfig::default().algorithm(Algorithm::Naive).max_tests_per_dispatch(u64::MAX);
    let mut session = GpuSession::new(gpu.clone(), settings).expect("made");
    let [few, many] = [15_000, 25_000].map(|n| vec![Sphere::new([1.0; 3], 0.5); n]);
    let other = spheres();
    let expected = finish(&mut session, &other).len() as u64;
    let abandoned = session.begin(Spheres::from(&few)).expect("begun");
    let index = CallSlot::index_of(abandoned.number);
    let submission = session.slots[index].pending.as_ref().expect("in flight").submission.clone();
    let long = session.begin(Spheres::from(&many)).expect("begun");
    drop(abandoned);
    let later = session.begin(Spheres::from(&other)).expect("begun");
    assert_eq!(CallSlot::index_of(later.number), index);
    // The abandoned call ends while the long one still runs.
    gpu.poll(wgpu::PollType::Wait { submission_index: Some(submission), timeout: None }).expect("finished");
    session.set_timeout(Duration::ZERO);
    let answer = session.finish_count(later);
    let is_right = matches!(answer, Err(Error::Timeout { .. })) || answer == Ok(expected);
    assert!(is_right, "{answer:?}, not {expected}");
    session.set_timeout(Duration::from_secs(600));
    assert_eq!(session.finish_count(long), Ok(25_000 * 24_999 / 2));
}

#[test]
fn ticket_of_another_session_is_refused() {
    let Some(gpu) = device_or_skip() else { return };
    let mut sessions = [0, 1].map(|_| GpuSession::new(gpu.clone(), GpuConfig::default()).expect("made"));
    let (all, few) = (spheres(), [Sphere::new([0.0; 3], 1.0); 2]);
    let expected = finish(&mut sessions[0], &all).len() as u64;
    let _ = finish(&mut sessions[1], &few);
    let ticket = sessions[0].begin(Spheres::from(&all)).expect("begun");
    let other = sessions[1].begin(Spheres::from(&few)).expect("begun");
    assert_eq!(ticket.number, other.number);
    let [first, second] = &mut sessions;
    assert_eq!(second.finish_count(ticket), Err(Error::ForeignTicket));
    assert_eq!(second.finish_count(other), Ok(1));
    let ticket = first.begin(Spheres::from(&all)).expect("begun");
    assert_eq!(first.finish_count(ticket), Ok(expected));
}
