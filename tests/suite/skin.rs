//! Candidates that are kept from call to call never show in a result.

use lazygrid::{Algorithm, Backend, Config, Detector, Order, Skin, Sphere};
use lazygrid_io::scenes::Scene;
use lazygrid_tests::{Scenario, Tolerance, adversary, difference, in_pool, periodic};
use proptest::prelude::*;
use proptest::sample::select;

use crate::properties::check;

/// A skin in proportion to the scene: this part of some sphere's radius, or of the distance of two neighbours in the
/// list where it has none.
fn skin_of(spheres: &[Sphere], part: f32) -> Skin {
    let radius = spheres.iter().map(|sphere| sphere.radius).find(|&radius| radius > 0.0);
    let apart = |two: &[Sphere]| two[0].center.distance(two[1].center);
    let distance = spheres.windows(2).map(apart).find(|&distance| distance > 0.0);
    match part * radius.or(distance).unwrap_or(1.0) {
        0.0 => Skin::Auto,
        distance => Skin::Fixed(distance.clamp(1e-14, 1e17)),
    }
}

/// Moves the spheres by about this part of the largest of their radii, or of 1 where they have none.
fn walk(spheres: &mut [Sphere], part: f32, step: u32) {
    let radius = spheres.iter().map(|sphere| sphere.radius).fold(0.0, f32::max);
    let far = part * if radius > 0.0 { radius.min(1e30) } else { 1.0 };
    for (sphere, k) in spheres.iter_mut().zip(0_u32..) {
        let word = k.wrapping_mul(0x9e37_79b9).wrapping_add(step.wrapping_mul(0x85eb_ca6b));
        let turn = |by: u32| f32::from((word.rotate_left(by) >> 16) as u16) / 32768.0 - 1.0;
        let moved = sphere.center + glam::Vec3::new(turn(0), turn(9), turn(21)) * far;
        sphere.center = if moved.is_finite() { moved } else { sphere.center };
    }
}

/// A walk of six calls: each has the pairs of the definition.
fn follows(scenario: &Scenario, part: f32, moves: f32, threads: usize) -> Result<(), String> {
    let mut scenario = scenario.clone();
    let skin = skin_of(&scenario.spheres, part);
    let order = if threads == 1 { Order::Unordered } else { Order::Canonical };
    let config =
        Config::default().backend(Backend::Cpu).algorithm(Algorithm::CellList).order(order).skin(skin);
    let config = scenario.config(config).map_err(|error| error.to_string())?;
    in_pool(threads, || {
        let mut detector = Detector::new(config).map_err(|error| error.to_string())?;
        for step in 0..6 {
            let expected = match scenario.space.is_periodic() {
                true => periodic::oracle(&scenario),
                false => scenario.oracle(),
            };
            let found = detector.pairs(scenario.view()).map_err(|error| error.to_string())?.to_vec();
            let why = detector.report().reason;
            difference(&scenario, &found, &expected, Tolerance::Exact)
                .map_err(|text| format!("{skin:?}, moves of {moves}, step {step}, {why}: {text}"))?;
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
        2 => adversary::any_spheres().prop_map(Scenario::from),
        1 => adversary::mixture(adversary::any_spheres()),
    ];
    let cases = (scenarios, parts(), moves(), select(vec![1, 2, 7]));
    check(400, cases, |(scenario, part, moves, threads)| follows(&scenario, part, moves, threads));
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
    let cases = (scenarios, parts(), moves(), select(vec![1, 2, 7]));
    check(200, cases, |(scenario, part, moves, threads)| follows(&scenario, part, moves, threads));
}

/// The motion of the benchmarks, in which candidates do serve.
#[test]
fn running_simulations() {
    for scene in Scene::ALL {
        for skin in [Skin::Auto, Skin::Fixed(0.4)] {
            let mut scenario = Scenario::from(scene.spheres(3000, 21));
            let config = Config::default().backend(Backend::Cpu).algorithm(Algorithm::CellList).skin(skin);
            let mut detector = Detector::new(config).expect("a detector");
            let mut served = 0;
            for step in 0..12 {
                let found = detector.pairs(scenario.view()).expect("the scene is valid").to_vec();
                assert_eq!(found, scenario.oracle(), "{scene}, {skin:?}, step {step}");
                served += u32::from(detector.report().candidates.is_some_and(|kept| kept.rebuilt.is_none()));
                Scene::advance_by(0.01, &mut scenario.spheres, 21, step);
            }
            assert!(
                served > 5 || scene == Scene::Point,
                "{scene}, {skin:?}: {served} of 12 calls were served"
            );
        }
    }
}
