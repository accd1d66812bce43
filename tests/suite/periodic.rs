use lazygrid::{
    Algorithm, Backend, Config, Detector, Error, InputError, Order, Pair, Space, Sphere, Spheres,
};
use lazygrid_io::scenes::periodic_box_pairs;
use lazygrid_tests::periodic::{self, oracle_of_images, oracle_of_integers, verify_all};
use lazygrid_tests::results::{listed, match_the_list, streamed};
use lazygrid_tests::{DetectorVariant, SuiteVariant, TestInput, Tolerance, difference, variants};
use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::properties::{check, settings};

fn on_cpu() -> impl Iterator<Item = DetectorVariant> {
    variants::all().into_iter().filter(|variant| variant.backend() == Backend::Cpu)
}

fn uniform(n: usize, radii: &[f32], side: f32, seed: u64) -> Vec<Sphere> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut coordinate = || (rng.next_u32() >> 8) as f32 * (side / (1 << 24) as f32);
    (0..n).map(|k| Sphere::new([coordinate(), coordinate(), coordinate()], radii[k % radii.len()])).collect()
}

fn in_box(spheres: Vec<Sphere>, lengths: [Option<f32>; 3]) -> TestInput {
    TestInput {
        space: Space::periodic(lengths.map(|length| length.map(f64::from))).expect("a box"),
        ..spheres.into()
    }
}

fn agree(cases: u32, scenarios: impl Strategy<Value = TestInput>) {
    check(cases, (scenarios, settings()), |(scenario, settings)| {
        verify_all(&scenario, &scenario.rounding_oracle(), &settings)
    });
}

#[test]
fn lattices_in_contact_across_the_boundary_match_the_oracle() {
    agree(80, periodic::lattice());
}

#[test]
fn overlapping_spheres_in_any_box_match_the_oracle() {
    agree(96, periodic::soup());
}

#[test]
fn crowds_at_the_corner_match_the_oracle() {
    agree(64, periodic::corner());
}

#[test]
fn coordinates_far_outside_match_the_oracle() {
    check(64, (periodic::unwrapped(), settings()), |(spheres, settings)| {
        verify_all(&spheres, &oracle_of_integers(&spheres), &settings)
    });
}

#[test]
fn subnormal_lengths_and_overflowing_squares_match_the_oracle() {
    agree(96, periodic::extremes());
}

#[test]
fn giants_in_small_boxes_match_the_oracle() {
    agree(64, periodic::giant());
}

#[test]
fn species_in_periodic_boxes_match_the_oracle() {
    agree(64, periodic::mixture());
}

#[test]
fn the_oracle_agrees_with_all_images() {
    for (k, side) in [0.4_f32, 1.0, 3.0, 8.0].into_iter().enumerate() {
        for axes in 1..8 {
            let lengths = [0, 1, 2].map(|axis| (axes >> axis & 1 == 1).then_some(side));
            let spheres = uniform(150, &[0.1, 0.0, 0.4, 2.0], side, k as u64);
            let periodic = in_box(spheres, lengths);
            let expected = oracle_of_images(&periodic);
            assert_eq!(periodic.rounding_oracle(), expected, "{lengths:?}");
            verify_all(&periodic, &expected, &Config::default()).unwrap_or_else(|text| panic!("{text}"));
        }
    }
}

#[test]
fn full_periodic_lattice_has_three_contacts_per_site() {
    for (k, spacing) in [(3_usize, 0.5_f32), (4, 1.0), (10, 0.25), (21, 3.0)] {
        let point = |at: usize| [at % k, at / k % k, at / k / k].map(|c| c as f32 * spacing);
        let spheres: Vec<_> = (0..k * k * k).map(|at| Sphere::new(point(at), 0.5 * spacing)).collect();
        let space = Space::periodic([Some(f64::from(k as f32 * spacing)); 3]).expect("a box");
        for variant in on_cpu() {
            let mut detector = Detector::new(variant.settings().space(space)).expect("a detector");
            let found = variant.run(|| detector.count(&spheres));
            assert_eq!(found, Ok(3 * (k * k * k) as u64), "{variant}, {k}³");
        }
    }
}

#[test]
fn large_boxes_give_identical_pairs() {
    let cases = [
        (&[0.5_f32][..], [Some(20.0); 3], 20.0),
        (&[0.5, 0.25, 0.125, 0.06, 0.03], [Some(16.0), None, Some(14.0)], 16.0),
        (&[0.02, 0.02, 0.02, 0.02, 0.02, 0.02, 0.02, 3.0], [Some(8.0); 3], 8.0),
        (&[0.1, 0.01], [Some(2.0), Some(3.0), Some(2.5)], 10.0),
    ];
    for (case, (radii, lengths, side)) in cases.into_iter().enumerate() {
        let n = if case == 3 { 6000 } else { 8000 };
        let periodic = in_box(uniform(n, radii, side, 7), lengths);
        let expected = periodic.rounding_oracle();
        assert!(expected.len() > n / 2, "{case}: {}", expected.len());
        verify_all(&periodic, &expected, &Config::default().tau(64))
            .unwrap_or_else(|text| panic!("{case}: {text}"));
        let mut lists: Vec<(DetectorVariant, Vec<Pair>)> = Vec::new();
        for variant in on_cpu() {
            let order = Config::default().order(Order::Unordered);
            let found = variant.find(&periodic, order).expect("pairs");
            match lists.iter().find(|(other, _)| other.algorithm == variant.algorithm) {
                Some((other, first)) => assert!(found == *first, "{case}: {variant} and {other} differ"),
                None => lists.push((variant, found)),
            }
        }
    }
}

/// The expected number is Σ n_ab · (4/3)π (ra + rb)³ / V, with binomial variance.
#[test]
fn uniform_boxes_by_the_formula() {
    const SEEDS: u64 = 5;
    let (side, radii) = (40.0_f32, [1.0_f32, 0.5, 0.25]);
    let sizes = radii.map(|radius| (3000_u64, f64::from(radius)));
    let expected = periodic_box_pairs(&sizes, f64::from(side).powi(3));
    let space = Space::periodic([Some(f64::from(side)); 3]).expect("a box");
    for variant in on_cpu().filter(|variant| variant.threads() == 2) {
        let mut detector = Detector::new(variant.settings().space(space)).expect("a detector");
        let count = |seed| detector.count(&uniform(9000, &radii, side, seed)).expect("a count");
        let mean = (0..SEEDS).map(count).sum::<u64>() as f64 / SEEDS as f64;
        let error = (expected.variance / SEEDS as f64).sqrt();
        let off = (mean - expected.mean).abs();
        assert!(off <= 4.0 * error, "{variant}: mean {mean}, {expected:?}, standard error {error}");
    }
}

#[test]
fn all_kinds_of_results_agree() {
    let spheres = uniform(3000, &[0.3, 0.1], 10.0, 3);
    let periodic = in_box(spheres, [Some(5.0), Some(10.0), None]);
    let (expected, spheres) = (periodic.rounding_oracle(), &periodic.spheres);
    let column = |value: fn(&Sphere) -> f32| spheres.iter().map(value).collect::<Vec<_>>();
    let (x, y) = (column(|s| s.center.x), column(|s| s.center.y));
    let (z, r) = (column(|s| s.center.z), column(|s| s.radius));
    let columns = Spheres::columns(&x, &y, &z, &r).expect("columns of one length");
    for variant in on_cpu() {
        let mut detector =
            Detector::new(variant.settings().space(periodic.space).max_pairs(700)).expect("a detector");
        assert_eq!(detector.count(spheres), Ok(expected.len() as u64), "{variant}");
        let stream = streamed(&mut detector, columns, 100).expect("a stream");
        assert!(stream == expected, "{variant}: the stream differs");
        let mut detector = Detector::new(variant.settings().space(periodic.space)).expect("a detector");
        let lists = listed(&mut detector, columns).expect("neighbors");
        assert!(lists == expected, "{variant}: the neighbors differ");
        assert!(detector.memory_for(3000) >= 16 * 3000, "{variant}");
    }
}

#[test]
fn box_length_decides_contact_across_the_boundary() {
    let spheres =
        [Sphere::new([0.0; 3], 0.5), Sphere::new([9.0, 0.0, 0.0], 0.5), Sphere::new([5.0, 0.0, 0.0], 30.0)];
    let count = |lengths| {
        let config = Config::default().space(Space::periodic(lengths).expect("a box"));
        Detector::new(config).and_then(|mut detector| detector.count(&spheres))
    };
    assert_eq!(count([None; 3]), Ok(2));
    assert_eq!(count([None, Some(10.0), Some(10.0)]), Ok(2));
    assert_eq!(count([Some(10.0), None, None]), Ok(3));
    assert_eq!(count([Some(10.0_f32.next_up().into()), None, None]), Ok(2));
    assert_eq!(count([Some(0.001); 3]), Ok(3));
}

#[test]
fn bad_spheres_are_named_by_input_coordinates() {
    let mut spheres = uniform(100, &[0.1], 5.0, 1);
    spheres[40].center.y = f32::INFINITY;
    spheres[70].radius = -1.0;
    let space = Space::periodic([Some(1.0); 3]).expect("a box");
    for variant in variants::all() {
        let mut detector = Detector::new(variant.settings().space(space)).expect("a detector");
        let Err(Error::Input(InputError::Sphere { index, center, count, total, .. })) =
            detector.pairs(&spheres)
        else {
            panic!("{variant}: bad spheres were accepted")
        };
        assert_eq!((index, center[1], count, total), (40, f64::INFINITY, 2, 100), "{variant}");
        assert!(detector.pairs(&spheres[..40]).is_ok(), "{variant}");
    }
}

#[test]
fn invalid_lengths_are_refused() {
    let error = Space::periodic([Some(1.0), Some(-2.0), None]).expect_err("no such length").to_string();
    assert!(error.contains("-2") && error.contains("axis y"), "{error}");
}

#[test]
fn all_kinds_of_results_on_the_gpu_agree() {
    let spheres = uniform(3000, &[0.3, 0.1], 10.0, 3);
    let periodic = in_box(spheres, [Some(5.0), Some(10.0), None]);
    let (expected, spheres) = (periodic.rounding_oracle(), &periodic.spheres);
    for variant in variants::all().into_iter().filter(|variant| variant.backend() == Backend::Gpu) {
        let mut detector = Detector::new(variant.settings().space(periodic.space)).expect("a detector");
        let list = detector.pairs(spheres).expect("pairs").to_vec();
        assert_eq!(difference(&periodic, &list, &expected, Tolerance::Tangent), Ok(()), "{variant}");
        assert_eq!(match_the_list(&mut detector, spheres, &list), Ok(()), "{variant}");
        let copy = if variant.algorithm == Algorithm::CellList { 0 } else { 16 * 3000 };
        let unbounded = Detector::new(variant.settings()).expect("a detector").memory_for(3000);
        assert!(detector.memory_for(3000) >= unbounded + copy, "{variant}");
    }
}
