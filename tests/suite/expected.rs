//! Mean pair counts of scenes against closed forms, within four standard errors.

use lazygrid::{Backend, Config, Detector, Sphere};
use lazygrid_io::scenes::{Scene, periodic_box_pairs};
use lazygrid_tests::{SuiteVariant, variants};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

const SEEDS: u64 = 5;

#[test]
fn scenes_have_their_expected_pairs() {
    let variants = variants::each_algorithm();
    for scene in Scene::ALL {
        for variant in &variants {
            let n = match (scene, variant.backend()) {
                (_, Backend::Gpu) => 2000,
                (Scene::Point, _) => 3000,
                _ => 10_000,
            };
            // With all spheres at one point, each seed gives all pairs.
            let seeds = if scene == Scene::Point { 1 } else { SEEDS };
            let expected = scene.expected_pairs(n);
            let mut detector = Detector::new(variant.settings()).expect("a detector");
            let total: u64 =
                (0..seeds).map(|seed| detector.count(&scene.spheres(n, 100 + seed)).expect("a count")).sum();
            let (mean, error) = (total as f64 / seeds as f64, (expected.variance / seeds as f64).sqrt());
            let off = (mean - expected.mean).abs();
            assert!(
                off <= 4.0 * error,
                "{variant}, {scene}: mean {mean}, {expected:?}, standard error {error}"
            );
        }
    }
}

/// P(pair) = u³ − (9⁄16)u⁴ + u⁶⁄32 with u = 2r/R, for two uniform points in a ball of radius R.
#[test]
fn equal_spheres_in_a_ball_by_the_formula() {
    let (n, filled) = (20_000_usize, 0.05_f64);
    let u = 2.0 * (filled / n as f64).cbrt();
    let p = u.powi(3) - 9.0 / 16.0 * u.powi(4) + u.powi(6) / 32.0;
    let pairs = n as f64 * (n as f64 - 1.0) / 2.0;
    let mut detector = Detector::new(Config::default()).expect("a detector");
    let total: u64 =
        (0..SEEDS).map(|seed| detector.count(&Scene::Equal.spheres(n, 200 + seed)).expect("a count")).sum();
    // Pairs that share a sphere are correlated only through the rim, which adds a few percent here.
    let error = (pairs * p * (1.0 - p) / SEEDS as f64).sqrt() * 1.1;
    let off = total as f64 / SEEDS as f64 - pairs * p;
    assert!(off.abs() <= 4.0 * error, "{off} from {}, standard error {error}", pairs * p);
}

/// Spheres near a face are repeated at the opposite face. A pair counts once, by its original spheres.
#[test]
fn a_periodic_box_by_the_formula() {
    const SIDE: f32 = 40.0;
    let sizes = [(1500_u64, 1.0_f64), (3000, 0.5), (6000, 0.25)];
    let expected = periodic_box_pairs(&sizes, f64::from(SIDE).powi(3));
    let mut detector = Detector::new(Config::default()).expect("a detector");
    let mut total = 0;
    for seed in 0..SEEDS {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // Shifting a coordinate by `SIDE` rounds by at most 2⁻¹⁹, far below the statistical error.
        let mut coordinate = || (rng.next_u32() >> 8) as f32 * (SIDE / (1 << 24) as f32);
        let mut spheres = Vec::new();
        for &(count, radius) in &sizes {
            for _ in 0..count {
                spheres.push(Sphere::new([coordinate(), coordinate(), coordinate()], radius as f32));
            }
        }
        let originals = spheres.len();
        let mut original: Vec<usize> = (0..originals).collect();
        for k in 0..originals {
            for shift in 1..27 {
                let step = [shift % 3, shift / 3 % 3, shift / 9].map(|s| [0.0, SIDE, -SIDE][s as usize]);
                let center = spheres[k].center + glam::Vec3::from(step);
                if center.min_element() > -2.0 && center.max_element() < SIDE + 2.0 {
                    spheres.push(Sphere::new(center, spheres[k].radius));
                    original.push(k);
                }
            }
        }
        let mut met = std::collections::HashSet::new();
        for pair in detector.pairs(&spheres).expect("pairs") {
            let (a, b) = (original[pair.i as usize], original[pair.j as usize]);
            if (pair.i as usize) < originals {
                met.insert((a.min(b), a.max(b)));
            }
        }
        total += met.len();
    }
    let (mean, error) = (total as f64 / SEEDS as f64, (expected.variance / SEEDS as f64).sqrt());
    assert!((mean - expected.mean).abs() <= 4.0 * error, "mean {mean}, {expected:?}, standard error {error}");
}
