//! Species masks and interaction distances.

use lazygrid::{Config, Interaction};
use lazygrid_tests::{Mixture, Scenario, Subject, adversary};

use crate::properties::{check, settings};
use proptest::prelude::*;

fn agree(scenario: &Scenario, settings: &Config) -> Result<(), String> {
    let expected = scenario.oracle();
    Subject::all().into_iter().try_for_each(|subject| subject.judge(scenario, &expected, settings))
}

#[test]
fn any_table_on_any_spheres() {
    check(160, (adversary::mixture(adversary::any_spheres()), settings()), |(scenario, settings)| {
        agree(&scenario, &settings)
    });
}

#[test]
fn any_table_on_crowded_boxes() {
    check(96, (adversary::mixture(adversary::soup()), settings()), |(scenario, settings)| {
        agree(&scenario, &settings)
    });
}

/// Points that react with one other species from far away: the reach comes from the table, not from radii.
#[test]
fn small_radii_with_large_distances() {
    let strategy =
        (adversary::lattice(), 0.0_f32..4.0, 1_usize..40).prop_map(|(spheres, spacings, period)| {
            let n = spheres.len();
            let spacing = spheres.iter().map(|s| s.radius).fold(0.0, f32::max);
            let spheres =
                spheres.into_iter().map(|s| lazygrid::Sphere::new(s.center, s.radius * 1e-6)).collect();
            let rows = vec![
                vec![Interaction::Never],
                vec![Interaction::Within(spacings * spacing), Interaction::Touch],
            ];
            let species = (0..n).map(|k| u32::from(k % period == 0)).collect();
            Scenario { spheres, mixture: Some(Mixture { species, rows }) }
        });
    check(96, (strategy, settings()), |(scenario, settings)| agree(&scenario, &settings));
}

/// Species that never pair leave nothing, and huge radii among them cost nobody a pair.
#[test]
fn species_that_never_pair() {
    let strategy = (adversary::any_spheres(), 2_usize..5).prop_map(|(spheres, period)| {
        let rows = vec![vec![Interaction::Touch], vec![Interaction::Never; 2]];
        let species = (0..spheres.len()).map(|k| u32::from(k % period == 0)).collect();
        Scenario { spheres, mixture: Some(Mixture { species, rows }) }
    });
    check(64, (strategy, settings()), |(scenario, settings)| agree(&scenario, &settings));
}

/// Species ids without a table are carried along and decide nothing.
#[test]
fn ids_without_a_table() {
    check(32, adversary::any_spheres(), |spheres| {
        let scenario = Scenario::from(spheres);
        let ids = vec![7; scenario.spheres.len()];
        let view = scenario.view().with_species(&ids).map_err(|e| e.to_string())?;
        let mut detector = lazygrid::Detector::new(Config::default()).map_err(|e| e.to_string())?;
        let found = detector.pairs(view).map_err(|e| e.to_string())?;
        if found != scenario.oracle() { Err("the ids changed the pairs".to_owned()) } else { Ok(()) }
    });
}
