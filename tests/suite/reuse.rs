use lazygrid::{Detector, Order};
use lazygrid_tests::results::{listed, streamed};
use lazygrid_tests::{DetectorVariant, SuiteVariant, TestInput, difference, hard, variants};
use proptest::collection::vec;
use proptest::prelude::*;

use crate::properties::{check, one_of_each, settings};

#[derive(Clone, Copy, Debug)]
enum QueryKind {
    Pairs,
    Count,
    Neighbors,
    Stream,
}

fn call() -> impl Strategy<Value = QueryKind> {
    prop_oneof![3 => Just(QueryKind::Pairs), 1 => Just(QueryKind::Count), 1 => Just(QueryKind::Neighbors), 1 => Just(QueryKind::Stream)]
}

fn ask(
    variant: DetectorVariant,
    detector: &mut Detector,
    call: QueryKind,
    scenario: &TestInput,
) -> Result<(), String> {
    let (view, expected) = (scenario.query(), variant.own_pairs(scenario, &scenario.oracle())?);
    let found = match call {
        QueryKind::Pairs => Some(detector.pairs(view).map_err(|e| e.to_string())?.to_vec()),
        QueryKind::Count => detector.count(view).map(|_| None).map_err(|e| e.to_string())?,
        QueryKind::Neighbors => Some(listed(detector, view)?),
        QueryKind::Stream => Some(streamed(detector, view, 100)?),
    };
    let reported = detector.report().pairs;
    if reported != expected.len() as u64 {
        return Err(format!("{reported} pairs reported, {} expected", expected.len()));
    }
    found.map_or(Ok(()), |found| difference(scenario, &found, &expected, lazygrid_tests::Tolerance::Exact))
}

#[test]
fn any_sequence_of_inputs_and_calls() {
    let calls = vec((hard::any_spheres(), call()), 2..6);
    check(40, (calls, settings(), any::<bool>()), |(calls, settings, unordered)| {
        let order = if unordered { Order::Unordered } else { Order::Canonical };
        for variant in one_of_each(&calls[0].0.clone().into()) {
            let config =
                settings.clone().order(order).backend(variant.backend()).algorithm(variant.algorithm);
            let mut detector = Detector::new(config).map_err(|e| e.to_string())?;
            for (k, (spheres, call)) in calls.iter().enumerate() {
                let scenario = TestInput::from(spheres.clone());
                ask(variant, &mut detector, *call, &scenario)
                    .map_err(|text| format!("{variant}, call {k}: {text}"))?;
            }
        }
        Ok(())
    });
}

#[test]
fn calls_after_errors_are_right() {
    let good = TestInput::from(lazygrid_io::scenes::Scene::FiveSizes.spheres(1000, 9));
    let mut bad = good.clone();
    bad.spheres[10].radius = f32::NAN;
    let coincident = TestInput::from(vec![lazygrid::Sphere::new([0.0; 3], 1.0); 400]);
    for variant in variants::each_algorithm() {
        let limit = variant.own_pairs(&good, &good.oracle()).expect("its list").len() as u64;
        let mut detector = Detector::new(variant.settings().max_pairs(limit)).expect("a detector");
        for _ in 0..2 {
            assert!(detector.pairs(bad.query()).is_err(), "{variant}");
            assert!(detector.pairs(coincident.query()).is_err(), "{variant}");
            for call in [QueryKind::Pairs, QueryKind::Neighbors, QueryKind::Stream, QueryKind::Count] {
                ask(variant, &mut detector, call, &good)
                    .unwrap_or_else(|text| panic!("{variant}, {call:?}: {text}"));
            }
        }
    }
}

#[test]
fn simulation_steps_are_right() {
    use lazygrid_io::scenes::Scene;
    for scene in Scene::ALL {
        let mut scenario = TestInput::from(scene.spheres(600, 21));
        let mut detectors: Vec<(DetectorVariant, Detector)> = variants::each_algorithm()
            .into_iter()
            .map(|variant| (variant, Detector::new(variant.settings()).expect("a detector")))
            .collect();
        for step in 0..6 {
            let expected = scenario.oracle();
            for (variant, detector) in &mut detectors {
                let found = detector.pairs(scenario.query()).expect("the scene is valid").to_vec();
                assert_eq!(detector.report().pairs, found.len() as u64, "{variant}, {scene}, step {step}");
                difference(&scenario, &found, &expected, variant.tolerance())
                    .unwrap_or_else(|text| panic!("{variant}, {scene}, step {step}: {text}"));
            }
            Scene::advance(&mut scenario.spheres, 21, step);
            if step == 3 {
                scenario.spheres.truncate(300);
            }
        }
    }
}
