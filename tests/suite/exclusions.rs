use lazygrid::gpu::{GpuConfig, GpuSession};
use lazygrid::{
    Algorithm, Backend, Config, Detector, Error, Exclusions, InputError, Order, Pair, Query, Space, Sphere,
    Spheres,
};
use lazygrid_check::scenes::motion::{skin_of, walk};
use lazygrid_check::{EXCLUSION_WORDS, ExclusionCase};
use lazygrid_io::scenes::Scene;
use lazygrid_tests::results::{listed, streamed};
use lazygrid_tests::{
    DetectorVariant, SuiteVariant, TestInput, difference, hard, in_pool, periodic, triclinic, variants,
};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

use crate::properties::check;
use crate::two_sets;

fn cases() -> impl Strategy<Value = TestInput> {
    let scenarios = prop_oneof![
        2 => hard::any_spheres().prop_map(TestInput::from),
        1 => hard::mixture(hard::any_spheres()),
        1 => periodic::lattice(),
        1 => periodic::soup(),
        1 => periodic::mixture(),
        1 => triclinic::soup(),
        1 => triclinic::mixture(),
    ];
    let words =
        vec(any::<u32>(), EXCLUSION_WORDS).prop_map(|words| words.try_into().expect("EXCLUSION_WORDS words"));
    (scenarios, words).prop_map(|(scenario, words)| scenario.with_exclusions(&words))
}

fn same(
    variant: DetectorVariant,
    scenario: &TestInput,
    found: &[Pair],
    expected: &[Pair],
) -> Result<(), String> {
    difference(scenario, found, expected, variant.tolerance()).map_err(|text| format!("{variant}: {text}"))
}

#[test]
fn groups_and_lists_on_any_spheres() {
    check(150, cases(), |scenario| {
        let (expected, query) = (scenario.oracle(), scenario.query());
        variants::for_scenario(&scenario).into_iter().try_for_each(|variant| {
            let config = scenario.config(variant.settings()).map_err(|error| error.to_string())?;
            variant.run(|| {
                let mut detector = Detector::new(config).map_err(|error| error.to_string())?;
                let found = detector.pairs(query).map_err(|error| error.to_string())?.to_vec();
                same(variant, &scenario, &found, &expected)?;
                let count = detector.count(query).map_err(|error| error.to_string())?;
                if count == found.len() as u64 {
                    Ok(())
                } else {
                    Err(format!("{variant}: {count} are counted"))
                }
            })
        })
    });
}

#[test]
fn all_kinds_of_results_agree() {
    let scenario = TestInput::from(Scene::FiveSizes.spheres(2000, 3));
    let groups = (0..2000).map(|k| if k % 3 == 0 { Spheres::NO_GROUP } else { k % 11 }).collect();
    let pairs: Vec<_> = scenario.oracle().iter().step_by(3).map(|pair| (pair.j, pair.i)).collect();
    let all = scenario.oracle().len();
    let without = scenario.query();
    let excluded = Some(ExclusionCase::new(2000, pairs).expect("of spheres"));
    let with = TestInput { groups: Some(groups), excluded, ..scenario.clone() };
    let (expected, query) = (with.oracle(), with.query());
    assert!(expected.len() > 30 && expected.len() < all / 2 + all / 4, "{} of {all}", expected.len());
    let most = expected.len() as u64;
    for variant in variants::each_algorithm() {
        // Excluded pairs do not count toward the limit.
        let mut detector = Detector::new(variant.settings().max_pairs(most)).expect("made");
        let found = detector.pairs(query).expect("as many as fit").to_vec();
        same(variant, &with, &found, &expected).unwrap_or_else(|text| panic!("{text}"));
        assert_eq!(found.len() as u64, most, "{variant}");
        let mut limited = Detector::new(variant.settings().max_pairs(most - 1)).expect("made");
        let error = limited.pairs(query).expect_err("one too many");
        assert_eq!(error, Error::TooManyPairs { found: most, limit: most - 1 }, "{variant}");
        for (order, limit) in [(Order::Canonical, 1 << 20), (Order::Canonical, 7), (Order::Unordered, 7)] {
            let mut detector = Detector::new(variant.settings().order(order).max_pairs(limit)).expect("made");
            let mut stream = streamed(&mut detector, query, 5).expect("a stream");
            if order == Order::Unordered {
                stream.sort_unstable();
            }
            assert!(stream == found, "{variant}: the stream differs");
        }
        assert!(listed(&mut detector, query).expect("neighbors") == found, "{variant}");
        assert_eq!(detector.count(without), Ok(all as u64), "{variant}");
    }
}

#[test]
fn pairs_across_two_sets() {
    let with = (cases(), 0.0..=1.0_f32, select(variants::all()));
    check(150, with, |(scenario, fraction, variant)| {
        two_sets::agrees(&scenario, two_sets::split_at(&scenario, fraction), variant)
    });
}

#[test]
fn candidate_lists_never_change_a_result() {
    let mut variants = variants::all();
    variants.retain(|variant| variant.algorithm == Algorithm::CellList);
    let moves = select(vec![0.0, 1e-3, 0.3]);
    check(90, (cases(), moves, select(variants)), |(mut scenario, moves, variant)| {
        let config = variant.settings().skin(skin_of(&scenario.spheres, 0.3));
        let config = scenario.config(config).map_err(|error| error.to_string())?;
        in_pool(variant.threads(), || {
            let mut detector = Detector::new(config).map_err(|error| error.to_string())?;
            for step in 0..4 {
                let found = detector.pairs(scenario.query()).map_err(|error| error.to_string())?.to_vec();
                same(variant, &scenario, &found, &scenario.oracle())?;
                walk(&mut scenario.spheres, moves, step);
                if let Some(groups) = &mut scenario.groups {
                    let one = groups.len().min(1);
                    groups.rotate_left(one);
                }
            }
            Ok(())
        })
    });
}

#[test]
fn exclusions_of_wrong_size_are_refused() {
    let spheres = [Sphere::new([0.0; 3], 1.0); 4];
    let view = Spheres::from(&spheres);
    let error = view.with_groups(&[1, 2]).expect_err("too few");
    assert_eq!(error, InputError::Lengths { what: "groups", length: 2, expected: 4 });
    let of_three = Exclusions::new(3, [(0, 1)]).expect("of three");
    let of_four = Exclusions::new(4, [(0, 1)]).expect("of four");
    let across = Exclusions::across(4, 4, [(0, 1)]).expect("of both");
    let among = Query::new(view);
    let both = Query::new((view, view));
    for variant in variants::each_algorithm() {
        let mut detector = Detector::new(variant.settings()).expect("a detector");
        assert_eq!(detector.count(among.without(&of_four)), Ok(5), "{variant}");
        let error = detector.count(among.without(&of_three)).expect_err("made for three");
        assert!(matches!(error, Error::Input(InputError::ExclusionSizeMismatch { .. })), "{error}");
        let error = detector.count(among.without(&across)).expect_err("made for two sets");
        assert!(error.to_string().contains("sets of 4 and 4 spheres, but the call has 4 spheres"), "{error}");
        assert_eq!(detector.count(both.without(&across)), Ok(15), "{variant}");
        assert!(detector.count(both.without(&of_four)).is_err(), "{variant}");
    }
}

#[test]
fn sessions_refuse_groups_and_triclinic_cells() {
    let Some(device) = lazygrid_tests::device() else { return };
    let gpu = || device.clone();
    let spheres = [Sphere::new([0.0; 3], 1.0); 2];
    let mut session = GpuSession::new(gpu(), GpuConfig::default()).expect("a session");
    let grouped = Spheres::from(&spheres).with_groups(&[1, 1]).expect("two");
    let error = session.begin(grouped).expect_err("groups");
    assert!(error.to_string().contains("Detector"), "{error}");
    let space = Space::triclinic([Some([1.0, 1.0, 0.0]), None, None]).expect("a cell vector");
    let error = GpuSession::new(gpu(), GpuConfig::default().space(space)).expect_err("triclinic");
    assert!(error.to_string().contains("Detector"), "{error}");
    assert!(Detector::new(Config::default().backend(Backend::Cpu).space(space)).is_ok());
}
