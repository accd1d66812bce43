//! Candidate lists never affect a result.

use lazygrid::{Algorithm, Backend, Detector, Order, Skin};
use lazygrid_check::motion::{skin_of, walk};
use lazygrid_io::scenes::Scene;
use lazygrid_tests::{Subject, TestInput, adversary, difference, in_pool, periodic};
use proptest::prelude::*;
use proptest::sample::select;

use crate::properties::check;

/// Variants with candidate lists: the cell list on the CPU, and all algorithms on the GPU.
fn keepers() -> Vec<Subject> {
    let mut subjects = Subject::all();
    subjects.retain(|subject| subject.backend == Backend::Gpu || subject.algorithm == Algorithm::CellList);
    subjects
}

/// Checks six calls with moving spheres against the definition.
fn follows(scenario: &TestInput, part: f32, moves: f32, subject: Subject) -> Result<(), String> {
    let mut scenario = scenario.clone();
    let skin = skin_of(&scenario.spheres, part);
    let order = if subject.threads == 1 { Order::Unordered } else { Order::Canonical };
    let config = subject.config().order(order).skin(skin);
    let config = scenario.config(config).map_err(|error| error.to_string())?;
    in_pool(subject.threads, || {
        let mut detector = Detector::new(config).map_err(|error| error.to_string())?;
        for step in 0..6 {
            let expected = match scenario.space.is_periodic() {
                true => periodic::oracle(&scenario),
                false => scenario.oracle(),
            };
            let found = detector.pairs(scenario.query()).map_err(|error| error.to_string())?.to_vec();
            let why = detector.report().reason;
            difference(&scenario, &found, &expected, subject.tolerance()).map_err(|text| {
                format!("{subject}, {skin:?}, moves of {moves}, step {step}, {why}: {text}")
            })?;
            walk(&mut scenario.spheres, if step == 4 { 40.0 * moves } else { moves }, step);
        }
        Ok(())
    })
}

fn parts() -> impl Strategy<Value = f32> {
    select(vec![0.0, 1e-6, 0.01, 0.3, 2.0, 1e3])
}

fn moves() -> impl Strategy<Value = f32> {
    select(vec![0.0, 1e-7, 1e-3, 0.03, 0.5])
}

#[test]
fn arbitrary_spheres() {
    let scenarios = prop_oneof![
        2 => adversary::any_spheres().prop_map(TestInput::from),
        1 => adversary::mixture(adversary::any_spheres()),
    ];
    let cases = (scenarios, parts(), moves(), select(keepers()));
    check(200, cases, |(scenario, part, moves, subject)| follows(&scenario, part, moves, subject));
}

#[test]
fn arbitrary_spheres_in_periodic_boxes() {
    let scenarios = prop_oneof![
        periodic::lattice(),
        periodic::soup(),
        periodic::corner(),
        periodic::giant(),
        periodic::mixture(),
    ];
    let cases = (scenarios, parts(), moves(), select(keepers()));
    check(200, cases, |(scenario, part, moves, subject)| follows(&scenario, part, moves, subject));
}

/// The motion of the benchmarks, in which candidate lists are reused.
#[test]
fn running_simulations() {
    let mut subjects = keepers();
    subjects.retain(|subject| subject.algorithm == Algorithm::CellList);
    let both = |of: Subject| [(of, Skin::Auto), (of, Skin::Fixed(0.4))];
    let ways: Vec<_> = subjects.into_iter().flat_map(both).collect();
    for scene in Scene::ALL {
        let mut scenario = TestInput::from(scene.spheres(3000, 21));
        let made = |of: &(Subject, Skin)| Detector::new(of.0.config().skin(of.1)).expect("a detector");
        // On the GPU all sizes have the same skin, which gives too many candidates for the smallest of ten sizes.
        let has_few_sizes = matches!(scene, Scene::Equal | Scene::FiveSizes);
        let serves =
            |way: &&(Subject, Skin)| has_few_sizes || way.0.backend == Backend::Cpu || way.1 != Skin::Auto;
        let mut detectors: Vec<_> = ways.iter().filter(serves).map(|way| (way, made(way), 0)).collect();
        for step in 0..12 {
            let expected = scenario.oracle();
            for ((subject, skin), detector, served) in &mut detectors {
                let found = detector.pairs(scenario.query()).expect("the scene is valid").to_vec();
                difference(&scenario, &found, &expected, subject.tolerance())
                    .unwrap_or_else(|text| panic!("{scene}, {subject}, {skin:?}, step {step}: {text}"));
                *served += u32::from(detector.report().candidates.is_some_and(|kept| kept.rebuilt.is_none()));
            }
            Scene::advance_by(0.01, &mut scenario.spheres, 21, step);
        }
        for ((subject, skin), _, served) in detectors {
            let enough = served > 5 || scene == Scene::Point;
            assert!(enough, "{scene}, {subject}, {skin:?}: {served} of 12 calls were served");
        }
    }
}
