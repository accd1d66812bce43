//! `GpuSession` and `Detector` on the GPU: what is uploaded, found and read back, against the CPU path.

mod common;

use std::ops::ControlFlow;

use common::{Random, device};
use lazygrid::gpu::{GpuError, GpuSession, GpuSettings};
use lazygrid::{Algorithm, Backend, Config, Detector, Error, Order, Pair, Sphere, Spheres};

/// Radii and places are multiples of a power of two, so that no rounding happens and results agree exactly.
fn cloud(seed: u64, n: usize, extent: u32) -> Vec<Sphere> {
    let mut random = Random(seed);
    (0..n)
        .map(|_| {
            let center = [0; 3].map(|_| (random.word() % (extent * 64)) as f32 / 64.0);
            Sphere::new(center, (random.word() % 32) as f32 / 64.0)
        })
        .collect()
}

fn expected(spheres: &[Sphere]) -> Vec<Pair> {
    let mut detector = Detector::new(Config::default().backend(Backend::Cpu)).expect("the CPU");
    detector.pairs(spheres).expect("valid").to_vec()
}

fn gpu(config: Config) -> Detector {
    Detector::new(config.backend(Backend::Gpu)).expect("an adapter")
}

#[test]
fn lists_counts_neighbours_and_streams_agree_with_the_cpu() {
    let Some(_) = device() else { return };
    for algorithm in [Algorithm::Auto, Algorithm::Naive, Algorithm::ArrayGrid] {
        let mut detector = gpu(Config::default().algorithm(algorithm));
        for (n, extent) in [(0, 1), (1, 1), (2, 1), (3000, 10), (300, 2), (20_000, 30), (9000, 5)] {
            let spheres = cloud(n as u64, n, extent);
            let wanted = expected(&spheres);
            assert_eq!(detector.pairs(&spheres).expect("found"), wanted, "{n} {algorithm}");
            assert_eq!(detector.count(&spheres).expect("counted"), wanted.len() as u64);
            let lists = detector.neighbors(&spheres).expect("found");
            let of_each: Vec<Pair> = (0..n)
                .flat_map(|k| {
                    lists
                        .of(k)
                        .iter()
                        .filter(move |&&j| j as usize > k)
                        .map(move |&j| Pair { i: k as u32, j })
                })
                .collect();
            assert!(of_each == wanted && lists.indices.len() == 2 * wanted.len());
            let mut streamed = Vec::new();
            let handed = detector.stream(&spheres, 1000, |pairs| {
                assert!(pairs.len() <= 1000);
                streamed.extend_from_slice(pairs);
                ControlFlow::Continue(())
            });
            assert_eq!(handed.expect("streamed"), wanted.len() as u64);
            assert!(streamed == wanted, "the stream is canonical as a whole");
            let report = detector.report();
            assert_eq!((report.backend, report.pairs), (Backend::Gpu, wanted.len() as u64));
            assert!(report.adapter.is_some() && report.phases.iter().any(|phase| phase.name == "search"));
        }
    }
}

#[test]
fn columns_are_taken_as_well_as_rows() {
    let Some(_) = device() else { return };
    let spheres = cloud(1, 5000, 10);
    let column = |k: usize| -> Vec<f32> {
        spheres.iter().map(|s| s.center.to_array().get(k).copied().unwrap_or(s.radius)).collect()
    };
    let [x, y, z, r] = [0, 1, 2, 3].map(column);
    let columns = Spheres::columns(&x, &y, &z, &r).expect("one length");
    assert_eq!(gpu(Config::default()).pairs(columns).expect("found"), expected(&spheres));
}

#[test]
fn too_many_pairs_are_refused_with_their_number() {
    let Some(_) = device() else { return };
    let spheres = vec![Sphere::new([0.5; 3], 1.0); 3000];
    let all = 3000 * 2999 / 2;
    let mut detector = gpu(Config::default().max_pairs(all - 1));
    let error = detector.pairs(&spheres).expect_err("one too many");
    assert!(matches!(error, Error::Host(lazygrid_host::Error::TooManyPairs { found, .. }) if found == all));
    assert_eq!(detector.count(&spheres).expect("counted"), all);
}

#[test]
fn a_result_beyond_the_output_comes_in_windows() {
    let Some(own) = device() else { return };
    let mut spheres = cloud(2, 3000, 10);
    spheres.extend(vec![Sphere::new([1.5; 3], 0.25); 500]);
    let wanted = expected(&spheres);
    let settings = GpuSettings { pair_capacity: 5000, ..GpuSettings::default() };
    assert!(wanted.len() > 100_000);
    let mut session = GpuSession::new(own, settings).expect("made");
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
fn two_calls_overlap_and_a_third_waits_its_turn() {
    let Some(own) = device() else { return };
    let scenes: Vec<_> = (0..6).map(|k| cloud(k, 1000 + 700 * k as usize, 8)).collect();
    let mut session = GpuSession::new(own, GpuSettings::default()).expect("made");
    let mut before = session.begin(Spheres::from(&scenes[0])).expect("begun");
    for k in 1..scenes.len() {
        let next = session.begin(Spheres::from(&scenes[k])).expect("begun");
        let third = session.begin(Spheres::from(&scenes[k])).expect_err("two are in flight");
        assert_eq!(third, GpuError::Busy { calls: 2 });
        let mut pairs = session.finish(before, u64::MAX).expect("found").to_vec();
        pairs.sort_unstable();
        assert_eq!(pairs, expected(&scenes[k - 1]));
        before = next;
    }
    let mut pairs = pollster::block_on(session.finish_async(before, u64::MAX)).expect("found").to_vec();
    pairs.sort_unstable();
    assert_eq!(pairs, expected(&scenes[5]));
}

/// Crowds of a thousand, a block of entries at a time, with another call in flight that uses the same buffers.
#[test]
fn crowded_searches_go_on_over_several_submissions() {
    let Some(own) = device() else { return };
    let scenes: Vec<_> = (0..3)
        .map(|k| {
            let mut spheres = cloud(k, 2000, 20);
            spheres.extend(vec![Sphere::new([k as f32 + 0.5; 3], 0.125); 1000 + 300 * k as usize]);
            spheres.extend(vec![Sphere::new([9.25, 3.5, 0.25], 0.5); 700]);
            spheres
        })
        .collect();
    for algorithm in [Algorithm::ArrayGrid, Algorithm::EagerGrid, Algorithm::LazyGrid] {
        let settings =
            GpuSettings { algorithm, timed: true, pair_capacity: 500_000, ..GpuSettings::default() };
        let mut session = GpuSession::new(own.clone(), settings).expect("made");
        session.set_part_tests(1);
        let mut before = session.begin(Spheres::from(&scenes[0])).expect("begun");
        for k in [1, 2, 0] {
            let next = session.begin(Spheres::from(&scenes[k])).expect("begun");
            let scene = &scenes[(k + 2) % 3];
            let mut pairs = session.finish(before, u64::MAX).expect("found").to_vec();
            pairs.sort_unstable();
            assert!(pairs == expected(scene), "{algorithm}, {k}: {}", pairs.len());
            assert!(session.outcome().crowded > 4 && !session.outcome().is_partial(), "{algorithm}");
            before = next;
        }
        let found = session.finish_count(before).expect("counted");
        assert_eq!(found, expected(&scenes[0]).len() as u64, "{algorithm}");
    }
}

#[test]
fn a_dropped_ticket_frees_its_place() {
    let Some(own) = device() else { return };
    let scenes: Vec<_> = (0..4).map(|k| cloud(k, 2000 + 500 * k as usize, 8)).collect();
    let mut session = GpuSession::new(own, GpuSettings::default()).expect("made");
    for dropped in [0, 1] {
        let mut tickets: Vec<_> =
            (0..2).map(|k| session.begin(Spheres::from(&scenes[k])).expect("begun")).collect();
        assert!(session.begin(Spheres::from(&scenes[2])).is_err(), "two are in flight");
        drop(tickets.remove(dropped));
        let third = session.begin(Spheres::from(&scenes[3])).expect("there is room again");
        for (ticket, scene) in [(third, 3), (tickets.remove(0), 1 - dropped)] {
            let mut pairs = session.finish(ticket, u64::MAX).expect("found").to_vec();
            pairs.sort_unstable();
            assert_eq!(pairs, expected(&scenes[scene]));
        }
    }
}

#[test]
fn unordered_lists_have_the_same_pairs() {
    let Some(_) = device() else { return };
    let spheres = cloud(4, 10_000, 20);
    let mut pairs = gpu(Config::default().order(Order::Unordered)).pairs(&spheres).expect("found").to_vec();
    pairs.sort_unstable();
    assert_eq!(pairs, expected(&spheres));
}
