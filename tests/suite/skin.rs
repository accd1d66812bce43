use lazygrid::{Algorithm, Backend, Detector, Order, Skin, Space};
use lazygrid_check::scenes::motion::{skin_of, walk};
use lazygrid_io::scenes::Scene;
use lazygrid_tests::{
    DetectorVariant, SuiteVariant, TestInput, difference, hard, in_pool, periodic, variants,
};
use proptest::prelude::*;
use proptest::sample::select;

use crate::properties::check;

fn variants_with_candidates() -> Vec<DetectorVariant> {
    let mut variants = variants::all();
    variants.retain(|variant| variant.algorithm == Algorithm::CellList);
    variants
}

fn matches_oracle_while_moving(
    scenario: &TestInput,
    skin_in_radii: f32,
    moves: f32,
    variant: DetectorVariant,
) -> Result<(), String> {
    let mut scenario = scenario.clone();
    let skin = skin_of(&scenario.spheres, skin_in_radii);
    let order = if variant.threads() == 1 { Order::Unordered } else { Order::Canonical };
    let config = variant.settings().order(order).skin(skin);
    let config = scenario.config(config).map_err(|error| error.to_string())?;
    in_pool(variant.threads(), || {
        let mut detector = Detector::new(config).map_err(|error| error.to_string())?;
        for step in 0..6 {
            let expected = match scenario.space.is_periodic() {
                true => scenario.rounding_oracle(),
                false => scenario.oracle(),
            };
            let found = detector.pairs(scenario.query()).map_err(|error| error.to_string())?.to_vec();
            let why = detector.report().reason;
            difference(&scenario, &found, &expected, variant.tolerance()).map_err(|text| {
                format!("{variant}, {skin:?}, moves of {moves}, step {step}, {why}: {text}")
            })?;
            walk(&mut scenario.spheres, if step == 4 { 40.0 * moves } else { moves }, step);
        }
        Ok(())
    })
}

fn skins_in_radii() -> impl Strategy<Value = f32> {
    select(vec![0.0, 1e-6, 0.01, 0.3, 2.0, 1e3])
}

fn moves() -> impl Strategy<Value = f32> {
    select(vec![0.0, 1e-7, 1e-3, 0.03, 0.5])
}

#[test]
fn arbitrary_spheres() {
    let scenarios = prop_oneof![
        2 => hard::any_spheres().prop_map(TestInput::from),
        1 => hard::mixture(hard::any_spheres()),
    ];
    let cases = (scenarios, skins_in_radii(), moves(), select(variants_with_candidates()));
    check(200, cases, |(scenario, skin_in_radii, moves, variant)| {
        matches_oracle_while_moving(&scenario, skin_in_radii, moves, variant)
    });
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
    let cases = (scenarios, skins_in_radii(), moves(), select(variants_with_candidates()));
    check(200, cases, |(scenario, skin_in_radii, moves, variant)| {
        matches_oracle_while_moving(&scenario, skin_in_radii, moves, variant)
    });
}

#[test]
fn running_simulations() {
    let both = |variant: DetectorVariant| [(variant, Skin::Auto), (variant, Skin::Fixed(0.4))];
    let settings: Vec<_> = variants_with_candidates().into_iter().flat_map(both).collect();
    for scene in Scene::ALL {
        let mut scenario = TestInput::from(scene.spheres(3000, 21));
        let made = |(variant, skin): &(DetectorVariant, Skin)| {
            Detector::new(variant.settings().skin(*skin)).expect("a detector")
        };
        let has_few_sizes = matches!(scene, Scene::Equal | Scene::FiveSizes);
        let serves = |(variant, skin): &&(DetectorVariant, Skin)| {
            has_few_sizes || variant.backend() == Backend::Cpu || *skin != Skin::Auto
        };
        let mut detectors: Vec<_> =
            settings.iter().filter(serves).map(|setting| (setting, made(setting), 0)).collect();
        for step in 0..12 {
            let expected = scenario.oracle();
            for ((variant, skin), detector, served) in &mut detectors {
                let found = detector.pairs(scenario.query()).expect("the scene is valid").to_vec();
                difference(&scenario, &found, &expected, variant.tolerance())
                    .unwrap_or_else(|text| panic!("{scene}, {variant}, {skin:?}, step {step}: {text}"));
                *served +=
                    u32::from(detector.report().candidates.is_some_and(|stats| stats.rebuilt.is_none()));
            }
            Scene::advance_by(0.01, &mut scenario.spheres, 21, step);
        }
        let is_hardware = lazygrid_tests::device().is_some_and(|gpu| gpu.adapter.is_hardware);
        for ((variant, skin), _, served) in detectors {
            // On a fast GPU, a list of few spheres costs more than it saves.
            let may_decline = is_hardware && variant.backend() == Backend::Gpu && *skin == Skin::Auto;
            let enough = served > 5 || scene == Scene::Point || may_decline;
            assert!(enough, "{scene}, {variant}, {skin:?}: {served} of 12 calls were served");
        }
    }
}

#[test]
fn skin_out_of_range_is_refused_alike_everywhere() {
    let vectors = [[9.0, 0.0, 0.0], [4.0, 8.0, 0.0], [1.0, 2.0, 7.0]];
    let triclinic = Space::triclinic(vectors.map(Some)).expect("a cell");
    for variant in variants_with_candidates() {
        for space in [Space::UNBOUNDED, triclinic] {
            for skin in [2.75e-15, 3.5e17, f64::MIN_POSITIVE] {
                let config = variant.settings().space(space).skin(Skin::Fixed(skin));
                let refused = Detector::new(config).expect_err("a skin out of range").to_string();
                assert!(refused.contains(&skin.to_string()), "{variant}: {refused}");
            }
            // Both ends of the range are allowed, in every space.
            for skin in [1e-14, 1e17] {
                let config = variant.settings().space(space).skin(Skin::Fixed(skin));
                assert!(Detector::new(config).is_ok(), "{variant}, {skin}");
            }
        }
    }
}

#[test]
fn fixed_skin_is_refused_by_algorithms_without_candidates() {
    for variant in variants::each_algorithm() {
        let refused = Detector::new(variant.settings().skin(Skin::Fixed(0.5))).map(drop);
        if matches!(variant.algorithm, Algorithm::Auto | Algorithm::CellList) {
            assert_eq!(refused, Ok(()), "{variant}");
        } else {
            let refused = refused.expect_err("no candidates").to_string();
            assert!(
                refused.starts_with("skin = 0.5") && refused.contains("cell-list"),
                "{variant}: {refused}"
            );
        }
        assert!(Detector::new(variant.settings().skin(Skin::Auto)).is_ok(), "{variant}");
    }
}
