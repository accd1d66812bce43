use lazygrid::{
    Algorithm, Backend, Detector, Error, Exclusions, InputError, Interaction, Interactions, Order, Pair,
    Query, Radii, Sphere, Spheres,
};
use lazygrid_check::SpeciesSetup;
use lazygrid_io::scenes::Scene;
use lazygrid_tests::results::{match_the_list, streamed};
use lazygrid_tests::{
    DetectorVariant, SuiteVariant, TestInput, difference, hard, in_pool, periodic, variants,
};
use proptest::prelude::*;
use proptest::sample::select;

use crate::doubles::Random;
use crate::properties::check;

pub(crate) fn split_at(scenario: &TestInput, fraction: f32) -> usize {
    (fraction * scenario.spheres.len() as f32).round() as usize
}

/// Exclusions within one set have no effect.
fn exclusions(scenario: &TestInput, split: usize) -> Option<Exclusions> {
    let excluded = scenario.excluded.as_ref()?;
    let across = excluded.pairs().filter(|&(i, j)| (i as usize) < split && j as usize >= split);
    let pairs = across.map(|(i, j)| (i, j - split as u32));
    Some(Exclusions::across(split, scenario.spheres.len() - split, pairs).expect("of both sets"))
}

fn across(scenario: &TestInput, split: usize) -> Vec<Pair> {
    let split = split as u32;
    let pairs = scenario.oracle().into_iter().filter(|pair| pair.i < split && pair.j >= split);
    pairs.map(|pair| Pair { i: pair.i, j: pair.j - split }).collect()
}

pub(crate) fn agrees(scenario: &TestInput, split: usize, variant: DetectorVariant) -> Result<(), String> {
    let expected = across(scenario, split);
    let [a, b] = [scenario.only(|k| k < split), scenario.only(|k| k >= split)];
    let list = exclusions(scenario, split);
    let query = Query::new((a.view(), b.view()));
    let query = list.as_ref().map_or(query, |list| query.without(list));
    let config = scenario.config(variant.settings()).map_err(|error| error.to_string())?;
    let complain = |what: &str| format!("{variant}, {what}, first {split}");
    let works = |error: Error| complain(&error.to_string());
    let of_all = |pairs: &[Pair]| -> Vec<Pair> {
        pairs.iter().map(|pair| Pair { i: pair.i, j: pair.j + split as u32 }).collect()
    };
    in_pool(variant.threads(), || {
        let mut detector = Detector::new(config.clone().max_pairs(1 << 20)).map_err(works)?;
        let found = detector.pairs(query).map_err(works)?.to_vec();
        difference(scenario, &of_all(&found), &of_all(&expected), variant.tolerance())
            .map_err(|text| complain(&text))?;
        if !found.is_sorted() || found.iter().any(|pair| pair.i as usize >= split) {
            return Err(complain("pairs of other sets, or in no order"));
        }
        match_the_list(&mut detector, query, &found).map_err(|text| complain(&text))?;
        for (order, most) in [(Order::Canonical, 7), (Order::Unordered, 7), (Order::Canonical, 1 << 20)] {
            let config = config.clone().order(order).max_pairs(most);
            let mut detector = Detector::new(config).map_err(works)?;
            let mut stream = streamed(&mut detector, query, 5).map_err(|text| complain(&text))?;
            if order == Order::Unordered {
                stream.sort_unstable();
            }
            if stream != found {
                return Err(complain("streamed otherwise"));
            }
        }
        Ok(())
    })
}

#[test]
fn arbitrary_sets_match_the_oracle() {
    let scenarios = prop_oneof![
        2 => hard::any_spheres().prop_map(TestInput::from),
        1 => hard::mixture(hard::any_spheres()),
        1 => periodic::lattice(),
        1 => periodic::soup(),
        1 => periodic::giant(),
        1 => periodic::mixture(),
    ];
    check(300, (scenarios, 0.0..=1.0_f32, select(variants::all())), |(scenario, fraction, variant)| {
        agrees(&scenario, split_at(&scenario, fraction), variant)
    });
}

/// Some levels are faster to search from the second set.
#[test]
fn scenes_with_giants_in_either_set_match_the_oracle() {
    let giants =
        (0..20_u8).map(|k| Sphere::new([f32::from(k % 4), f32::from(k / 4), 0.0].map(|x| 9.0 * x), 8.0));
    let mut variants = variants::all();
    variants.retain(|variant| variant.algorithm == Algorithm::CellList && variant.threads() < 7);
    for scene in Scene::ALL {
        let mut spheres = scene.spheres(1500, 5);
        spheres.splice(0..0, giants.clone());
        let scenario = TestInput::from(spheres);
        for split in [0, 1, 20, 700, 1520] {
            let is_tested = |variant: &&DetectorVariant| variant.backend() == Backend::Cpu || split == 20;
            for &variant in variants.iter().filter(is_tested) {
                agrees(&scenario, split, variant).unwrap_or_else(|text| panic!("{scene}, {text}"));
            }
        }
    }
}

#[test]
fn species_of_either_set_match_the_oracle() {
    use Interaction::{Never, Touch, Within};
    let rows = vec![vec![Touch], vec![Within(0.9), Never], vec![Never, Touch, Within(0.5)]];
    let species: Vec<u32> = (0..600).map(|k| k / 7 % 3).collect();
    let spheres = Scene::FiveSizes.spheres(600, 9);
    let mixture = Some(SpeciesSetup { species: species.clone(), rows });
    let with_table = TestInput { mixture, ..TestInput::from(spheres.clone()) };
    let without = TestInput::from(spheres);
    let mut variants = variants::all();
    variants.retain(|variant| variant.algorithm == Algorithm::CellList && variant.threads() < 7);
    for variant in variants {
        agrees(&with_table, 250, variant).unwrap_or_else(|text| panic!("{text}"));
        let (a, b) = without.spheres.split_at(250);
        let (ids_a, ids_b) = species.split_at(250);
        let a = Spheres::from(a).with_species(ids_a).expect("one each");
        let b = Spheres::from(b).with_species(ids_b).expect("one each");
        let mut detector = Detector::new(variant.settings()).expect("made");
        let count = detector.count((a, b));
        assert_eq!(count, Ok(across(&without, 250).len() as u64), "{variant}");
    }
}

const SPECIES: u32 = Interactions::MAX_SPECIES;
/// Spheres of species `a` and `partner(a)` pair within this distance.
const DISTANCE: f32 = 0.5;

fn partner(a: u32) -> u32 {
    (7 * a + 1) % SPECIES
}

fn sets_of_most_species() -> [(Vec<[f32; 3]>, Vec<u32>); 2] {
    let mut random = Random(53);
    let mut point = |extent: f32| [(); 3].map(|()| extent * random.signed() as f32);
    let first: Vec<_> = (0..300).map(|_| point(4.0)).collect();
    let near = |at: &[f32; 3]| {
        let step = point(0.5);
        [0, 1, 2].map(|axis| at[axis] + step[axis])
    };
    let second = first.iter().map(near).collect();
    let ids: Vec<u32> = (0..300).map(|k| k * 2731 % SPECIES).collect();
    let others = (0..300).map(|k| partner(if k % 2 == 0 { ids[k] } else { ids[k / 2] })).collect();
    [(first, ids), (second, others)]
}

fn pairs_of_partners([(first, ids), (second, others)]: &[(Vec<[f32; 3]>, Vec<u32>); 2]) -> Vec<Pair> {
    let is_near = |i: usize, j: usize| {
        let along = |axis: usize| f64::from(second[j][axis]) - f64::from(first[i][axis]);
        let [x, y, z] = [0, 1, 2].map(along);
        x * x + y * y + z * z <= f64::from(DISTANCE * DISTANCE)
    };
    let all = (0..first.len()).flat_map(|i| (0..second.len()).map(move |j| (i, j)));
    let pair = all.filter(|&(i, j)| {
        let (a, b) = (ids[i], others[j]);
        (partner(a) == b || partner(b) == a) && is_near(i, j)
    });
    pair.map(|(i, j)| Pair { i: i as u32, j: j as u32 }).collect()
}

#[test]
fn two_sets_of_most_species_match_the_oracle() {
    let sets = sets_of_most_species();
    let expected = pairs_of_partners(&sets);
    let [(first, ids), (second, others)] = &sets;
    let is_large = |pair: &&Pair| ids[pair.i as usize] > 2048 && others[pair.j as usize] > 2048;
    let large = expected.iter().filter(is_large).count();
    assert!(expected.len() > 50 && large > 10, "{large} of {}", expected.len());

    let mut table = Interactions::new(SPECIES, Interaction::Never).expect("memory");
    for a in 0..SPECIES {
        table.set(a, partner(a), Interaction::Within(DISTANCE.into())).expect("a distance");
    }
    let wide = [first, second].map(|set| set.iter().map(|at| at.map(f64::from)).collect::<Vec<_>>());
    for variant in variants::each_algorithm() {
        // The detector drops a table of 256 MiB before the next one is made.
        let mut detector = Detector::new(variant.settings().interactions(table.clone())).expect("a detector");
        let narrow = [first, second].map(|set| Spheres::points(set, Radii::All(0.0_f32)));
        let wide = wide.each_ref().map(|set| Spheres::points(set, Radii::All(0.0_f64)));
        // On a GPU, the host decides pairs of `f64` spheres, so one algorithm suffices.
        let has_wide = variant.backend() == Backend::Cpu || variant.algorithm == Algorithm::CellList;
        for [a, b] in [Some(narrow), has_wide.then_some(wide)].into_iter().flatten() {
            let a = a.and_then(|a| a.with_species(ids)).expect("one each");
            let b = b.and_then(|b| b.with_species(others)).expect("one each");
            let found = variant.run(|| detector.pairs((a, b)).map(<[Pair]>::to_vec));
            let is_right = found.as_ref() == Ok(&expected);
            assert!(is_right, "{variant}: {:?} of {}", found.map(|f| f.len()), expected.len());
        }
    }
}

#[test]
fn errors_name_the_set() {
    let mut variants = variants::all();
    variants.retain(|variant| variant.algorithm == Algorithm::CellList && variant.threads() == 1);
    variants.into_iter().for_each(input_errors_name_the_set);
}

fn input_errors_name_the_set(variant: DetectorVariant) {
    let good = [Sphere::new([0.0; 3], 1.0); 3];
    let bad = [good[0], Sphere::new([f32::NAN, 0.0, 0.0], 1.0)];
    let mut detector = Detector::new(variant.settings()).expect("a detector");
    let error = detector.count((&bad, &good)).expect_err("a bad sphere");
    assert!(
        matches!(error, Error::Input(InputError::Sphere { index: 1, count: 1, total: 2, .. })),
        "{error}"
    );
    let error = detector.count((&good, &bad)).expect_err("a bad sphere");
    assert!(
        matches!(&error, Error::Input(InputError::SecondSet(within))
        if matches!(**within, InputError::Sphere { index: 1, total: 2, .. })),
        "{error}"
    );
    assert!(error.to_string().starts_with("in the second set, sphere 1 has center (NaN"), "{error}");
    let none: [Sphere; 0] = [];
    assert_eq!(detector.count((&none, &good)).expect("an empty set is valid"), 0);

    let mut limited = Detector::new(variant.settings().max_pairs(8)).expect("a detector");
    let error = limited.pairs((&good, Spheres::from(&good))).expect_err("nine pairs");
    assert!(matches!(error, Error::TooManyPairs { found: 9, limit: 8 }), "{error}");
}
