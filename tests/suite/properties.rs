//! All variants find the oracle's pairs of hard scenes, for any settings.

use std::fmt::Debug;

use lazygrid::Config;
use lazygrid_tests::{Subject, THREADS, TestInput, adversary};
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::{RngSeed, TestCaseError, TestError, TestRunner};

/// Divisor of the number of cases unless `LAZYGRID_LONG` is set. Software adapters take most of the time.
const SHORT: u32 = 3;

/// Runs `test` on `cases` values, or a part of them unless `LAZYGRID_LONG` is set. The seed is fixed, so that each run
/// has the same cases. `PROPTEST_CASES` and `PROPTEST_RNG_SEED` change the number and the seed.
pub(crate) fn check<S>(cases: u32, strategy: S, test: impl Fn(S::Value) -> Result<(), String>)
where
    S: Strategy,
    S::Value: Debug,
{
    let mut config =
        ProptestConfig { failure_persistence: None, max_shrink_iters: 5000, ..ProptestConfig::default() };
    if std::env::var_os("PROPTEST_CASES").is_none() {
        let is_long = std::env::var_os("LAZYGRID_LONG").is_some();
        config.cases = if is_long { cases } else { cases.div_ceil(SHORT) };
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

/// Settings that affect the speed but not the pairs.
pub(crate) fn settings() -> impl Strategy<Value = Config> {
    let tau = prop_oneof![select(vec![0, 1, 2, 8, 32, u32::MAX]), 0_u32..600];
    let ratio = prop_oneof![select(vec![0.5_f32, 1.0, 1.5, 2.0, 16.0]), 0.5_f32..=16.0];
    (tau, ratio).prop_map(|(tau, ratio)| Config::default().tau(tau).raster_ratio(ratio))
}

fn every_subject_agrees(cases: u32, spheres: adversary::Spheres) {
    check(cases, (spheres, settings()), |(spheres, settings)| {
        let scenario = TestInput::from(spheres);
        let expected = scenario.oracle();
        let mut subjects = Subject::in_turn(&scenario).into_iter();
        subjects.try_for_each(|subject| subject.judge(&scenario, &expected, &settings))
    });
}

#[test]
fn lattices_in_contact() {
    every_subject_agrees(96, adversary::lattice());
}

#[test]
fn duplicates() {
    every_subject_agrees(96, adversary::duplicates());
}

#[test]
fn one_giant_among_many_tiny() {
    every_subject_agrees(96, adversary::giant());
}

#[test]
fn sizes_over_powers_of_two() {
    every_subject_agrees(96, adversary::powers_of_two());
}

#[test]
fn lines_and_planes() {
    every_subject_agrees(96, adversary::flat());
}

#[test]
fn clusters_of_clusters() {
    every_subject_agrees(96, adversary::clusters());
}

#[test]
fn far_from_the_origin() {
    every_subject_agrees(96, adversary::far());
}

#[test]
fn any_floats() {
    every_subject_agrees(32, adversary::any_floats());
}

#[test]
fn any_magnitude_with_subnormals() {
    every_subject_agrees(96, adversary::one_magnitude());
}

#[test]
fn subnormal_lengths_and_overflowing_squares() {
    every_subject_agrees(128, adversary::extremes());
}

#[test]
fn radii_whose_squares_overflow() {
    every_subject_agrees(96, adversary::huge_radii());
}

#[test]
fn crowded_boxes() {
    every_subject_agrees(96, adversary::soup());
}

#[test]
fn mixed_lists() {
    every_subject_agrees(96, adversary::any_spheres());
}

/// The variants for this scenario, with the fewest threads.
pub(crate) fn one_of_each(scenario: &TestInput) -> impl Iterator<Item = Subject> {
    Subject::in_turn(scenario).into_iter().filter(|subject| subject.threads == THREADS[0])
}

#[test]
fn permuted_spheres_have_permuted_pairs() {
    let strategy = adversary::any_spheres().prop_flat_map(|spheres| {
        let places: Vec<u32> = (0..spheres.len() as u32).collect();
        (Just(spheres), Just(places).prop_shuffle())
    });
    check(64, strategy, |(spheres, places)| {
        let permuted = TestInput::from(places.iter().map(|&at| spheres[at as usize]).collect::<Vec<_>>());
        let original = TestInput::from(spheres);
        for subject in one_of_each(&original) {
            let back = subject
                .pairs(&permuted, Config::default())?
                .into_iter()
                .map(|pair| lazygrid::Pair::new(places[pair.i as usize], places[pair.j as usize]));
            let (back, direct) = (back.collect::<Vec<_>>(), subject.pairs(&original, Config::default())?);
            let same = lazygrid_tests::difference(&original, &back, &direct, subject.tolerance());
            same.map_err(|text| format!("{subject}: {text}"))?;
        }
        Ok(())
    });
}
