use super::*;

fn brute_force(spheres: &[Sphere]) -> u64 {
    let hit = |a: &Sphere, b: &Sphere| {
        let cutoff = f64::from(a.radius) + f64::from(b.radius);
        a.center.as_dvec3().distance_squared(b.center.as_dvec3()) <= cutoff * cutoff
    };
    (0..spheres.len()).map(|i| spheres[i + 1..].iter().filter(|b| hit(&spheres[i], b)).count() as u64).sum()
}

fn volume(radius: f32) -> f64 {
    f64::from(radius).powi(3)
}

#[test]
fn names_are_read_back() {
    for scene in Scene::ALL {
        assert_eq!(scene.to_string().parse(), Ok(scene));
    }
    assert!("equals".parse::<Scene>().is_err_and(|e| e.to_string().contains("equal, five-sizes")));
}

#[test]
fn uniform_scenes_fill_five_percent() {
    let few_giants = Scene::Transceivers(Transceivers { count: 1, ratio: 10 });
    let many_giants = Scene::Transceivers(Transceivers { count: 2000, ratio: 1000 });
    for scene in [Scene::Equal, Scene::FiveSizes, few_giants, Scene::ALL[5], many_giants] {
        let spheres = scene.spheres(20_000, 1);
        let outermost = spheres.iter().map(|s| s.center.length()).fold(0.0, f32::max);
        let density = spheres.iter().map(|s| volume(s.radius)).sum::<f64>() / volume(outermost);
        assert!((density / 0.05 - 1.0).abs() < 2e-3, "{scene}: {density}");
        let inner = spheres.iter().filter(|s| s.center.length() < 0.5 * outermost).count();
        assert!((2300..2700).contains(&inner), "{scene}: {inner}");
    }
}

#[test]
fn sizes_are_as_frequent_as_they_should_be_and_shuffled() {
    for scene in Scene::ALL {
        let n = 1003;
        let spheres = scene.spheres(n, 5);
        assert_eq!(spheres.len(), n);
        let classes = scene.sizes().classes(n);
        for class in &classes {
            let count = spheres.iter().filter(|s| f64::from(s.radius) == class.radius).count();
            assert_eq!(count as f64, class.count, "{scene}: {class:?}");
            let expected = n / classes.len();
            let equally_often = matches!(scene.sizes(), RadiusMix::EquallyOften(_));
            assert!(!equally_often || count == expected || count == expected + 1, "{scene}: {class:?}");
        }
        let in_order = scene.sizes().radii(n);
        let moved = spheres.iter().zip(&in_order).filter(|(s, radius)| s.radius != **radius).count();
        let enough = match scene.sizes() {
            RadiusMix::EquallyOften([_]) => 0,
            RadiusMix::EquallyOften(_) => n / 2,
            RadiusMix::Two(_) => 50,
        };
        assert!(moved >= enough, "{scene}: {moved} not in order");
    }
}

#[test]
fn transceivers_are_as_many_and_as_large_as_asked_for() {
    let large_and_small = |count, ratio, n| {
        let spheres = Scene::Transceivers(Transceivers { count, ratio }).spheres(n, 4);
        let large = spheres.iter().filter(|s| s.radius == 1.0).count();
        let small = spheres.iter().filter(|s| s.radius == 1.0 / ratio.max(1) as f32).count();
        assert!(spheres.iter().all(Sphere::is_valid));
        (large, small)
    };
    assert_eq!(large_and_small(7, 20, 1000), (7, 993));
    assert_eq!(large_and_small(1, 1000, 1000), (1, 999));
    assert_eq!(large_and_small(0, 10, 1000), (0, 1000));
    assert_eq!(large_and_small(5000, 10, 1000), (1000, 0));
    assert_eq!(large_and_small(7, 1, 1000), (1000, 1000));
    assert_eq!(large_and_small(7, 0, 1000), (1000, 1000));
    assert_eq!(Scene::ALL[5], Scene::Transceivers(Transceivers::default()));
}

#[test]
fn pairs_of_transceivers_are_bounded_however_large_they_are() {
    for count in [1, 100, 10_000] {
        for ratio in [100, 1000] {
            let mixture = Transceivers { count, ratio };
            let per_sphere = Scene::Transceivers(mixture).expected_pairs(100_000).mean / 1e5;
            assert!((0.02..0.1).contains(&per_sphere), "{mixture:?}: {per_sphere}");
        }
    }
    let equal = Scene::Equal.expected_pairs(5000);
    let one_size = Scene::Transceivers(Transceivers { count: 40, ratio: 1 }).expected_pairs(5000);
    assert!((one_size.mean / equal.mean - 1.0).abs() < 1e-12);
    assert!((one_size.variance / equal.variance - 1.0).abs() < 1e-9);
}

#[test]
fn small_inputs_work() {
    for scene in Scene::ALL {
        for n in [0, 1, 2, 41, 42] {
            let spheres = scene.spheres(n, 3);
            assert_eq!(spheres.len(), n);
            assert!(spheres.iter().all(Sphere::is_valid), "{scene}, n = {n}");
        }
        assert_eq!(scene.expected_pairs(0).mean, 0.0);
    }
    assert_eq!(brute_force(&Scene::Burst.spheres(41, 3)), 41 * 20);
}

#[test]
fn a_seed_gives_the_same_spheres_everywhere() {
    let digest = |scene: Scene, seed| {
        let mut spheres = scene.spheres(10_000, seed);
        Scene::advance(&mut spheres, seed, 0);
        Scene::advance(&mut spheres, seed, 1);
        spheres
            .iter()
            .flat_map(|s| [s.center.x, s.center.y, s.center.z, s.radius])
            .fold(0xcbf2_9ce4_8422_2325_u64, |hash, value| {
                (hash ^ u64::from(value.to_bits())).wrapping_mul(0x0100_0000_01b3)
            })
    };
    let digests = Scene::ALL.map(|scene| digest(scene, 1));
    assert_eq!(digests, DIGESTS, "{digests:#x?}");
    assert_ne!(digest(Scene::Equal, 2), DIGESTS[0]);
}

const DIGESTS: [u64; 6] = [
    0xa3d2_3934_7c7b_27d0,
    0xbbb2_8f31_086a_0b54,
    0x0d0d_bdba_7f14_f638,
    0x864f_03a7_423b_71b9,
    0x6bd1_3e15_c5b4_ad7b,
    0x85b9_00a8_a465_04ff,
];

#[test]
fn a_step_is_a_tenth_of_the_radius() {
    for scene in Scene::ALL {
        let before = scene.spheres(500, 9);
        let mut after = before.clone();
        Scene::advance(&mut after, 9, 4);
        let mut mean = glam::Vec3::ZERO;
        for (a, b) in before.iter().zip(&after) {
            let moved = (b.center - a.center) / a.radius;
            assert_eq!(a.radius, b.radius);
            // Coordinates near 30 round the step of the smallest spheres.
            assert!((moved.length() - 0.1).abs() < 1e-2, "{scene}: {moved}");
            mean += moved / before.len() as f32;
        }
        assert!(mean.length() < 0.02, "{scene}: mean step {mean}");
    }
}

#[test]
fn closed_forms_agree_with_brute_force() {
    let mixture = |count, ratio| Scene::Transceivers(Transceivers { count, ratio });
    let mixtures = [mixture(1, 5), mixture(3, 1000), mixture(200, 3)];
    for scene in Scene::ALL.into_iter().chain(mixtures) {
        let n = 600;
        let expected = scene.expected_pairs(n);
        let seeds = 40;
        let counts: Vec<u64> = (0..seeds).map(|seed| brute_force(&scene.spheres(n, seed))).collect();
        let mean = counts.iter().sum::<u64>() as f64 / seeds as f64;
        let error = (expected.variance / seeds as f64).sqrt();
        assert!((mean - expected.mean).abs() <= 4.0 * error, "{scene}: {mean}, {expected:?} ± {error}");
        let variance = counts.iter().map(|&c| (c as f64 - expected.mean).powi(2)).sum::<f64>() / seeds as f64;
        // The variance of 40 values has a relative deviation of √(2/40) = 0.22.
        let ratio = if expected.variance == 0.0 { 1.0 + variance } else { variance / expected.variance };
        assert!((0.4..1.9).contains(&ratio), "{scene}: variance {variance}, {expected:?}");
    }
}

#[test]
fn bursts_have_twenty_pairs_per_sphere() {
    for scene in [Scene::Burst, Scene::BurstLinear] {
        for n in [1000, 100_000] {
            let per_sphere = scene.expected_pairs(n).mean / n as f64;
            assert!((per_sphere - 20.0).abs() < 1e-9, "{scene}: {per_sphere}");
        }
    }
}

#[test]
fn all_pairs_overlap_at_a_point() {
    let expected = Scene::Point.expected_pairs(1000);
    assert_eq!(expected, PairCount { mean: 499_500.0, variance: 0.0 });
    assert_eq!(expected.deviations(499_500), 0.0);
    assert_eq!(expected.deviations(499_499), f64::NEG_INFINITY);
}

#[test]
fn periodic_box_by_hand() {
    // Three pairs with cutoff 2, three with cutoff 3: (3·8 + 3·27)·(4π/3)/V.
    let pairs = periodic_box_pairs(&[(3, 1.0), (1, 2.0)], 1000.0);
    let p = |cutoff: f64| 4.0 / 3.0 * std::f64::consts::PI * cutoff.powi(3) / 1000.0;
    assert!((pairs.mean - 3.0 * (p(2.0) + p(3.0))).abs() < 1e-12);
    let variance = 3.0 * (p(2.0) * (1.0 - p(2.0)) + p(3.0) * (1.0 - p(3.0)));
    assert!((pairs.variance - variance).abs() < 1e-12);
}
