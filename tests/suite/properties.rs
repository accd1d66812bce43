use std::fmt::Debug;

use lazygrid::Config;
use lazygrid_tests::{DetectorVariant, SuiteVariant, THREADS, TestInput, hard, variants};
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::{RngSeed, TestCaseError, TestError, TestRunner};

/// Divisor of the number of cases unless `LAZYGRID_TEST_FULL` is set, because software adapters are slow.
const CASES_DIVISOR: u32 = 3;

/// Uses a fixed seed. `PROPTEST_CASES` and `PROPTEST_RNG_SEED` replace the number and the seed.
pub(crate) fn check<S>(cases: u32, strategy: S, test: impl Fn(S::Value) -> Result<(), String>)
where
    S: Strategy,
    S::Value: Debug,
{
    let mut config =
        ProptestConfig { failure_persistence: None, max_shrink_iters: 5000, ..ProptestConfig::default() };
    if std::env::var_os("PROPTEST_CASES").is_none() {
        let is_long = std::env::var_os("LAZYGRID_TEST_FULL").is_some();
        config.cases = if is_long { cases } else { cases.div_ceil(CASES_DIVISOR) };
    }
    if config.rng_seed == RngSeed::Random {
        config.rng_seed = RngSeed::Fixed(20);
    }
    let result = TestRunner::new(config).run(&strategy, |value| test(value).map_err(TestCaseError::fail));
    match result {
        Ok(()) => {}
        Err(TestError::Fail(reason, value)) => panic!("{reason}\nfor {value:?}"),
        Err(TestError::Abort(reason)) => panic!("{reason}"),
    }
}

pub(crate) fn settings() -> impl Strategy<Value = Config> {
    let tau = prop_oneof![select(vec![0, 1, 2, 8, 32, u32::MAX]), 0_u32..600];
    let ratio = prop_oneof![select(vec![0.5_f32, 1.0, 1.5, 2.0, 16.0]), 0.5_f32..=16.0];
    (tau, ratio).prop_map(|(tau, ratio)| Config::default().tau(tau).cell_ratio(ratio))
}

fn every_variant_agrees(cases: u32, spheres: hard::Spheres) {
    check(cases, (spheres, settings()), |(spheres, settings)| {
        let scenario = TestInput::from(spheres);
        let expected = scenario.oracle();
        let mut variants = variants::for_scenario(&scenario).into_iter();
        variants.try_for_each(|variant| variant.verify(&scenario, &expected, &settings))
    });
}

#[test]
fn lattices_in_contact() {
    every_variant_agrees(96, hard::lattice());
}

#[test]
fn duplicates() {
    every_variant_agrees(96, hard::duplicates());
}

#[test]
fn one_giant_among_many_tiny() {
    every_variant_agrees(96, hard::giant());
}

#[test]
fn sizes_over_powers_of_two() {
    every_variant_agrees(96, hard::powers_of_two());
}

#[test]
fn lines_and_planes() {
    every_variant_agrees(96, hard::flat());
}

#[test]
fn clusters_of_clusters() {
    every_variant_agrees(96, hard::clusters());
}

#[test]
fn far_from_the_origin() {
    every_variant_agrees(96, hard::far());
}

#[test]
fn any_floats() {
    every_variant_agrees(32, hard::any_floats());
}

#[test]
fn any_magnitude_with_subnormals() {
    every_variant_agrees(96, hard::one_magnitude());
}

#[test]
fn subnormal_lengths_and_overflowing_squares() {
    every_variant_agrees(128, hard::extremes());
}

#[test]
fn radii_whose_squares_overflow() {
    every_variant_agrees(96, hard::huge_radii());
}

#[test]
fn crowded_boxes() {
    every_variant_agrees(96, hard::soup());
}

#[test]
fn mixed_lists() {
    every_variant_agrees(96, hard::any_spheres());
}

pub(crate) fn one_of_each(scenario: &TestInput) -> impl Iterator<Item = DetectorVariant> {
    variants::for_scenario(scenario).into_iter().filter(|variant| variant.threads() == THREADS[0])
}

#[test]
fn permuted_spheres_have_permuted_pairs() {
    let strategy = hard::any_spheres().prop_flat_map(|spheres| {
        let order: Vec<u32> = (0..spheres.len() as u32).collect();
        (Just(spheres), Just(order).prop_shuffle())
    });
    check(64, strategy, |(spheres, order)| {
        let permuted = TestInput::from(order.iter().map(|&at| spheres[at as usize]).collect::<Vec<_>>());
        let original = TestInput::from(spheres);
        for variant in one_of_each(&original) {
            let back = variant
                .find(&permuted, Config::default())?
                .into_iter()
                .map(|pair| lazygrid::Pair::new(order[pair.i as usize], order[pair.j as usize]));
            let (back, direct) = (back.collect::<Vec<_>>(), variant.find(&original, Config::default())?);
            let same = lazygrid_tests::difference(&original, &back, &direct, variant.tolerance());
            same.map_err(|text| format!("{variant}: {text}"))?;
        }
        Ok(())
    });
}
