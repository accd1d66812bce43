use glam::Vec3;
use lazygrid::{Algorithm, Config, Detector, Error, InputError, Order, Skin, Space, Sphere, Spheres};
use lazygrid_check::scenes::motion::{skin_of, walk};
use lazygrid_check::scenes::triclinic as families;
use lazygrid_check::scenes::triclinic::tilted;
use lazygrid_tests::periodic::verify_all;
use lazygrid_tests::results::{match_the_list, streamed};
use lazygrid_tests::{SuiteVariant, TestInput, difference, in_pool, triclinic, variants};
use proptest::prelude::*;
use proptest::sample::select;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::properties::{check, settings};
use crate::two_sets;

fn agree(cases: u32, scenarios: impl Strategy<Value = TestInput>) {
    check(cases, (scenarios, settings()), |(scenario, settings)| {
        verify_all(&scenario, &scenario.oracle(), &settings)
    });
}

fn uniform(n: usize, radii: &[f32], vectors: [Vec3; 3], seed: u64) -> Vec<Sphere> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut fraction = || (rng.next_u32() >> 8) as f32 / (1 << 24) as f32;
    let mut point = || vectors[0] * fraction() + vectors[1] * fraction() + vectors[2] * fraction();
    (0..n).map(|k| Sphere::new(point(), radii[k % radii.len()])).collect()
}

fn tilted_input(n: usize, radii: &[f32], side: f32) -> TestInput {
    let vectors = tilted([Some(side); 3], [0.4 * side, -0.3 * side, 0.2 * side]);
    let spheres = uniform(n, radii, vectors.map(Option::unwrap_or_default), 5);
    TestInput { space: families::space(vectors), ..spheres.into() }
}

#[test]
fn lattices_in_contact_across_triclinic_boundaries() {
    agree(96, triclinic::lattice());
}

#[test]
fn soups_in_boxes_of_any_tilt() {
    agree(120, triclinic::soup());
}

#[test]
fn cell_vectors_of_any_direction() {
    agree(96, triclinic::directions());
}

#[test]
fn coordinates_far_outside() {
    agree(96, triclinic::carried_away());
}

#[test]
fn corners_and_periodic_boundaries() {
    agree(96, triclinic::corners());
}

#[test]
fn lengths_with_overflowing_squares() {
    agree(64, triclinic::ends_of_the_range());
}

#[test]
fn largest_spheres() {
    agree(48, triclinic::largest_spheres());
}

#[test]
fn species_in_triclinic_cells() {
    agree(96, triclinic::mixture());
}

#[test]
fn distance_matches_nearest_images() {
    let scenarios = prop_oneof![triclinic::soup(), triclinic::directions(), triclinic::lattice()];
    check(150, scenarios, |mut scenario| {
        scenario.spheres.truncate(30);
        let space = scenario.space;
        for a in &scenario.spheres {
            for b in &scenario.spheres {
                let apart = space.distance_squared(a.center, b.center);
                if apart != space.distance_squared(b.center, a.center) {
                    return Err(format!("{a:?} and {b:?}: not the same both ways"));
                }
                for (factor, expected) in [(1.0 + 1e-5, 1), (1.0 - 1e-5, 0)] {
                    let radius = (apart.sqrt() * factor) as f32;
                    let spheres = vec![Sphere::new(a.center, radius), Sphere::new(b.center, 0.0)];
                    let found = TestInput { space, ..spheres.into() }.oracle().len();
                    if apart > 1e-8 && found != expected {
                        return Err(format!("{a:?} and {b:?} are not {apart} apart: {found}"));
                    }
                }
                let wrapped = space.wrap(a.center);
                let again = space.distance_squared(wrapped, a.center);
                if again > 1e-8 * f64::from(1.0 + a.center.length_squared()) {
                    return Err(format!("{a:?} is wrapped to {wrapped}, {again} away from its images"));
                }
            }
        }
        Ok(())
    });
}

#[test]
fn tiny_distances_to_images_are_exact() {
    let vectors = [[10.0, 0.0, 0.0], [-0.25, 10.0, 0.0], [0.5, 1.0, 0.1]].map(Vec3::from);
    let space = families::space(vectors.map(Some));
    let tiny = f32::from_bits(3);
    for shifts in 0..27 {
        let shift = |k: u32| (shifts / 3_i32.pow(k) % 3 - 1) as f32;
        let image: Vec3 = (0..3).map(|k| vectors[k as usize] * shift(k)).sum();
        let next = image + Vec3::new(tiny, -tiny, tiny);
        let apart = (next - image).as_dvec3().length_squared();
        // If the sum of cell vectors is not representable in `f32`, `image` is not an exact image.
        let exact: glam::DVec3 = (0..3).map(|k| vectors[k as usize].as_dvec3() * f64::from(shift(k))).sum();
        if image.as_dvec3() == exact {
            assert_eq!(space.distance_squared(next, Vec3::ZERO), apart, "{image}");
        }
    }
}

#[test]
fn tilts_by_whole_lengths_have_no_effect() {
    let spheres = uniform(800, &[0.4, 0.2], [Vec3::X * 8.0, Vec3::Y * 4.0, Vec3::Z * 6.0], 2);
    let orthogonal = Space::periodic([Some(8.0), Some(4.0), Some(6.0)]).expect("a box");
    let vectors = tilted([Some(8.0), Some(4.0), Some(6.0)], [16.0, -8.0, 12.0]);
    let [orthogonal, tilted_cell] =
        [orthogonal, families::space(vectors)].map(|space| TestInput { space, ..spheres.clone().into() });
    let expected = orthogonal.oracle();
    assert!(expected.len() > 500);
    assert_eq!(tilted_cell.oracle(), expected);
    verify_all(&tilted_cell, &expected, &Config::default()).unwrap_or_else(|text| panic!("{text}"));
}

#[test]
fn large_boxes_give_identical_pairs() {
    let cases: [(&[f32], f32); 3] = [
        (&[0.5], 20.0),
        (&[0.5, 0.25, 0.125, 0.06, 0.03], 16.0),
        (&[0.02, 0.02, 0.02, 0.02, 0.02, 0.02, 2.0], 8.0),
    ];
    for (radii, side) in cases {
        let scenario = tilted_input(4000, radii, side);
        let expected = scenario.oracle();
        assert!(expected.len() > 1000, "{}", expected.len());
        for variant in variants::all() {
            let found = variant.find(&scenario, Config::default()).expect("pairs");
            assert!(
                found == expected,
                "{variant}: {:?}",
                difference(&scenario, &found, &expected, variant.tolerance())
            );
            let unordered =
                variant.find(&scenario, Config::default().order(Order::Unordered)).expect("pairs");
            assert_eq!(unordered.len(), expected.len(), "{variant}");
        }
    }
}

#[test]
fn all_kinds_of_results_agree() {
    let scenario = tilted_input(2000, &[0.4, 0.1], 8.0);
    let expected = scenario.oracle();
    let most = expected.len() as u64;
    for variant in variants::each_algorithm() {
        let spheres = Spheres::from(&scenario.spheres);
        let detector =
            |limit| Detector::new(variant.settings().space(scenario.space).max_pairs(limit)).expect("made");
        assert_eq!(detector(most).pairs(spheres).expect("as many as fit"), expected, "{variant}");
        let error = detector(most - 1).pairs(spheres).expect_err("one too many");
        assert_eq!(error, Error::TooManyPairs { found: most, limit: most - 1 }, "{variant}");
        for limit in [1 << 20, 300] {
            let stream = streamed(&mut detector(limit), spheres, 100).expect("a stream");
            assert!(stream == expected, "{variant}: the stream differs");
        }
        assert_eq!(match_the_list(&mut detector(1 << 20), spheres, &expected), Ok(()), "{variant}");
    }
}

#[test]
fn pairs_across_two_sets() {
    let scenarios = prop_oneof![triclinic::soup(), triclinic::lattice(), triclinic::mixture()];
    check(120, (scenarios, 0.0..=1.0_f32, select(variants::all())), |(scenario, fraction, variant)| {
        two_sets::agrees(&scenario, two_sets::split_at(&scenario, fraction), variant)
    });
}

#[test]
fn candidate_lists_never_change_a_result() {
    let scenarios =
        prop_oneof![triclinic::soup(), triclinic::lattice(), triclinic::mixture(), triclinic::directions()];
    let mut variants = variants::all();
    variants.retain(|variant| variant.algorithm == Algorithm::CellList);
    let skins = select(vec![1e-6, 0.01, 0.3, 2.0]);
    let moves = select(vec![0.0, 1e-3, 0.03, 0.5]);
    check(120, (scenarios, skins, moves, select(variants)), |(mut scenario, skin, moves, variant)| {
        let config = variant.settings().skin(skin_of(&scenario.spheres, skin));
        let config = scenario.config(config).map_err(|error| error.to_string())?;
        in_pool(variant.threads(), || {
            let mut detector = Detector::new(config).map_err(|error| error.to_string())?;
            for step in 0..5 {
                let found = detector.pairs(scenario.query()).map_err(|error| error.to_string())?.to_vec();
                let why = detector.report().reason;
                difference(&scenario, &found, &scenario.oracle(), variant.tolerance())
                    .map_err(|text| format!("{variant}, moves of {moves}, step {step}, {why}: {text}"))?;
                walk(&mut scenario.spheres, if step == 3 { 40.0 * moves } else { moves }, step);
            }
            Ok(())
        })
    });
}

#[test]
fn candidate_lists_are_reused() {
    for variant in variants::each_algorithm() {
        if variant.algorithm != Algorithm::CellList {
            continue;
        }
        let mut scenario = tilted_input(1500, &[0.2], 8.0);
        let config = variant.settings().space(scenario.space).skin(Skin::Fixed(0.2));
        let mut detector = Detector::new(config).expect("a detector");
        let mut served = 0;
        for step in 0..8 {
            let found = detector.pairs(scenario.query()).expect("valid spheres").to_vec();
            assert!(found == scenario.oracle(), "{variant}, step {step}");
            served += u32::from(detector.report().candidates.is_some_and(|stats| stats.rebuilt.is_none()));
            walk(&mut scenario.spheres, 0.01, step);
        }
        assert!(served > 4, "{variant}: {served} of 8 calls were served");
    }
}

#[test]
fn axis_parallel_vectors_are_lengths() {
    let vectors = [[3.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.0, 0.0, 7.0]].map(Some);
    let space = Space::triclinic(vectors).expect("a box");
    assert_eq!(space, Space::periodic([Some(3.0), Some(5.0), Some(7.0)]).expect("a box"));
    for vectors in [[vectors[1], vectors[0], vectors[2]], [Some([-3.0, 0.0, 0.0]), vectors[1], None]] {
        assert_eq!(Space::triclinic(vectors).expect("a box").cell_vectors(), vectors);
    }
    assert_eq!(Space::triclinic([None; 3]), Ok(Space::UNBOUNDED));
    let slab = Space::triclinic([Some([2.0, 1.0, 0.0]), None, Some([0.0, 0.0, 1.0])]).expect("a slab");
    assert!(slab.is_periodic() && slab.triclinic_cell().is_some());
    assert_eq!(slab.cell_vectors(), [Some([2.0, 1.0, 0.0]), None, Some([0.0, 0.0, 1.0])]);
}

#[test]
fn dependent_cell_vectors_are_refused() {
    let along = Vec3::new(1.0, 1.0, 0.0);
    for vectors in [
        [Some(along), Some(2.0 * along), None],
        [Some(along), Some(Vec3::X), Some(Vec3::Y)],
        [Some(along), Some(Vec3::ZERO), None],
        [Some(Vec3::new(f32::NAN, 1.0, 0.0)), None, None],
        [Some(Vec3::new(1.0, f32::INFINITY, 0.0)), None, None],
        [Some(along), Some(Vec3::new(0.0, 1e9, 1.0)), None],
    ] {
        let vectors = vectors.map(|vector| vector.map(|vector| vector.as_dvec3().to_array()));
        let error = Space::triclinic(vectors).expect_err("no box");
        assert!(matches!(error, InputError::CellVectors { .. }), "{error}");
    }
    let error = Space::triclinic([Some([1.0, 1.0, 0.0]), Some([2.0, 2.0, 0.0]), None])
        .expect_err("a line")
        .to_string();
    assert!(error.contains("(1, 1, 0), (2, 2, 0)"), "{error}");
}

#[test]
fn bad_spheres_are_named_by_input_coordinates() {
    let mut scenario = tilted_input(100, &[0.1], 5.0);
    scenario.spheres[40].center.y = f32::INFINITY;
    scenario.spheres[70].radius = -1.0;
    for variant in variants::all() {
        let error = variant.find(&scenario, Config::default()).expect_err("bad spheres");
        assert!(error.contains("sphere 40") && error.contains("2 of 100 spheres"), "{variant}: {error}");
    }
}
