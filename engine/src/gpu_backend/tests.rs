use std::ops::ControlFlow;

use lazygrid_host::{Order, PairFinder};
use lazygrid_kernels::{Algorithm, Interaction, Pair, Sphere, Spheres};

use super::*;
use crate::Detector;
use crate::gpu::device::device_or_skip;
use crate::gpu::test_support::{Random, with_binding_limit};

fn made(gpu: GpuDevice, config: Config) -> PairFinder<GpuBackend> {
    GpuBackend::new(gpu, config).map(PairFinder::on).expect("the settings are in range")
}

fn with_small_bindings(gpu: &GpuDevice) -> GpuDevice {
    with_binding_limit(gpu, 1 << 20)
}

/// A giant sphere extends through all slabs.
#[test]
fn inputs_beyond_the_largest_binding_are_searched_in_slabs() {
    let Some(gpu) = device_or_skip() else { return };
    let gpu = with_small_bindings(&gpu);
    let mut random = Random(7);
    let mut coordinate = || (random.unit() * 16384.0).floor() / 128.0;
    let mut spheres: Vec<_> =
        (0..75_000).map(|_| Sphere::new([coordinate(), coordinate(), coordinate()], 0.5)).collect();
    spheres[99] = Sphere::new([64.0; 3], 8.0);
    let config = Config::default().algorithm(Algorithm::CellList);
    let mut host = Detector::new(config.clone().backend(Backend::Cpu)).expect("made");
    let expected = host.pairs(&spheres).expect("valid").to_vec();
    let mut detector = made(gpu.clone(), config.clone());
    let all = Spheres::from(&spheres);
    assert_eq!(detector.count(all), Ok(expected.len() as u64));
    let reason = detector.backend().report().reason;
    assert!(reason.contains("in 2 slabs"), "{reason}");
    assert!(detector.pairs(all).expect("found") == expected);
    let (first, second) = spheres.split_at(1000);
    let across = |pair: &&Pair| pair.i < 1000 && pair.j >= 1000;
    let across: Vec<_> = expected.iter().filter(across).map(|p| Pair { i: p.i, j: p.j - 1000 }).collect();
    assert!(detector.pairs(Query::new((first, second))).expect("found") == across);
    let twice = (&spheres[..40_000], &spheres[..40_000]);
    let expected_twice = host.count(Query::new(twice)).expect("valid");
    assert_eq!(detector.count(Query::new(twice)), Ok(expected_twice));
    let mut exact = made(gpu.clone(), config.clone().max_pairs(expected_twice));
    assert_eq!(exact.pairs(Query::new(twice)).map(<[Pair]>::len), Ok(expected_twice as usize));
    let (found, limit) = (expected_twice, expected_twice - 1);
    let mut short = made(gpu.clone(), config.clone().max_pairs(limit));
    assert_eq!(short.pairs(Query::new(twice)), Err(Error::TooManyPairs { found, limit }));
    let all_pairs = expected.len() as u64;
    for limit in [all_pairs, all_pairs - 1, all_pairs / 7] {
        let mut detector = made(gpu.clone(), config.clone().max_pairs(limit));
        let (mut streamed, mut largest) = (Vec::new(), 0);
        let mut keep = |pairs: &[Pair]| {
            largest = largest.max(pairs.len() as u64);
            streamed.extend_from_slice(pairs);
            ControlFlow::Continue(())
        };
        let delivered = detector.stream(all, usize::MAX, &mut keep).expect("in order");
        assert!(streamed == expected && delivered == all_pairs, "up to {limit}");
        assert!(largest <= limit, "{largest} pairs at once, not {limit}");
        let mut taken = 0;
        let stop = |pairs: &[Pair]| {
            taken += pairs.len();
            ControlFlow::Break(())
        };
        assert_eq!(detector.stream(all, 5, stop), Ok(5), "up to {limit}");
        assert_eq!(taken, 5);
    }
    for limit in [all_pairs / 7, all_pairs - 1] {
        let mut detector = made(gpu.clone(), config.clone().max_pairs(limit));
        let found = all_pairs;
        assert_eq!(detector.pairs(all), Err(Error::TooManyPairs { found, limit }));
    }
    let groups: Vec<u32> = (0..75_000).map(|k| k % 7).collect();
    let grouped = all.with_groups(&groups).expect("one of each");
    let mut filtered = expected.clone();
    filtered.retain(|pair| pair.i % 7 != pair.j % 7);
    let mut detector = made(gpu.clone(), config.clone());
    assert_eq!(detector.count(grouped), Ok(filtered.len() as u64));
    assert!(detector.pairs(grouped).expect("found") == filtered);
    let limited = config.max_pairs(all_pairs - 1);
    let mut detector = made(gpu, limited.order(Order::Unordered));
    let mut streamed = Vec::new();
    let mut keep = |pairs: &[Pair]| {
        streamed.extend_from_slice(pairs);
        ControlFlow::Continue(())
    };
    detector.stream(all, 1 << 16, &mut keep).expect("streamed");
    streamed.sort_unstable();
    assert!(streamed == expected);
    // Coincident spheres cannot be cut.
    let coincident = vec![Sphere::new([0.0; 3], 1.0); 600_000];
    let refused = detector.count(&coincident).expect_err("too many");
    assert!(refused.to_string().contains("overlaps too much"), "{refused}");
}

#[test]
fn report_has_the_reason_for_a_single_level() {
    let Some(gpu) = device_or_skip() else { return };
    let spheres: Vec<_> = (0..3300).map(|k| Sphere::new([0.0; 3], 0.5_f32.powi(k % 20))).collect();
    let config = Config::default().backend(Backend::Gpu).algorithm(Algorithm::LazyGrid);
    let mut detector = made(with_small_bindings(&gpu), config);
    assert_eq!(detector.count(&spheres), Ok(3300 * 3299 / 2));
    let report = detector.backend().report();
    assert_eq!(report.algorithm, Algorithm::ArrayGrid);
    assert!(report.reason.contains("array-grid instead of lazy-grid: the entries"), "{}", report.reason);
}

#[test]
fn report_with_an_empty_set_describes_its_own_call() {
    let Some(gpu) = device_or_skip() else { return };
    let spheres: Vec<_> = (0..75_000).map(|k| Sphere::new([k as f32, 0.0, 0.0], 0.5)).collect();
    let mut detector = made(with_small_bindings(&gpu), Config::default());
    for is_first in [true, false] {
        for (first, second) in [(&spheres[..], &[][..]), (&[], &spheres)] {
            assert_eq!(detector.count(Query::new((first, second))), Ok(0));
            let report = detector.backend().report();
            assert_ne!(report.algorithm, Algorithm::Auto, "{is_first}");
            assert!(!report.reason.contains("slabs"), "{}", report.reason);
            assert!(report.phases.iter().all(|phase| phase.name != "upload"), "{:?}", report.phases);
            assert_eq!((report.pairs, report.cost, report.candidates), (0, None, None), "{is_first}");
        }
        assert_eq!(detector.count(&spheres), Ok(74_999));
        assert!(detector.backend().report().reason.contains("slabs"));
    }
}

#[test]
fn report_without_a_search_describes_its_own_call() {
    let Some(gpu) = device_or_skip() else { return };
    let mut table = Interactions::new(2, Interaction::Never).expect("few species");
    table.set(0, 0, Interaction::Touch).expect("a known species");
    let mut detector = made(with_small_bindings(&gpu), Config::default().interactions(Some(table)));
    let spheres: Vec<_> = (0..75_000).map(|k| Sphere::new([k as f32, 0.0, 0.0], 0.5)).collect();
    // Spheres of species 1 are in no slab, because they never pair.
    for (count, species, pairs) in [(3, 0, 2), (75_000, 1, 0)] {
        let ids = vec![species; count];
        let spheres = Spheres::from(&spheres[..count]).with_species(&ids).expect("an id for each");
        assert_eq!(detector.count(spheres), Ok(pairs), "species {species}");
        let report = detector.backend().report();
        assert!(!report.reason.contains("instead"), "{}", report.reason);
        assert_eq!(report.cost.is_some(), species == 0, "{report:?}");
    }
}

#[test]
fn report_of_too_many_pairs_has_the_times() {
    let Some(gpu) = device_or_skip() else { return };
    let spheres = [Sphere::new([0.0; 3], 1.0); 3];
    let mut detector = made(gpu, Config::default().max_pairs(2));
    assert_eq!(detector.pairs(&spheres), Err(Error::TooManyPairs { found: 3, limit: 2 }));
    let phases = detector.backend().report().phases;
    assert!(phases.iter().any(|phase| phase.name == "wait"), "{phases:?}");
}

#[test]
fn call_in_slabs_leaves_the_candidate_list() {
    let Some(gpu) = device_or_skip() else { return };
    let grid = |k: u32| [k % 40, k / 40 % 40, k / 1600].map(|at| at as f32);
    let spheres: Vec<_> = (0..75_000).map(|k| Sphere::new(grid(k), 0.25)).collect();
    let mut detector = made(with_small_bindings(&gpu), Config::default().algorithm(Algorithm::CellList));
    let mut is_served = |count: usize| {
        assert_eq!(detector.count(&spheres[..count]), Ok(0));
        detector.backend().report().candidates.is_some_and(|stats| stats.rebuilt.is_none())
    };
    assert!((0..20).any(|_| is_served(10_000)), "no list");
    assert!(!is_served(75_000));
    assert!(is_served(10_000));
}

#[test]
fn automatic_skin_never_changes_a_result() {
    let Some(gpu) = device_or_skip() else { return };
    let mut random = Random(11);
    let mut coordinate = |scale: f32| (random.unit() * scale * 4096.0).floor() / 4096.0;
    let mut spheres: Vec<_> = (0..10_000)
        .map(|_| Sphere::new([coordinate(32.0), coordinate(32.0), coordinate(32.0)], 0.5))
        .collect();
    let mut host = Detector::new(Config::default().backend(Backend::Cpu).skin(Skin::Off)).expect("made");
    let config = Config::default().algorithm(Algorithm::CellList);
    let mut detector = made(gpu, config);
    let mut served = 0;
    for step in 0..24 {
        let all = Spheres::from(&spheres);
        assert!(detector.pairs(all).expect("found") == host.pairs(&spheres).expect("valid"), "step {step}");
        served +=
            u32::from(detector.backend().report().candidates.is_some_and(|stats| stats.rebuilt.is_none()));
        let scale = [0.004, 0.5, 0.0][step / 12 + step / 20];
        for sphere in &mut spheres {
            sphere.center += glam::Vec3::from([coordinate(scale), coordinate(scale), coordinate(scale)]);
        }
    }
    assert!(served > 5, "{served} of 24 calls were served from candidates");
}

#[test]
fn absent_species_enlarge_no_radius_and_lose_no_pair_when_they_return() {
    let Some(gpu) = device_or_skip() else { return };
    let mut table = Interactions::new(3, Interaction::Never).expect("few species");
    for (a, b, distance) in [(0, 0, 0.5), (0, 1, 6.0), (1, 2, 1.0), (2, 2, 0.25)] {
        table.set(a, b, Interaction::Within(distance)).expect("known species");
    }
    let position = |k: u32| [7, 11, 13].map(|step| (k * step % 1009) as f32 / 60.0);
    let spheres: Vec<_> = (0..2000).map(|k| Sphere::new(position(k), 0.1)).collect();
    // The species of the last ten spheres and of the others, and half the distance of species 0.
    let calls = [(0, 0, 0.25), (1, 0, 3.0), (1, 0, 3.0), (0, 0, 3.0), (0, 0, 0.25), (1, 0, 3.0), (2, 2, 0.0)];
    for skin in [Skin::Auto, Skin::Off, Skin::Fixed(0.5)] {
        let config = Config::default().algorithm(Algorithm::CellList).skin(skin);
        let config = config.interactions(Some(table.clone()));
        let mut host = Detector::new(config.clone().backend(Backend::Cpu)).expect("made");
        let mut detector = made(gpu.clone(), config);
        for (call, (last, others, half)) in calls.into_iter().enumerate() {
            let ids: Vec<u32> = (0..2000).map(|k| if k < 1990 { others } else { last }).collect();
            let spheres_with_ids = Spheres::from(&spheres).with_species(&ids).expect("an id for each");
            let expected = host.pairs(spheres_with_ids).expect("valid").to_vec();
            assert!(detector.pairs(spheres_with_ids).expect("found") == expected, "{skin:?}, call {call}");
            let searched = detector.backend().device.interactions.as_ref().expect("a table");
            assert_eq!(searched.species_radius(0).largest_half, half, "{skin:?}, call {call}");
        }
    }
}

#[test]
fn narrow_side_follows_the_crowd_and_loses_no_pair() {
    let Some(gpu) = device_or_skip() else { return };
    let mut table = Interactions::new(2, Interaction::Within(2.0)).expect("few species");
    table.set(0, 0, Interaction::Within(0.25)).expect("a known species");
    table.set(1, 1, Interaction::Within(0.0625)).expect("a known species");
    let position = |k: u32| [7, 11, 13].map(|step| (k * step % 1009) as f32 / 128.0);
    let spheres: Vec<_> = (0..3000).map(|k| Sphere::new(position(k), 0.01)).collect();
    // The species of all but the last ten spheres, and that of the device's sides.
    let calls = [(0, 0), (1, 0), (1, 1), (0, 1), (0, 1), (0, 1), (0, 0)];
    for skin in [Skin::Auto, Skin::Off, Skin::Fixed(0.125)] {
        let config = Config::default().algorithm(Algorithm::CellList).skin(skin);
        let config = config.interactions(Some(table.clone()));
        let mut host = Detector::new(config.clone().backend(Backend::Cpu)).expect("made");
        let mut detector = made(gpu.clone(), config);
        for (call, (most, frequent)) in calls.into_iter().enumerate() {
            let ids: Vec<u32> = (0..3000).map(|k| if k < 2990 { most } else { 1 - most }).collect();
            let spheres_with_ids = Spheres::from(&spheres).with_species(&ids).expect("an id for each");
            let expected = host.pairs(spheres_with_ids).expect("valid").to_vec();
            assert!(detector.pairs(spheres_with_ids).expect("found") == expected, "{skin:?}, call {call}");
            assert_eq!(
                detector.backend().species.frequent_species.searched(),
                Some(frequent),
                "{skin:?}, call {call}"
            );
        }
    }
}

#[test]
fn memory_for_counts_the_copy_of_spheres_in_a_frame() {
    let Some(gpu) = device_or_skip() else { return };
    let memory = |length: f64, is_f64| {
        let space = Space::periodic([Some(length), None, None]).expect("a length");
        let detector = made(gpu.clone(), Config::default().space(space));
        detector.backend().memory_for(1000, is_f64)
    };
    let (without, copy) = (memory(10.0, false), 18 * 1000);
    assert_eq!(memory(10.1, false), without + copy);
    assert_eq!([10.0, 10.1].map(|length| memory(length, true)), [without + copy; 2]);
}
