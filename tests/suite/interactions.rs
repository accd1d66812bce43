use lazygrid::{Algorithm, Config, Detector, Interaction, Interactions, Space, Sphere, Spheres};
use lazygrid_tests::{SpeciesSetup, SuiteVariant, TestInput, difference, hard, variants};

use crate::doubles::Random;
use crate::properties::{check, one_of_each, settings};
use crate::two_sets;
use proptest::prelude::*;

fn agree(scenario: &TestInput, settings: &Config) -> Result<(), String> {
    let expected = scenario.oracle();
    let mut variants = variants::for_scenario(scenario).into_iter();
    variants.try_for_each(|variant| variant.verify(scenario, &expected, settings))
}

#[test]
fn random_tables_on_random_spheres() {
    check(80, (hard::mixture(hard::any_spheres()), settings()), |(scenario, settings)| {
        agree(&scenario, &settings)
    });
}

#[test]
fn random_tables_in_crowded_boxes() {
    check(96, (hard::mixture(hard::soup()), settings()), |(scenario, settings)| agree(&scenario, &settings));
}

/// Five pairs of species are up to eight sides of a cell list on a GPU.
#[test]
fn disjoint_pairs_of_species() {
    let spheres = prop_oneof![hard::powers_of_two(), hard::soup(), hard::any_spheres()];
    let ids = prop::collection::vec(any::<u32>(), 601);
    let strategy = (spheres, ids, 2_usize..6, any::<bool>());
    let strategy = strategy.prop_map(|(spheres, ids, pairs, meets_itself)| {
        let between = |a: usize, b: usize| match a ^ b {
            0 if a == 2 && meets_itself => Interaction::Touch,
            1 => Interaction::Touch,
            _ => Interaction::Never,
        };
        let rows = (0..2 * pairs).map(|a| (0..=a).map(|b| between(a, b)).collect()).collect();
        let species = ids[..spheres.len()].iter().map(|id| id % (2 * pairs as u32)).collect();
        TestInput { spheres, mixture: Some(SpeciesSetup { species, rows }), ..TestInput::default() }
    });
    check(96, (strategy, settings()), |(scenario, settings)| agree(&scenario, &settings));
}

fn largest_radius(spheres: &[Sphere]) -> f64 {
    let radii = spheres.iter().map(|sphere| sphere.radius).filter(|radius| radius.is_finite());
    radii.fold(0.0, f32::max).clamp(0.0, 1e30).into()
}

/// Species share groups if the sets of partners outnumber them.
#[test]
fn sparse_tables_of_many_species() {
    let spheres = prop_oneof![hard::powers_of_two(), hard::soup(), hard::any_spheres()];
    let (ids, entries) = (prop::collection::vec(any::<u32>(), 601), prop::collection::vec(0_u32..12, 210));
    let strategy = (spheres, ids, entries, 9_usize..=20, 0.1_f64..4.0);
    let strategy = strategy.prop_map(|(spheres, ids, entries, species, scale)| {
        let size = scale * largest_radius(&spheres);
        let with = |entry: u32| match entry {
            0 => Interaction::Touch,
            1 => Interaction::Within(size),
            2 => Interaction::Within(0.125 * size),
            _ => Interaction::Never,
        };
        let row = |a: usize| (0..=a).map(|b| with(entries[a * (a + 1) / 2 + b])).collect();
        let rows = (0..species).map(row).collect();
        let species = ids[..spheres.len()].iter().map(|id| id % species as u32).collect();
        TestInput { spheres, mixture: Some(SpeciesSetup { species, rows }), ..TestInput::default() }
    });
    check(96, (strategy, settings()), |(scenario, settings)| agree(&scenario, &settings));
}

#[test]
fn small_radii_with_large_distances() {
    // Distances near the spacings of the lattice that are not representable in `f32`.
    let off = prop::sample::select(vec![1.0, 1.0 - 1e-9, 1.0 + 1e-9]);
    let strategy = (hard::lattice(), 0.0_f32..4.0, off, 1_usize..40);
    let strategy = strategy.prop_map(|(spheres, spacings, off, period)| {
        let n = spheres.len();
        let spacing = spheres.iter().map(|s| s.radius).fold(0.0, f32::max);
        let spheres = spheres.into_iter().map(|s| lazygrid::Sphere::new(s.center, s.radius * 1e-6)).collect();
        let rows = vec![
            vec![Interaction::Never],
            vec![Interaction::Within(off * f64::from(spacings * spacing)), Interaction::Touch],
        ];
        let species = (0..n).map(|k| u32::from(k % period == 0)).collect();
        TestInput { spheres, mixture: Some(SpeciesSetup { species, rows }), ..TestInput::default() }
    });
    check(96, (strategy, settings()), |(scenario, settings)| agree(&scenario, &settings));
}

#[test]
fn cluster_with_distant_partners() {
    let mut random = Random(11);
    let mut center = |width: f32| [8.4, 1.5, 8.9].map(|at| at + random.signed() as f32 * width);
    let species: Vec<u32> = (0..2300).map(|k| [0, 0, 0, 0, 0, 0, 2, 1][k % 8]).collect();
    let spheres: Vec<_> =
        species.iter().map(|&id| Sphere::new(center([0.25, 4.0, 0.25][id as usize]), 0.004)).collect();
    let row = |sphere: &Sphere| [sphere.center.x, sphere.center.y, sphere.center.z, sphere.radius];
    let in_f64: Vec<[f64; 4]> = spheres.iter().map(|sphere| row(sphere).map(f64::from)).collect();
    let tilted = [Some([17.0, 0.0, 0.0]), Some([3.0, 18.0, 0.0]), Some([-2.0, 4.0, 19.0])];
    let spaces = [
        Space::default(),
        Space::periodic([Some(17.0), None, Some(18.0)]).expect("a box"),
        Space::triclinic(tilted).expect("a cell"),
    ];
    for space in spaces {
        // Species 2 pairs like species 0, or is a third side on a GPU.
        for (of_partners, of_third) in [
            (Interaction::Never, true),
            (Interaction::Touch, false),
            (Interaction::Within(2.0), true),
            (Interaction::Within(0.015), true),
        ] {
            let (near, far) = (Interaction::Within(0.02), Interaction::Within(2.0));
            let third =
                if of_third { [Interaction::Never, Interaction::Never, near] } else { [near, far, near] };
            let rows = vec![vec![near], vec![far, of_partners], third.to_vec()];
            let mixture = Some(SpeciesSetup { species: species.clone(), rows });
            let scenario = TestInput { spheres: spheres.clone(), mixture, space, ..TestInput::default() };
            let expected = scenario.oracle();
            // In boxes some algorithms take seconds, so only the cell list gets all tables.
            let has_all = space == Space::default() || of_partners == Interaction::Within(2.0);
            let variants = variants::each_algorithm().into_iter();
            for variant in variants.filter(|variant| has_all || variant.algorithm == Algorithm::CellList) {
                let agrees = variant.verify(&scenario, &expected, &Config::default());
                let case = || format!("{variant}, {space:?}, {of_partners:?}, {of_third}");
                assert_eq!(agrees, Ok(()), "{}", case());
                if variant.algorithm == Algorithm::CellList {
                    assert_eq!(two_sets::agrees(&scenario, 1000, variant), Ok(()), "{}", case());
                    let table = scenario.interactions().expect("few species");
                    let settings = variant.settings().space(space).interactions(table);
                    let mut detector = Detector::new(settings).expect("a detector");
                    let in_f64 = Spheres::from(&in_f64).with_species(&species).expect("one each");
                    assert_eq!(detector.pairs(in_f64), Ok(&expected[..]), "{}, in f64", case());
                }
            }
        }
    }
}

#[test]
fn tables_with_near_and_distant_partners() {
    let spheres = prop_oneof![hard::powers_of_two(), hard::soup(), hard::any_spheres()];
    let (ids, entries) = (prop::collection::vec(any::<u32>(), 601), prop::collection::vec(0_usize..7, 15));
    let strategy = (spheres, ids, entries, 0.1_f64..4.0).prop_map(|(spheres, ids, entries, scale)| {
        let size = scale * largest_radius(&spheres);
        let with = |entry: usize| match entry {
            0 => Interaction::Never,
            1 => Interaction::Touch,
            power => Interaction::Within(size * 0.125_f64.powi(power as i32 - 3)),
        };
        let rows = (0..5).map(|a| (0..=a).map(|b| with(entries[a * (a + 1) / 2 + b])).collect()).collect();
        let species = ids[..spheres.len()].iter().map(|id| (id % 10).saturating_sub(5)).collect();
        TestInput { spheres, mixture: Some(SpeciesSetup { species, rows }), ..TestInput::default() }
    });
    check(128, (strategy, settings()), |(scenario, settings)| agree(&scenario, &settings));
}

#[test]
fn species_that_never_pair() {
    let strategy = (hard::any_spheres(), 2_usize..5).prop_map(|(spheres, period)| {
        let rows = vec![vec![Interaction::Touch], vec![Interaction::Never; 2]];
        let species = (0..spheres.len()).map(|k| u32::from(k % period == 0)).collect();
        TestInput { spheres, mixture: Some(SpeciesSetup { species, rows }), ..TestInput::default() }
    });
    check(64, (strategy, settings()), |(scenario, settings)| agree(&scenario, &settings));
}

#[test]
fn sets_without_spheres_need_no_species() {
    let (none, ids): ([Sphere; 0], _) = ([], [0, 1]);
    let two = [Sphere::new([0.0; 3], 1.0), Sphere::new([1.0, 0.0, 0.0], 1.0)];
    let spheres = Spheres::from(&two).with_species(&ids).expect("as many");
    for variant in variants::each_algorithm() {
        let table = Interactions::new(2, Interaction::Touch).expect("two species");
        let mut detector = Detector::new(variant.settings().interactions(table)).expect("a detector");
        assert_eq!(detector.pairs(Spheres::from(&none)).expect("no pairs").len(), 0, "{variant}");
        assert_eq!(detector.count((spheres, Spheres::from(&none))), Ok(0), "{variant}");
        assert_eq!(detector.count((Spheres::from(&none), spheres)), Ok(0), "{variant}");
        assert_eq!(detector.count(spheres), Ok(1), "{variant}");
        assert!(detector.count(&two).is_err(), "{variant}");
    }
}

#[test]
fn ids_without_a_table_have_no_effect() {
    check(32, hard::any_spheres(), |spheres| {
        let scenario = TestInput::from(spheres);
        let ids = vec![7; scenario.spheres.len()];
        let view = scenario.view().with_species(&ids).map_err(|e| e.to_string())?;
        let expected = scenario.oracle();
        one_of_each(&scenario).try_for_each(|variant| {
            let mut detector = Detector::new(variant.settings()).map_err(|e| e.to_string())?;
            let found = variant.run(|| detector.pairs(view).map(<[_]>::to_vec)).map_err(|e| e.to_string())?;
            difference(&scenario, &found, &expected, variant.tolerance())
                .map_err(|text| format!("{variant}: the ids changed the pairs: {text}"))
        })
    });
}

/// Includes distances half of which is not representable.
#[test]
fn effective_radii_cover_all_distances() {
    let subnormal = f32::from_bits(1);
    let distances = [0.0, subnormal, 3.0 * subnormal, f32::MIN_POSITIVE.next_up(), 0.1, 1.0, f32::MAX];
    for (k, &far) in distances.iter().enumerate() {
        for &near in &distances[..=k] {
            let mut table = Interactions::new(3, Interaction::Never).expect("a table");
            table.set(0, 1, Interaction::Within(near.into())).expect("a distance");
            table.set(0, 2, Interaction::Within(far.into())).expect("a distance");
            table.set(1, 1, Interaction::Touch).expect("two species");
            let [a, b, c] =
                [0, 1, 2].map(|species| f64::from(table.effective_radius(species).for_radius(0.25)));
            assert!(a + b >= f64::from(near) && a + c >= f64::from(far) && b >= 0.25, "{near:e}, {far:e}");
        }
    }
}

#[test]
fn distances_beyond_f32_are_not_rounded() {
    let (unit, far) = (f32::from_bits(1), 3e38);
    let [near, apart] = [[[0.0; 3], [unit, unit, 0.0]], [[-far, -far, 0.0], [far, far, 0.0]]];
    for (centers, distance, pairs) in
        [(near, 2e-45, 1), (near, 1.9e-45, 0), (apart, 1e39, 1), (apart, 8e38, 0)]
    {
        let spheres = centers.map(|center| Sphere::new(center, 0.0));
        let spheres = Spheres::from(&spheres).with_species(&[0, 0]).expect("one each");
        let table = Interactions::new(1, Interaction::Within(distance)).expect("a distance");
        for variant in variants::each_algorithm() {
            let config = variant.settings().interactions(table.clone());
            let mut detector = Detector::new(config).expect("a detector");
            assert_eq!(variant.run(|| detector.count(spheres)), Ok(pairs), "{variant}, {distance:e}");
        }
    }
}
