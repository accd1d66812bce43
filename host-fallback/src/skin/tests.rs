mod frame;
mod species;
mod two_sets;

use lazygrid_kernels::{InputError, Interaction, Interactions, Pair, Radii, Space, Sphere, Spheres};

use crate::test_support::{Random, is_served, new_detector};
use crate::{Error, HostDetector, Order, RebuildReason, Settings, Skin};

fn gas(n: usize, sizes: i32, side: f32) -> Vec<Sphere> {
    let mut random = Random(11);
    (0..n).map(|k| Sphere::new(random.point(side / 2.0), 0.5_f32.powi(k as i32 % sizes))).collect()
}

fn step(spheres: &mut [Sphere], fraction: f32, random: &mut Random) {
    for sphere in spheres {
        sphere.center += glam::Vec3::from(random.point(fraction * sphere.radius));
    }
}

fn species(n: usize) -> Vec<u32> {
    (0..n as u32).map(|k| k % 3).collect()
}

fn table() -> Interactions {
    let mut table = Interactions::new(3, Interaction::Touch).expect("few species");
    table.set(0, 0, Interaction::Never).expect("known species");
    table.set(0, 1, Interaction::Within(1.7)).expect("known species");
    table
}

fn settings(skin: Skin) -> Vec<Settings> {
    let plain = || Settings { skin, ..Settings::default() };
    let space = Space::periodic([Some(24.0), None, Some(25.0)]).expect("a box");
    vec![
        plain(),
        Settings { interactions: Some(table()), threads: Some(3), ..plain() },
        Settings { space, threads: Some(1), ..plain() },
        Settings { space, interactions: Some(table()), ..plain() },
    ]
}

fn pairs(detector: &mut HostDetector, spheres: &[Sphere]) -> Vec<Pair> {
    let ids = species(spheres.len());
    let spheres = Spheres::from(spheres).with_species(&ids).expect("one id for each");
    detector.pairs(spheres).expect("the spheres are valid").to_vec()
}

#[test]
fn candidates_never_change_an_answer() {
    for skin in [Skin::Auto, Skin::Fixed(0.3), Skin::Fixed(2.0)] {
        for (k, settings) in settings(skin).into_iter().enumerate() {
            let mut off = new_detector(Settings { skin: Skin::Off, ..settings.clone() });
            let mut detector = new_detector(settings);
            let (mut spheres, mut random) = (gas(4000, 3, 24.0), Random(5));
            let (mut served, mut moved) = (0, 0);
            for call in 0..40 {
                let expected = pairs(&mut off, &spheres);
                assert_eq!(pairs(&mut detector, &spheres), expected, "{skin:?}, settings {k}, call {call}");
                let report = detector.report().candidates;
                served += usize::from(report.is_some_and(|stats| stats.rebuilt.is_none()));
                moved += usize::from(
                    report.is_some_and(|stats| stats.rebuilt == Some(RebuildReason::Displacement)),
                );
                assert!(report.is_none_or(|stats| stats.count >= expected.len() as u64));
                step(&mut spheres, if call < 30 { 0.05 } else { 0.2 }, &mut random);
            }
            assert!(served > 10 && moved > 1, "{skin:?}, settings {k}: {served} served, {moved} moved");
        }
    }
}

#[test]
fn all_results_come_from_candidates() {
    let settings = Settings { skin: Skin::Fixed(0.5), max_pairs: 300, ..Settings::default() };
    let mut detector = new_detector(settings);
    let mut off = new_detector(Settings { skin: Skin::Off, ..Settings::default() });
    let (mut spheres, mut random) = (gas(2000, 2, 16.0), Random(5));
    for _ in 0..4 {
        let all = off.pairs(&spheres).expect("the spheres are valid").to_vec();
        assert!(all.len() > 600, "streams take several searches");
        assert_eq!(detector.count(&spheres).expect("valid"), all.len() as u64);
        assert!(matches!(detector.pairs(&spheres), Err(Error::TooManyPairs { .. })));
        let mut streamed = Vec::new();
        let mut consume = |pairs: &[Pair]| {
            streamed.extend_from_slice(pairs);
            std::ops::ControlFlow::Continue(())
        };
        detector.stream(&spheres, 77, &mut consume).expect("valid");
        assert_eq!(streamed, all);
        step(&mut spheres, 0.02, &mut random);
    }
}

#[test]
fn changed_spheres_rebuild_the_list() {
    let settings = Settings { skin: Skin::Fixed(1.0), order: Order::Unordered, ..Settings::default() };
    let mut detector = new_detector(settings);
    let mut off = new_detector(Settings { skin: Skin::Off, ..Settings::default() });
    let mut spheres = gas(3000, 2, 20.0);
    let mut check = |spheres: &[Sphere], why: Option<RebuildReason>| {
        let found = detector.count(spheres).expect("valid");
        assert_eq!(found, off.count(spheres).expect("valid"));
        assert_eq!(detector.report().candidates.expect("there is a skin").rebuilt, why);
    };
    check(&spheres, Some(RebuildReason::NoList));
    check(&spheres, None);
    spheres[17].radius *= 1.5;
    check(&spheres, Some(RebuildReason::InputChanged));
    spheres.push(spheres[5]);
    check(&spheres, Some(RebuildReason::InputChanged));
    spheres[2999].center.y += 0.49;
    check(&spheres, None);
    spheres[2999].center.y += 0.02;
    check(&spheres, Some(RebuildReason::Displacement));
}

#[test]
fn bad_spheres_are_refused_and_forgotten() {
    let mut detector = new_detector(Settings { skin: Skin::Fixed(1.0), ..Settings::default() });
    let spheres = gas(3000, 2, 20.0);
    let expected = detector.count(&spheres).expect("valid");
    for bad in [
        Sphere::new([f32::NAN, 0.0, 0.0], 1.0),
        Sphere::new([0.0; 3], -1.0),
        Sphere::new([f32::MAX; 3], f32::NAN),
    ] {
        let mut wrong = spheres.clone();
        wrong[1234] = bad;
        assert!(matches!(detector.count(&wrong), Err(Error::Input(_))), "{bad:?}");
        assert_eq!(detector.count(&spheres).expect("valid"), expected);
    }
}

#[test]
fn skins_out_of_range_are_refused() {
    for distance in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-20, 1e20] {
        let settings = Settings { skin: Skin::Fixed(distance), ..Settings::default() };
        assert!(
            matches!(HostDetector::new(settings), Err(Error::InvalidSetting { name: "skin", .. })),
            "{distance}"
        );
    }
    let algorithm = lazygrid_kernels::Algorithm::HashGrid;
    let settings = Settings { skin: Skin::Fixed(1.0), algorithm, ..Settings::default() };
    assert!(matches!(HostDetector::new(settings), Err(Error::InvalidSetting { name: "skin", .. })));
}

#[test]
fn without_a_list_every_call_searches() {
    let settings =
        |distance| Settings { skin: Skin::Fixed(distance), max_pairs: 100_000, ..Settings::default() };
    let spheres = gas(3000, 2, 60.0);
    let expected =
        new_detector(Settings { skin: Skin::Off, ..Settings::default() }).count(&spheres).expect("valid");
    let mut detector = new_detector(settings(1e4));
    for _ in 0..2 {
        assert_eq!(detector.count(&spheres).expect("valid"), expected);
        assert_eq!(detector.report().candidates, None);
    }
}

#[test]
fn head_on_spheres_are_found_when_they_touch() {
    for skin in [Skin::Fixed(0.5), Skin::Auto] {
        let spheres_at = |k: usize, by: f32| {
            let gap = 1.5 * k as f32 / 1000.0;
            let [x, y] = [4.0 * (k % 40) as f32, 4.0 * (k / 40) as f32];
            let half = 0.25 + gap / 2.0 - by;
            [Sphere::new([x, y, -half], 0.25), Sphere::new([x, y, half], 0.25)]
        };
        let settings = Settings { skin, ..Settings::default() };
        let mut detector = new_detector(settings);
        let mut served = 0;
        for step in 0..60 {
            let by = step as f32 / 80.0;
            let spheres: Vec<_> = (0..1000).flat_map(|k| spheres_at(k, by)).collect();
            let expected = new_detector(Settings { skin: Skin::Off, ..Settings::default() }).count(&spheres);
            assert_eq!(detector.count(&spheres), expected, "{skin:?}, step {step}");
            served += usize::from(is_served(&detector));
        }
        assert!((20..60).contains(&served), "{skin:?}: {served} of 60 calls were served");
    }
}

/// Candidates that expire in a call that compares all pairs must not serve the next call.
#[test]
fn radii_that_change_while_candidates_are_kept_lose_no_pair() {
    let at = |k: usize| [k % 10, k / 10 % 10, k / 100].map(|c| c as f32);
    let frame = |call: usize| -> Vec<Sphere> {
        let radius = |k: usize| if call < 6 { 0.1 } else { 1.2 * 0.5_f32.powi(k as i32 % 4) };
        (0..500).map(|k| Sphere::new(at(k), radius(k))).collect()
    };
    for skin in [Skin::Auto, Skin::Fixed(0.2)] {
        let settings = |skin| Settings { skin, ..Settings::default() };
        let mut detector = new_detector(settings(skin));
        let mut off = new_detector(settings(Skin::Off));
        for call in 0..9 {
            let spheres = frame(call);
            let expected = off.count(&spheres);
            assert_eq!(expected, Ok(if call < 6 { 0 } else { 2193 }));
            assert_eq!(detector.count(&spheres), expected, "{skin:?}, call {call}");
        }
    }
}

#[test]
fn refused_call_discards_expired_candidates() {
    let mut detector = new_detector(Settings { skin: Skin::Fixed(0.5), ..Settings::default() });
    let at = |k: usize| [k % 10, k / 10 % 10, k / 100].map(|c| c as f32);
    let lattice = |radius: f32| (0..1000).map(|k| Sphere::new(at(k), radius)).collect::<Vec<_>>();
    let (small, large) = (lattice(0.1), lattice(0.5));
    for _ in 0..2 {
        assert_eq!(detector.count(&small), Ok(0));
    }
    let mut wrong = large.clone();
    wrong[500].center.x = f32::NAN;
    assert!(matches!(detector.count(&wrong), Err(Error::Input(_))));
    assert_eq!(detector.count(&large), Ok(2700));
}

#[test]
fn radii_without_effect_are_checked_while_candidates_serve() {
    let table = Interactions::new(1, Interaction::Within(1.0)).expect("one species");
    let tilted = Space::triclinic([Some([40.0, 0.0, 0.0]), Some([9.0, 40.0, 0.0]), None]).expect("a space");
    for space in [Space::UNBOUNDED, Space::periodic([Some(40.0); 3]).expect("a box"), tilted] {
        let interactions = Some(table.clone());
        let settings = Settings { skin: Skin::Fixed(0.5), interactions, space, ..Settings::default() };
        let mut detector = new_detector(settings);
        let (spheres, ids) = (gas(2000, 1, 20.0), vec![0; 2000]);
        let mut count = |spheres: &[Sphere]| {
            let spheres_with_ids = Spheres::from(spheres).with_species(&ids).expect("one id for each");
            (detector.count(spheres_with_ids), detector.report().candidates.map(|stats| stats.rebuilt))
        };
        let (expected, _) = count(&spheres);
        for bad in [-5.0, f32::NAN, f32::NEG_INFINITY, f32::INFINITY] {
            assert_eq!(count(&spheres).0, expected);
            assert_eq!(count(&spheres), (expected.clone(), Some(None)), "candidates serve");
            let mut wrong = spheres.clone();
            wrong[1999].radius = bad;
            let refused = count(&wrong).0;
            assert!(
                matches!(refused, Err(Error::Input(InputError::Sphere { index: 1999, count: 1, .. }))),
                "{bad}: {refused:?}"
            );
        }
    }
}

#[test]
fn too_many_candidates_cost_no_memory_and_no_error() {
    let spheres = vec![Sphere::new([0.0; 3], 1.0); 5000];
    let settings = Settings { skin: Skin::Fixed(0.003), threads: Some(1), ..Settings::default() };
    let mut detector = new_detector(settings);
    for _ in 0..3 {
        assert_eq!(detector.count(&spheres), Ok(5000 * 4999 / 2));
        assert_eq!(detector.report().candidates, None);
    }
}

fn wide(spheres: &[Sphere]) -> Vec<[f64; 4]> {
    let widened = |sphere: &Sphere| {
        let row: [f32; 4] = bytemuck::cast(*sphere);
        row.map(|number| f64::from(number) + 1e-11)
    };
    spheres.iter().map(widened).collect()
}

#[test]
fn candidates_of_f64_spheres_are_tested_without_a_copy() {
    let lengths = Space::periodic([Some(24.1), None, Some(25.3)]).expect("a box");
    let cell = Space::triclinic([Some([24.0, 0.0, 0.0]), Some([9.0, 25.0, 0.0]), None]).expect("a cell");
    for (space, shift) in [(Space::UNBOUNDED, 0.0), (lengths, 7.0 * 24.1), (cell, 24.0)] {
        for interactions in [None, Some(table())] {
            let settings = Settings { space, interactions, skin: Skin::Fixed(0.4), ..Settings::default() };
            let mut off = new_detector(Settings { skin: Skin::Off, ..settings.clone() });
            let mut detector = new_detector(settings);
            let (mut spheres, mut random, mut served) = (gas(3000, 3, 24.0), Random(5), 0);
            let ids = species(spheres.len());
            for call in 0..24 {
                let mut rows = wide(&spheres);
                rows.iter_mut().step_by(5).for_each(|row| row[0] += shift);
                let centers: Vec<_> = rows.iter().map(|&[x, y, z, _]| [x, y, z]).collect();
                let radii: Vec<_> = rows.iter().map(|row| row[3]).collect();
                let set = match call % 2 {
                    0 => Spheres::from(&rows),
                    _ => Spheres::points(&centers, Radii::Each(&radii)).expect("one radius each"),
                };
                let spheres_with_ids = set.with_species(&ids).expect("one id for each");
                let expected = off.pairs(spheres_with_ids).expect("valid");
                assert_eq!(
                    detector.pairs(spheres_with_ids).expect("valid"),
                    expected,
                    "{space:?}, call {call}"
                );
                if is_served(&detector) {
                    served += 1;
                    assert!(detector.report().phases.iter().all(|phase| phase.name != "copy"));
                }
                step(&mut spheres, 0.05, &mut random);
            }
            assert!((8..24).contains(&served), "{space:?}: {served} served");
        }
    }
}

/// A distance to a third species hides that radii grow until the first two species touch.
#[test]
fn radii_that_grow_below_effective_ones_lose_no_pair() {
    let mut table = Interactions::new(4, Interaction::Never).expect("few species");
    for (a, b, interaction) in
        [(0, 1, Interaction::Touch), (0, 2, Interaction::Within(10.0)), (1, 3, Interaction::Within(10.0))]
    {
        table.set(a, b, interaction).expect("known species");
    }
    let mut random = Random(3);
    let centers: Vec<_> = (0..20_202).map(|_| random.point(50.0)).collect();
    let ids: Vec<u32> = (0..20_202)
        .map(|k| [0, 1, 2, 3][[20_000, 20_200, 20_201].partition_point(|&end| end <= k)])
        .collect();
    let count = |skin| {
        let settings = Settings { skin, interactions: Some(table.clone()), ..Settings::default() };
        let mut detector = new_detector(settings);
        [0.1, 4.9].map(|radius| {
            let spheres: Vec<_> = centers.iter().map(|&center| Sphere::new(center, radius)).collect();
            let spheres = Spheres::from(&spheres).with_species(&ids).expect("one id for each");
            detector.count(spheres).expect("the spheres are valid")
        })
    };
    let expected = count(Skin::Off);
    assert!(expected[1] > 10_000);
    assert_eq!(count(Skin::Fixed(0.1)), expected);
}
