use std::ops::ControlFlow;

use crate::common::{
    Random, cpu_pairs, device, exact_cloud, finished, gpu_detector, limited, session_count, session_pairs,
};
use lazygrid::gpu::{GpuConfig, GpuSession, wgpu};
use lazygrid::{
    Algorithm, Backend, Config, Detector, Error, Interaction, Interactions, Order, Pair, RebuildReason,
    Sphere, Spheres,
};
use lazygrid_check::detectors::results::pairs_among;

fn cloud(seed: u64, n: usize, extent: u32) -> Vec<Sphere> {
    exact_cloud(&mut Random(seed), n, extent, |random| (random.word() % 32) as f32 / 64.0)
}

fn streamed(detector: &mut Detector, spheres: &[Sphere]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    let handed = detector.stream(spheres, 1000, |chunk| {
        assert!(chunk.len() <= 1000);
        pairs.extend_from_slice(chunk);
        ControlFlow::Continue(())
    });
    assert_eq!(handed, Ok(pairs.len() as u64));
    pairs
}

#[test]
fn lists_counts_neighbors_and_streams_agree_with_the_cpu() {
    let Some(_) = device() else { return };
    for algorithm in [Algorithm::Auto, Algorithm::Naive, Algorithm::ArrayGrid] {
        let mut detector = gpu_detector(Config::default().algorithm(algorithm));
        for (n, extent) in [(0, 1), (1, 1), (2, 1), (3000, 10), (300, 2), (12_000, 25), (5000, 4)] {
            let spheres = cloud(n as u64, n, extent);
            let wanted = cpu_pairs(&spheres);
            assert_eq!(detector.pairs(&spheres).expect("found"), wanted, "{n} {algorithm}");
            assert_eq!(detector.count(&spheres).expect("counted"), wanted.len() as u64);
            let lists = detector.neighbors(&spheres).expect("neighbors");
            assert_eq!(lists.len(), n);
            assert!(pairs_among(n, |i| lists.neighbors_of(i)) == Ok(wanted.clone()), "{n} {algorithm}");
            assert!(streamed(&mut detector, &spheres) == wanted, "{n} {algorithm}");
            let report = detector.report();
            assert_eq!((report.backend, report.pairs), (Backend::Gpu, wanted.len() as u64));
            let is_timed = report.phases.iter().any(|phase| phase.name == "search");
            assert!(report.adapter.is_some() && (is_timed || report.candidates.is_some()));
        }
    }
}

#[test]
fn columns_are_accepted() {
    let Some(_) = device() else { return };
    let spheres = cloud(1, 5000, 10);
    let column = |k: usize| -> Vec<f32> {
        spheres.iter().map(|s| s.center.to_array().get(k).copied().unwrap_or(s.radius)).collect()
    };
    let [x, y, z, r] = [0, 1, 2, 3].map(column);
    let columns = Spheres::columns(&x, &y, &z, &r).expect("one length");
    assert_eq!(gpu_detector(Config::default()).pairs(columns).expect("found"), cpu_pairs(&spheres));
}

#[test]
fn too_many_pairs_are_refused_with_their_count() {
    let Some(_) = device() else { return };
    let spheres = vec![Sphere::new([0.5; 3], 1.0); 3000];
    let all = 3000 * 2999 / 2;
    let mut detector = gpu_detector(Config::default().max_pairs(all - 1));
    let error = detector.pairs(&spheres).expect_err("one too many");
    assert!(matches!(error, Error::TooManyPairs { found, .. } if found == all));
    assert_eq!(detector.count(&spheres).expect("counted"), all);
}

#[test]
fn large_result_is_delivered_in_windows() {
    let Some(gpu) = device() else { return };
    let mut spheres = cloud(2, 3000, 10);
    spheres.extend(vec![Sphere::new([1.5; 3], 0.25); 500]);
    let wanted = cpu_pairs(&spheres);
    let settings = GpuConfig::default().pair_capacity(5000);
    assert!(wanted.len() > 100_000);
    let mut session = GpuSession::new(gpu, settings).expect("made");
    let ticket = session.begin(Spheres::from(&spheres)).expect("begun");
    let mut parts = Vec::new();
    let mut all = Vec::new();
    session
        .finish_in_parts(ticket, |pairs| {
            assert!(pairs.len() <= 5000);
            parts.push(pairs.len());
            pairs.sort_unstable();
            all.append(pairs);
            ControlFlow::Continue(())
        })
        .expect("found");
    assert!(all == wanted && parts.len() > 20, "{parts:?}");
}

#[test]
fn third_call_in_flight_is_refused() {
    let Some(gpu) = device() else { return };
    let scenes: Vec<_> = (0..6).map(|k| cloud(k, 1000 + 700 * k as usize, 8)).collect();
    let mut session = GpuSession::new(gpu, GpuConfig::default()).expect("made");
    let mut before = session.begin(Spheres::from(&scenes[0])).expect("begun");
    for k in 1..scenes.len() {
        let next = session.begin(Spheres::from(&scenes[k])).expect("begun");
        let third = session.begin(Spheres::from(&scenes[k])).expect_err("two are in flight");
        assert_eq!(third, Error::TooManyInFlight { calls: 2 });
        assert_eq!(finished(&mut session, before), cpu_pairs(&scenes[k - 1]));
        before = next;
    }
    let mut pairs = pollster::block_on(session.finish_async(before, u64::MAX)).expect("found").to_vec();
    pairs.sort_unstable();
    assert_eq!(pairs, cpu_pairs(&scenes[5]));
}

#[test]
fn call_without_species_does_not_use_those_of_an_earlier_one() {
    let Some(gpu) = device() else { return };
    let mut table = Interactions::new(2, Interaction::Never).expect("two species");
    table.set(0, 1, Interaction::Touch).expect("a pair");
    let mut session = GpuSession::new(gpu, GpuConfig::default().interactions(table)).expect("made");
    let (spheres, species) = (cloud(9, 500, 6), [0, 1].repeat(250));
    for _ in 0..2 {
        let spheres_with_ids = Spheres::from(&spheres).with_species(&species).expect("as many");
        let ticket = session.begin(spheres_with_ids).expect("begun");
        assert!(!session.finish(ticket, u64::MAX).expect("found").is_empty());
    }
    let refused = session.begin(Spheres::from(&spheres)).expect_err("no species");
    assert!(matches!(refused, Error::SpeciesBuffer), "{refused}");
}

#[test]
fn crowded_searches_continue_over_several_submissions() {
    let Some(gpu) = device() else { return };
    let scenes: Vec<_> = (0..3)
        .map(|k| {
            let mut spheres = cloud(k, 2000, 20);
            spheres.extend(vec![Sphere::new([k as f32 + 0.5; 3], 0.125); 1000 + 300 * k as usize]);
            spheres.extend(vec![Sphere::new([9.25, 3.5, 0.25], 0.5); 700]);
            spheres
        })
        .collect();
    for algorithm in [Algorithm::ArrayGrid, Algorithm::EagerGrid, Algorithm::LazyGrid] {
        let settings = GpuConfig::default().algorithm(algorithm).timestamps(true).pair_capacity(500_000);
        let settings = settings.max_tests_per_dispatch(1 << 17);
        let mut session = GpuSession::new(gpu.clone(), settings).expect("made");
        let mut before = session.begin(Spheres::from(&scenes[0])).expect("begun");
        for k in [1, 2, 0] {
            let next = session.begin(Spheres::from(&scenes[k])).expect("begun");
            let scene = &scenes[(k + 2) % 3];
            let pairs = finished(&mut session, before);
            assert!(pairs == cpu_pairs(scene), "{algorithm}, {k}: {}", pairs.len());
            assert!(
                session.outcome().deferred_blocks > 4 && !session.outcome().has_remaining_work(),
                "{algorithm}"
            );
            before = next;
        }
        let found = session.finish_count(before).expect("counted");
        assert_eq!(found, cpu_pairs(&scenes[0]).len() as u64, "{algorithm}");
    }
}

/// The groups exceed the entry capacity of a first call, and the crowd takes several submissions.
#[test]
fn retried_call_keeps_its_algorithm_and_pairs() {
    let Some(gpu) = device() else { return };
    let mut spheres = vec![Sphere::new([-9.0; 3], 0.5); 900];
    let mut random = Random(7);
    for group in 0..100 {
        let corner = [group % 5, group / 5 % 5, group / 25].map(|k| k as f32 * 4.0);
        let center = corner.map(|at| at + (random.word() % 64) as f32 / 64.0);
        spheres.extend((0..50).map(|k| Sphere::new(center, 0.5_f32.powi(1 + k % 20))));
    }
    let other = cloud(5, 3000, 10);
    let (wanted, wanted_of_other) = (cpu_pairs(&spheres), cpu_pairs(&other));
    for [first, then] in
        [[Algorithm::LazyGrid, Algorithm::EagerGrid], [Algorithm::EagerGrid, Algorithm::LazyGrid]]
    {
        let settings = GpuConfig::default().algorithm(first).max_tests_per_dispatch(1 << 17);
        let mut session = GpuSession::new(gpu.clone(), settings).expect("made");
        let before = session.begin(Spheres::from(&spheres)).expect("begun");
        session.set_algorithm(then).expect("on the GPU");
        let next = session.begin(Spheres::from(&other)).expect("begun");
        let pairs = finished(&mut session, before);
        assert!(pairs == wanted, "{first}: {} of {}", pairs.len(), wanted.len());
        assert_eq!(session.algorithm(), first);
        assert!(session.outcome().deferred_blocks > 2, "it came in parts");
        let pairs = finished(&mut session, next);
        assert!(pairs == wanted_of_other, "{then}");
    }
}

#[test]
fn one_level_is_used_if_entries_exceed_the_limit() {
    let Some(gpu) = device() else { return };
    let gpu = limited(&gpu, |limits| wgpu::Limits { max_storage_buffer_binding_size: 256 << 10, ..limits });
    let n = 2000_u64;
    let spheres: Vec<_> = (0..n as i32).map(|k| Sphere::new([0.0; 3], 0.5_f32.powi(k % 20))).collect();
    let settings = GpuConfig::default().algorithm(Algorithm::LazyGrid).pair_capacity(1 << 14);
    let mut session = GpuSession::new(gpu, settings).expect("made");
    for _ in 0..2 {
        assert_eq!(session_count(&mut session, &spheres), n * (n - 1) / 2);
        assert_eq!(session.algorithm(), Algorithm::ArrayGrid);
    }
    let few = cloud(6, 1000, 8);
    assert_eq!(session_count(&mut session, &few), cpu_pairs(&few).len() as u64);
    assert_eq!(session.algorithm(), Algorithm::LazyGrid);
}

#[test]
fn stream_grows_the_output_for_a_giant() {
    let Some(gpu) = device() else { return };
    let grain = |k: u32| [k % 20, k / 20 % 20, k / 400].map(|at| at as f32);
    let mut spheres = vec![Sphere::new([10.0; 3], 50.0)];
    spheres.extend((0..8000).map(|k| Sphere::new(grain(k), 0.25)));
    let settings = GpuConfig::default().pair_capacity(500);
    let mut session = GpuSession::new(gpu, settings).expect("made");
    let ticket = session.begin(Spheres::from(&spheres)).expect("begun");
    let mut handed = Vec::new();
    let streamed = session.finish_in_parts(ticket, |pairs| {
        handed.append(pairs);
        ControlFlow::Continue(())
    });
    handed.sort_unstable();
    assert_eq!((streamed, handed == cpu_pairs(&spheres)), (Ok(()), true));
}

#[test]
fn entry_capacity_is_kept_per_input_size() {
    let Some(gpu) = device() else { return };
    let spheres: Vec<_> = (0..3000).map(|k| Sphere::new([0.0; 3], 0.5_f32.powi(k % 15))).collect();
    let settings = GpuConfig::default().algorithm(Algorithm::EagerGrid);
    let mut session = GpuSession::new(gpu, settings).expect("made");
    let memory = |session: &GpuSession, n| session.memory_for(n).expect("fits");
    let [few, same] = [30, 3000].map(|n| memory(&session, n));
    assert_eq!(session_count(&mut session, &spheres), 3000 * 2999 / 2);
    assert!(memory(&session, 3000) > same + 3000 * 8 * 16, "there is more room at that size");
    assert!(memory(&session, 30) < few + (64 << 10), "{} instead of {few}", memory(&session, 30));
}

#[test]
fn memory_estimate_includes_the_species_of_each_call() {
    let Some(gpu) = device() else { return };
    let table = Interactions::new(2, Interaction::Touch).expect("small");
    let spheres = cloud(9, 20_000, 4);
    let ids = vec![1_u32; spheres.len()];
    let estimate = |settings: &GpuConfig| {
        let session = GpuSession::new(gpu.clone(), settings.clone()).expect("made");
        session.memory_for(20_000).expect("fits")
    };
    let plain = GpuConfig::default().algorithm(Algorithm::Naive);
    let settings = plain.clone().interactions(table);
    let mut session = GpuSession::new(gpu.clone(), settings.clone()).expect("made");
    let spheres_with_ids = Spheres::from(&spheres).with_species(&ids).expect("as many");
    let tickets = [(); 2].map(|()| session.begin(spheres_with_ids).expect("begun"));
    for ticket in tickets {
        session.finish_count(ticket).expect("counted");
    }
    // Two calls in flight have two buffers of ids each, of 4 bytes per sphere, for up to 2^15 spheres.
    assert!(estimate(&settings) >= estimate(&plain) + 2 * 4 * (1 << 15));
    assert!(session.held_bytes() <= estimate(&settings));
}

#[test]
fn memory_estimate_does_not_depend_on_the_last_call() {
    let Some(_) = device() else { return };
    let mut detector = gpu_detector(Config::default());
    let before = detector.memory_for(1_000_000);
    detector.count(&cloud(8, 100, 4)).expect("counted");
    assert_eq!(detector.report().algorithm, Algorithm::Naive);
    assert_eq!(detector.memory_for(1_000_000), before);
}

#[test]
fn dropped_ticket_frees_its_slot() {
    let Some(gpu) = device() else { return };
    let scenes: Vec<_> = (0..4).map(|k| cloud(k, 2000 + 500 * k as usize, 8)).collect();
    let mut session = GpuSession::new(gpu, GpuConfig::default()).expect("made");
    for dropped in [0, 1] {
        let mut tickets: Vec<_> =
            (0..2).map(|k| session.begin(Spheres::from(&scenes[k])).expect("begun")).collect();
        assert!(session.begin(Spheres::from(&scenes[2])).is_err(), "two are in flight");
        drop(tickets.remove(dropped));
        let third = session.begin(Spheres::from(&scenes[3])).expect("there is room again");
        for (ticket, scene) in [(third, 3), (tickets.remove(0), 1 - dropped)] {
            assert_eq!(finished(&mut session, ticket), cpu_pairs(&scenes[scene]));
        }
    }
}

#[test]
fn unordered_lists_have_the_same_pairs() {
    let Some(_) = device() else { return };
    let spheres = cloud(4, 10_000, 20);
    let mut pairs =
        gpu_detector(Config::default().order(Order::Unordered)).pairs(&spheres).expect("found").to_vec();
    pairs.sort_unstable();
    assert_eq!(pairs, cpu_pairs(&spheres));
}

#[test]
fn candidate_overflow_never_fails_a_call() {
    let Some(gpu) = device() else { return };
    let settings = GpuConfig::default().pair_capacity(1 << 10);
    let gpu = limited(&gpu, |limits| wgpu::Limits { max_storage_buffer_binding_size: 1 << 20, ..limits });
    let mut session = GpuSession::new(gpu, settings).expect("a session");
    session.set_skin(Some(0.01)).expect("a skin");
    let mut count = |n: usize, what: &str| {
        let spheres = vec![Sphere::new([1.0; 3], 0.5); n];
        let found = session_count(&mut session, &spheres);
        assert_eq!(found, (n * (n - 1) / 2) as u64, "{n}, {what}");
        session.candidate_list_stats().map(|stats| (stats.count, stats.age, stats.rebuilt))
    };
    // The initial capacity is 4096 candidates, the largest 131,072.
    assert_eq!(count(80, "few"), Some((3160, 0, Some(RebuildReason::NoList))));
    assert_eq!(count(80, "few again"), Some((3160, 1, None)));
    assert_eq!(count(400, "more"), Some((79_800, 0, Some(RebuildReason::NoList))));
    assert_eq!(count(400, "more again"), Some((79_800, 1, None)));
    for _ in 0..10 {
        assert_eq!(count(600, "too many"), None);
    }
    for _ in 0..10 {
        count(80, "few for some time");
    }
    assert!(
        count(80, "few at last").is_some_and(|(candidates, age, _)| (candidates, age > 0) == (3160, true))
    );
}

#[test]
fn slowly_moving_spheres_have_a_new_layout_every_seventeenth_call() {
    let Some(gpu) = device() else { return };
    for (n, extent, radix_from) in [(3000, 20, u32::MAX), (40_000, 50, u32::MAX), (20_000, 40, 0)] {
        let mut spheres = cloud(9, n, extent);
        spheres.truncate(n);
        let settings = GpuConfig::default().algorithm(Algorithm::CellList).radix_sort_from(radix_from);
        let mut session = GpuSession::new(gpu.clone(), settings).expect("made");
        let mut reused = Vec::new();
        for call in 0..19 {
            let pairs = session_pairs(&mut session, &spheres);
            assert!(pairs == cpu_pairs(&spheres), "{n} spheres, call {call}: {} pairs", pairs.len());
            let counts = session.submissions();
            assert_eq!(counts.searches, 1, "{n} spheres, call {call}");
            reused.push(counts.reused_layouts == 1);
            let step = |k: usize| if k.is_multiple_of(2) { 0.015_625 } else { -0.015_625 };
            spheres.iter_mut().enumerate().for_each(|(k, sphere)| sphere.center[k % 3] += step(k));
        }
        let new_layouts: Vec<usize> = (0..19).filter(|&call| !reused[call]).collect();
        assert_eq!(new_layouts, [0, 17], "{n} spheres");
    }
}

#[test]
fn calls_in_flight_are_repeated_if_reused_cells_do_not_suit() {
    let Some(gpu) = device() else { return };
    let settings = GpuConfig::default().algorithm(Algorithm::CellList);
    let mut session = GpuSession::new(gpu, settings).expect("made");
    let small = cloud(3, 3000, 20);
    assert_eq!(session_count(&mut session, &small), cpu_pairs(&small).len() as u64);
    let mut large = small.clone();
    large.iter_mut().step_by(2).for_each(|sphere| sphere.radius *= 4.0);
    let crowd = vec![Sphere::new([3.0; 3], 0.25); 3000];
    let tickets = [&large, &crowd].map(|spheres| session.begin(Spheres::from(spheres)).expect("begun"));
    for (ticket, spheres) in tickets.into_iter().zip([&large, &crowd]) {
        let pairs = finished(&mut session, ticket);
        assert!(pairs == cpu_pairs(spheres), "{} pairs", pairs.len());
        let counts = session.submissions();
        assert!(counts.reused_layouts == 1 && counts.searches > 1, "{counts:?}");
    }
}
