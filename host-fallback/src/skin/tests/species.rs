use lazygrid_kernels::{Interaction, Interactions, Space, Sphere, Spheres};

use super::gas;
use crate::test_support::{Random, is_served, new_detector};
use crate::{Settings, Skin};

fn table() -> Interactions {
    let mut table = Interactions::new(2, Interaction::Never).expect("few species");
    table.set(0, 1, Interaction::Touch).expect("known species");
    table
}

fn follow(
    (spheres, space): (&mut [Sphere], Space),
    calls: std::ops::Range<u32>,
    step: impl Fn(u32, u32, &mut Random) -> [f32; 3],
) -> usize {
    let ids: Vec<u32> = (0..spheres.len() as u32).map(|k| k % 2).collect();
    let settings = Settings { interactions: Some(table()), space, threads: Some(1), ..Settings::default() };
    let mut off = new_detector(Settings { skin: Skin::Off, ..settings.clone() });
    let mut detector = new_detector(Settings { skin: Skin::Auto, ..settings });
    let (mut random, mut served) = (Random(5), 0);
    for call in calls {
        let spheres_with_ids = Spheres::from(&*spheres).with_species(&ids).expect("one id for each");
        let expected = off.pairs(spheres_with_ids).expect("valid").to_vec();
        assert_eq!(detector.pairs(spheres_with_ids).expect("valid"), expected, "call {call}");
        served += usize::from(is_served(&detector));
        for (sphere, &species) in spheres.iter_mut().zip(&ids) {
            sphere.center += glam::Vec3::from(step(call, species, &mut random));
        }
    }
    served
}

#[test]
fn resting_species_that_begins_to_move_loses_no_pair() {
    let mut spheres = gas(4000, 1, 40.0);
    let step = |call, species, random: &mut Random| match (call, species) {
        (..6, 0) => [0.0; 3],
        (..6, _) => random.point(0.05),
        (_, 0) => [0.2, 0.0, 0.0],
        _ => [-0.2, 0.0, 0.0],
    };
    let served = follow((&mut spheres, Space::UNBOUNDED), 0..12, step);
    assert!(served > 2, "{served} served");
}

#[test]
fn nearly_resting_spheres_of_a_long_box_do_not_prevent_a_list() {
    let space = Space::periodic([Some(4000.0), None, None]).expect("a box");
    let mut spheres = gas(4000, 1, 40.0);
    let served = follow((&mut spheres, space), 0..30, |_, species, random| {
        random.point([1e-5, 0.02][species as usize])
    });
    assert!(served > 15, "{served} served");
}

#[test]
fn species_that_appear_while_candidates_are_kept_lose_no_pair() {
    let mut table = Interactions::new(3, Interaction::Never).expect("few species");
    for (a, b, distance) in [(0, 0, 0.5), (0, 1, 4.0), (1, 2, 1.0), (2, 2, 0.25)] {
        table.set(a, b, Interaction::Within(distance)).expect("known species");
    }
    let spheres = gas(1500, 1, 24.0);
    let rows: Vec<[f64; 4]> =
        spheres.iter().map(|sphere| sphere.center.as_dvec3().extend(0.5).to_array()).collect();
    let bad = [Sphere::new([f32::NAN; 3], 0.5); 1500];
    let calls =
        [(0, 0), (0, 0), (1, 0), (1, 0), (0, 0), (2, 1), (0, 0), (0, 0), (1, 0), (2, 0), (2, 0), (1, 0)];
    for skin in [Skin::Auto, Skin::Fixed(0.5)] {
        let settings = Settings { interactions: Some(table.clone()), skin, ..Settings::default() };
        let mut detector = new_detector(settings.clone());
        let mut off = new_detector(Settings { skin: Skin::Off, ..settings });
        let mut served = 0;
        for (call, (last, others)) in calls.into_iter().cycle().take(4 * calls.len()).enumerate() {
            let ids: Vec<u32> = (0..1500).map(|k| if k < 1490 { others } else { last }).collect();
            if call % 5 == 3 {
                let ids = vec![1; 1500];
                assert!(
                    detector.count(Spheres::from(&bad).with_species(&ids).expect("an id for each")).is_err()
                );
            }
            let spheres = match call / calls.len() % 2 {
                0 => Spheres::from(&spheres),
                _ => Spheres::from(&rows),
            };
            let spheres_with_ids = spheres.with_species(&ids).expect("an id for each");
            let expected = off.pairs(spheres_with_ids).expect("valid").to_vec();
            assert_eq!(detector.pairs(spheres_with_ids).expect("valid"), expected, "{skin:?}, call {call}");
            served += usize::from(is_served(&detector));
        }
        assert!(served > 4, "{skin:?}: {served} served");
    }
}
