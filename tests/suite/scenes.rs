use lazygrid::{Algorithm, Backend, Config, Detector, Order, Pair};
use lazygrid_io::scenes::Scene;
use lazygrid_tests::{DetectorVariant, SuiteVariant, TestInput, difference, variants};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

#[test]
fn every_scene_against_the_oracle() {
    for scene in Scene::ALL {
        for (n, seed) in [(0, 1), (1, 1), (2, 1), (3, 1), (50, 2), (191, 3), (192, 4), (193, 5), (1000, 6)] {
            let scenario = TestInput::from(scene.spheres(n, seed));
            let expected = scenario.oracle();
            for variant in variants::all() {
                let verdict = variant.verify(&scenario, &expected, &Config::default());
                verdict.unwrap_or_else(|text| panic!("{scene}, {n} spheres, seed {seed}: {text}"));
            }
        }
    }
}

#[test]
fn large_scenes_against_the_oracle_in_any_order_of_spheres() {
    for scene in [Scene::Equal, Scene::FiveSizes, Scene::Burst, Scene::BurstLinear] {
        let mut spheres = scene.spheres(5_000, 7);
        for arrangement in ["shuffled", "along x", "largest first", "smallest first"] {
            match arrangement {
                "along x" => spheres.sort_by(|a, b| a.center.x.total_cmp(&b.center.x)),
                "largest first" => spheres.sort_by(|a, b| b.radius.total_cmp(&a.radius)),
                "smallest first" => spheres.sort_by(|a, b| a.radius.total_cmp(&b.radius)),
                _ => {}
            }
            let scenario = TestInput::from(spheres.clone());
            let expected = scenario.oracle();
            for variant in variants::for_scenario(&scenario) {
                let verdict = variant.verify(&scenario, &expected, &Config::default());
                verdict.unwrap_or_else(|text| panic!("{scene}, {arrangement}: {text}"));
            }
        }
    }
}

fn quick_ones() -> impl Iterator<Item = DetectorVariant> {
    let is_slow = |s: &DetectorVariant| s.backend() == Backend::Gpu && s.algorithm == Algorithm::Naive;
    variants::all().into_iter().filter(move |variant| !is_slow(variant))
}

#[test]
fn pairs_are_identical_for_any_number_of_threads() {
    let mut lists: Vec<((String, Order), Vec<Pair>)> = Vec::new();
    for scene in [Scene::FiveSizes, Scene::Burst] {
        let [on_cpu, on_gpu] = [20_000, 6_000].map(|n| TestInput::from(scene.spheres(n, 8)));
        for order in [Order::Canonical, Order::Unordered] {
            for variant in quick_ones() {
                let is_on_gpu = variant.backend() == Backend::Gpu;
                if is_on_gpu && order == Order::Unordered {
                    continue;
                }
                let scenario = if is_on_gpu { &on_gpu } else { &on_cpu };
                let kind = (format!("{} on {} at {scene}", variant.algorithm, variant.backend()), order);
                for repeat in 0..2 {
                    let found = variant.find(scenario, Config::default().order(order)).expect("pairs");
                    match lists.iter().find(|(other, _)| *other == kind) {
                        Some((_, first)) => {
                            assert!(
                                found == *first,
                                "{variant}, {kind:?}, repeat {repeat}: not the same bytes"
                            );
                        }
                        None => lists.push((kind.clone(), found)),
                    }
                }
            }
        }
    }
    let canonical: Vec<_> = lists.iter().filter(|((_, order), _)| *order == Order::Canonical).collect();
    assert!(canonical.iter().all(|(_, list)| list.is_sorted()));
}

#[test]
fn pairs_are_identical_at_each_step_for_any_number_of_threads() {
    for order in [Order::Canonical, Order::Unordered] {
        let mut spheres = Scene::FiveSizes.spheres(20_000, 8);
        let mut detectors: Vec<(DetectorVariant, Detector)> = quick_ones()
            .map(|variant| (variant, Detector::new(variant.settings().order(order)).expect("a detector")))
            .collect();
        for step in 0..3 {
            let mut first: Option<(DetectorVariant, Vec<Pair>)> = None;
            for (variant, detector) in &mut detectors {
                let found = variant.run(|| detector.pairs(&spheres).expect("pairs").to_vec());
                match &first {
                    Some((other, pairs)) if other.algorithm == variant.algorithm => {
                        assert!(found == *pairs, "{variant} and {other} differ at step {step}, {order:?}");
                    }
                    _ => first = Some((*variant, found)),
                }
            }
            Scene::advance(&mut spheres, 8, step);
        }
    }
}

/// Devices may flush these radii to zero, but not the distances.
#[test]
fn cluster_near_the_smallest_normal_number() {
    let pair = [lazygrid::Sphere::new([0.0; 3], 1e-38), lazygrid::Sphere::new([1.5e-38, 0.0, 0.0], 1e-38)];
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut unit = || (rng.next_u32() >> 8) as f32 / (1 << 24) as f32;
    let mut point = || [unit(), unit(), unit(), unit()];
    let cluster = (0..1000)
        .map(|_| point())
        .map(|[x, y, z, r]| lazygrid::Sphere::new([x, y, z].map(|x| (2.0 * x - 1.0) * 2e-38), r * 1.2e-38));
    for spheres in [pair.to_vec(), cluster.collect()] {
        let scenario = TestInput::from(spheres);
        let expected = scenario.oracle();
        assert!(!expected.is_empty());
        for variant in variants::each_algorithm() {
            let verdict = variant.verify(&scenario, &expected, &Config::default());
            verdict.unwrap_or_else(|text| panic!("{text}"));
        }
    }
}

#[test]
fn full_lattice_has_one_pair_per_edge() {
    for (k, spacing) in [(2_usize, 1.0_f32), (9, 0.5), (21, 3.0)] {
        let point = |at: usize| [at % k, at / k % k, at / k / k].map(|c| c as f32 * spacing - 7.0 * spacing);
        let spheres: Vec<_> =
            (0..k * k * k).map(|at| lazygrid::Sphere::new(point(at), 0.5 * spacing)).collect();
        let scenario = TestInput::from(spheres);
        let edge = |i: usize, step: usize, along: usize| {
            (along + 1 < k).then(|| Pair { i: i as u32, j: (i + step) as u32 })
        };
        let edges = (0..k * k * k).flat_map(|i| {
            [edge(i, 1, i % k), edge(i, k, i / k % k), edge(i, k * k, i / k / k)].into_iter().flatten()
        });
        let expected: Vec<Pair> = edges.collect();
        assert_eq!(expected.len(), 3 * k * k * (k - 1));
        for variant in variants::all() {
            let found = variant.find(&scenario, Config::default()).expect("pairs");
            difference(&scenario, &found, &expected, variant.tolerance())
                .unwrap_or_else(|text| panic!("{variant}, {k}³: {text}"));
        }
    }
}
