//! `f64` spheres of which a few are so far away that the search frame clamps them.

use lazygrid::{Algorithm, Detector, Interaction, Interactions, Order, Query, Skin, Space, Spheres};
use lazygrid_tests::{SuiteVariant, in_pool, variants};

use crate::doubles::{Random, agrees, oracle, scene};

/// Some far spheres touch each other or a clamped sphere. No square overflows, as the oracle requires.
fn with_far_spheres(random: &mut Random) -> Vec<[f64; 4]> {
    let mut spheres = scene(600, 2.4, [0.0; 3], random);
    // A power of two scales without rounding.
    spheres.iter_mut().for_each(|sphere| *sphere = sphere.map(|number| number / 131_072.0));
    let far = [
        [1e9, 0.0, 0.0, 0.5],
        [1e9 + 0.75, 0.0, 0.0, 0.25],
        [1e9 + 0.75, 1e-7, 0.0, 0.25],
        [1e12, 1e12, 1e12, 0.5],
        [3e12, 3e12, 3e12, 0.5],
        [-1e30, 0.3, 0.0, 0.0],
        [-1e150, 0.3, 0.0, 1.0],
        [-1e150, 0.3, 0.0, 1e150],
        [0.0, 0.1, -1e6, 1e6],
        [0.0, 0.1, -1e6, 1e6 - 3.0],
        [1e153, -1e153, -1e153, 1e-300],
    ];
    for (k, &sphere) in far.iter().enumerate() {
        spheres[50 * k + 7] = sphere;
    }
    spheres
}

fn spaces() -> [Space; 2] {
    let slab = Space::periodic([None, Some(8.0 / 3.0), None]).expect("a length");
    [Space::UNBOUNDED, slab]
}

#[test]
fn pairs_with_far_spheres_match_the_contract() {
    let mut table = Interactions::new(2, Interaction::Touch).expect("few species");
    table.set(0, 1, Interaction::Within(0.01)).expect("a distance");
    let species: Vec<u32> = (0..600).map(|k| k % 2).collect();
    for (space, table) in spaces().into_iter().flat_map(|space| [(space, None), (space, Some(&table))]) {
        // The oracle tests only images near the box.
        let mut spheres = with_far_spheres(&mut Random(31));
        if space.is_periodic() {
            spheres.iter_mut().for_each(|sphere| sphere[1] = sphere[1].clamp(-2.0, 2.0));
        }
        let expected = oracle(&spheres, &space, table);
        assert!(expected.len() > 100, "{}", expected.len());
        for variant in variants::each_algorithm() {
            let config = variant.settings().space(space).skin(Skin::Off);
            let config = table.iter().fold(config, |config, &table| config.interactions(table.clone()));
            let mut detector = Detector::new(config).expect("a detector");
            let view = Spheres::from(&spheres);
            let view = if table.is_some() { view.with_species(&species).expect("one each") } else { view };
            variant.run(|| {
                agrees(&mut detector, Query::new(view), &expected)
                    .unwrap_or_else(|text| panic!("{variant}, {space:?}, {}: {text}", table.is_some()));
            });
        }
    }
}

#[test]
fn candidates_with_far_spheres_lose_no_pair() {
    for space in spaces() {
        let mut random = Random(37);
        let mut spheres = scene(900, 0.5, [0.0; 3], &mut random);
        spheres.iter_mut().for_each(|sphere| sphere[3] *= 0.1);
        spheres[10] = [1e9, 0.0, 0.0, 0.05];
        let mut steps = Vec::new();
        for step in 0..12 {
            steps.push((spheres.clone(), oracle(&spheres, &space, None)));
            for sphere in &mut spheres {
                (0..3).for_each(|axis| sphere[axis] += 0.0005 * random.signed());
            }
            match step {
                3 => spheres[500] = [0.0, 1.0, 1e8, 0.05],
                6 => spheres[10] = spheres[11],
                8 => spheres[10] = [3e4, 0.0, 0.0, 0.1],
                _ => {}
            }
        }
        for variant in variants::each_algorithm() {
            if !matches!(variant.algorithm, Algorithm::CellList | Algorithm::Auto) {
                continue;
            }
            let config = variant.settings().space(space).skin(Skin::Fixed(0.02)).order(Order::Canonical);
            let mut detector = Detector::new(config).expect("a detector");
            let mut served = 0;
            in_pool(variant.threads(), || {
                for (step, (spheres, expected)) in steps.iter().enumerate() {
                    let found = detector.pairs(spheres).expect("valid");
                    assert!(found == expected, "{variant}, {space:?}, step {step}: {}", found.len());
                    let candidates = detector.report().candidates;
                    served += u32::from(candidates.is_some_and(|candidates| candidates.rebuilt.is_none()));
                }
            });
            assert!(served >= 5, "{variant}, {space:?}: {served} of 12 calls were served");
        }
    }
}
