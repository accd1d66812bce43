use lazygrid::{
    Config, Detector, Error, Exclusions, InputError, Interaction, Interactions, ListOptions, Order, Pair,
    Query, Radii, Space, Spheres,
};
use lazygrid_tests::{SuiteVariant, variants};

use crate::doubles::Random;

#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct Entry {
    pair: Pair,
    shift: [i32; 3],
    vector: [f64; 3],
    distance: f64,
}

fn scene(count: usize, space: &Space, radius: f64, random: &mut Random) -> Vec<[f64; 4]> {
    let vectors = space.cell_vectors();
    let sphere = |k: usize| {
        let mut center = [0.0; 3];
        for (axis, vector) in vectors.iter().enumerate() {
            let vector = vector.unwrap_or([0, 1, 2].map(|other| if other == axis { 3.0 } else { 0.0 }));
            let mut coordinate = random.signed() + 0.5;
            if k.is_multiple_of(3) {
                coordinate = (4.0 * coordinate).round() / 4.0;
            }
            (0..3).for_each(|axis| center[axis] += coordinate * vector[axis]);
        }
        let [x, y, z] = center;
        [x, y, z, radius * [1.0, 0.7, 0.2, 0.0][k % 4]]
    };
    (0..count).map(sphere).collect()
}

/// Number of images in each direction along each cell vector that the oracle tests.
const MAX_IMAGES: i32 = 7;

/// `cutoff` returns the cutoff of a pair, or `None` if it never pairs.
fn oracle(
    rows: &[[f64; 4]],
    others: &[[f64; 4]],
    space: &Space,
    is_open: bool,
    cutoff: impl Fn(usize, usize) -> Option<f64>,
) -> Vec<Entry> {
    let vectors = space.cell_vectors();
    let counts = vectors.map(|vector| if vector.is_some() { -MAX_IMAGES..=MAX_IMAGES } else { 0..=0 });
    let mut entries = Vec::new();
    for (i, a) in rows.iter().enumerate() {
        for (j, b) in others.iter().enumerate() {
            let Some(cutoff) = cutoff(i, j) else { continue };
            let apart = [0, 1, 2].map(|axis| b[axis] - a[axis]);
            for p in counts[0].clone() {
                for q in counts[1].clone() {
                    for r in counts[2].clone() {
                        let shift = [p, q, r];
                        let vector = [0, 1, 2].map(|axis| {
                            let term = |k: usize| {
                                vectors[k].map_or(0.0, |vector| f64::from(shift[k]) * vector[axis])
                            };
                            apart[axis] + (term(0) + term(1) + term(2))
                        });
                        let [x, y, z] = vector;
                        let squared = x * x + y * y + z * z;
                        let distance = squared.sqrt();
                        if if is_open { distance < cutoff } else { squared <= cutoff * cutoff } {
                            assert!(
                                shift.iter().all(|count| count.abs() < MAX_IMAGES),
                                "MAX_IMAGES is too small"
                            );
                            let pair = Pair { i: i as u32, j: j as u32 };
                            entries.push(Entry { pair, shift, vector, distance });
                        }
                    }
                }
            }
        }
    }
    entries
}

fn entries(detector: &mut Detector, query: Query<'_>, options: ListOptions) -> Result<Vec<Entry>, Error> {
    let list = detector.neighbor_list(query, options.shifts().vectors().distances())?;
    let rows = list.offsets().windows(2).flat_map(|ends| ends[0]..ends[1]);
    assert_eq!(rows.count(), list.len());
    assert_eq!(list.offsets().len(), query.first().len() + 1);
    for (row, ends) in list.offsets().windows(2).enumerate() {
        assert!(list.pairs()[ends[0] as usize..ends[1] as usize].iter().all(|pair| pair.i as usize == row));
    }
    let entry = |k: usize| Entry {
        pair: list.pairs()[k],
        shift: list.shifts()[k],
        vector: list.vectors()[k],
        distance: list.distances()[k],
    };
    Ok((0..list.len()).map(entry).collect())
}

fn is_half(entry: &Entry) -> bool {
    entry.pair.i < entry.pair.j || (entry.pair.i == entry.pair.j && entry.shift > [0; 3])
}

fn is_itself(entry: &Entry) -> bool {
    entry.pair.i == entry.pair.j && entry.shift == [0; 3]
}

fn spaces() -> [Space; 8] {
    let tilts = [Some([2.3, 0.0, 0.0]), Some([1.9, 2.1, 0.0]), Some([-0.7, 0.4, 2.9])];
    let cube = 1.805;
    let primitive = [Some([0.0, cube, cube]), Some([cube, 0.0, cube]), Some([cube, cube, 0.0])];
    [
        Space::UNBOUNDED,
        Space::periodic([Some(2.0); 3]).expect("lengths"),
        Space::periodic([None, Some(10.1), Some(1.3)]).expect("lengths"),
        Space::triclinic(tilts).expect("cell vectors"),
        Space::triclinic([None, tilts[1], tilts[2]]).expect("cell vectors"),
        Space::triclinic(primitive).expect("cell vectors"),
        // Shifts are in units of these vectors, not of the lengths of the axes.
        Space::triclinic([[0.0, -2.1, 0.0], [1.7, 0.0, 0.0], [0.0, 0.0, -1.3]].map(Some))
            .expect("cell vectors"),
        Space::periodic([Some(40.0), Some(30.0), None]).expect("lengths"),
    ]
}

const RADII: [f64; 4] = [0.3, 1.0, 1.5, 2.9];

#[test]
fn all_images_within_the_cutoff_are_found() {
    let mut random = Random(5);
    for space in spaces() {
        for radius in RADII {
            let spheres = scene(11, &space, radius, &mut random);
            let cutoff = |i: usize, j: usize| Some(spheres[i][3] + spheres[j][3]);
            for is_open in [false, true] {
                let all = oracle(&spheres, &spheres, &space, is_open, cutoff);
                let full = ListOptions::full();
                let [full, half] =
                    [full, ListOptions::half()].map(|options| if is_open { options.open() } else { options });
                for variant in variants::each_algorithm() {
                    let config = variant.settings().space(space).order(Order::Unordered);
                    let mut detector = Detector::new(config).expect("a detector");
                    let mut ask =
                        |options| entries(&mut detector, Query::new(&spheres), options).expect("a list");
                    let without = || all.iter().filter(|entry| !is_itself(entry)).copied();
                    assert_eq!(ask(full), without().collect::<Vec<_>>(), "{variant}, {space:?}, {radius}");
                    assert_eq!(
                        ask(half),
                        without().filter(is_half).collect::<Vec<_>>(),
                        "{variant}, {space:?}"
                    );
                    let is_expected =
                        |entry: &&Entry| !is_itself(entry) || spheres[entry.pair.i as usize][3] > 0.0;
                    let with_self: Vec<Entry> = all.iter().filter(is_expected).copied().collect();
                    assert_eq!(ask(full.with_self()), with_self, "{variant}, {space:?}, {radius}");
                }
            }
        }
    }
}

#[test]
fn two_sets_and_their_images() {
    let mut random = Random(9);
    for space in spaces() {
        for radius in RADII {
            let [a, b] = [7, 9].map(|count| scene(count, &space, radius, &mut random));
            let expected = oracle(&a, &b, &space, false, |i, j| Some(a[i][3] + b[j][3]));
            for variant in variants::each_algorithm() {
                let mut detector = Detector::new(variant.settings().space(space)).expect("a detector");
                for options in [ListOptions::full(), ListOptions::half().with_self()] {
                    let found = entries(&mut detector, Query::new((&a, &b)), options).expect("a list");
                    assert_eq!(found, expected, "{variant}, {space:?}, {radius}");
                }
                let none: [[f64; 4]; 0] = [];
                assert_eq!(
                    entries(&mut detector, Query::new((&a, &none)), ListOptions::full()),
                    Ok(Vec::new())
                );
            }
        }
    }
}

#[test]
fn species_groups_and_exclusions_hold_for_all_images() {
    let mut random = Random(3);
    let mut table = Interactions::new(3, Interaction::Touch).expect("a table");
    table.set(0, 0, Interaction::Within(2.6)).expect("a distance");
    table.set(1, 1, Interaction::Never).expect("a table");
    table.set(0, 2, Interaction::Within(0.5)).expect("a distance");
    for space in spaces() {
        let spheres = scene(12, &space, 1.1, &mut random);
        let species: Vec<u32> = (0..12).map(|k| k % 3).collect();
        let groups: Vec<u32> = (0..12).map(|k| if k < 5 { 7 } else { Spheres::NO_GROUP }).collect();
        let excluded = Exclusions::new(12, [(0, 6), (7, 8), (9, 1)]).expect("pairs");
        let cutoff = |i: usize, j: usize| match table.get(species[i], species[j]) {
            _ if excluded.contains(i as u32, j as u32) || (i < 5 && j < 5) => None,
            Interaction::Within(distance) => Some(distance),
            Interaction::Touch => Some(spheres[i][3] + spheres[j][3]),
            _ => None,
        };
        let all = oracle(&spheres, &spheres, &space, false, cutoff);
        let expected: Vec<Entry> = all.into_iter().filter(|entry| !is_itself(entry)).collect();
        let set = Spheres::from(&spheres).with_species(&species).and_then(|set| set.with_groups(&groups));
        let query = Query::new(set.expect("a set")).without(&excluded);
        for variant in variants::each_algorithm() {
            let config = variant.settings().space(space).interactions(table.clone());
            let mut detector = Detector::new(config).expect("a detector");
            let found = entries(&mut detector, query, ListOptions::full()).expect("a list");
            assert_eq!(found, expected, "{variant}, {space:?}");
        }
    }
}

#[test]
fn lists_far_from_the_origin() {
    let mut random = Random(1);
    for space in spaces() {
        for far in [1e3, 1e6, 1e9] {
            let mut spheres = scene(8, &space, 1.2, &mut random);
            spheres.iter_mut().for_each(|[x, y, z, _]| (*x, *y, *z) = (*x + far, *y - far, *z + 0.5 * far));
            let cutoff = |i: usize, j: usize| Some(spheres[i][3] + spheres[j][3]);
            let all = oracle(&spheres, &spheres, &space, false, cutoff);
            let expected: Vec<Entry> = all.into_iter().filter(|entry| !is_itself(entry)).collect();
            let mut detector = Detector::new(Config::default().space(space)).expect("a detector");
            let found = entries(&mut detector, Query::new(&spheres), ListOptions::full()).expect("a list");
            assert_eq!(found, expected, "{space:?}, {far:e}");
        }
    }
}

#[test]
fn unrequested_quantities_are_empty() {
    let spheres = [[0.0_f32, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]];
    let mut detector = Detector::new(Config::default()).expect("a detector");
    let list = detector.neighbor_list(&spheres, ListOptions::full()).expect("a list");
    assert_eq!(list.pairs(), [Pair { i: 0, j: 1 }, Pair { i: 1, j: 0 }]);
    assert!(list.shifts().is_empty() && list.vectors().is_empty() && list.distances().is_empty());
    assert_eq!(list.offsets(), [0, 1, 2]);
}

#[test]
fn neighbor_lists_refuse_invalid_input() {
    let small = Space::periodic([Some(1.0); 3]).expect("lengths");
    let mut detector = Detector::new(Config::default().space(small)).expect("a detector");
    let list = |detector: &mut Detector, spheres: &[[f64; 4]]| {
        detector.neighbor_list(spheres, ListOptions::full().shifts()).map(|list| list.len())
    };
    let bad = [[0.0, 0.0, 0.0, 3.0], [f64::NAN, 0.0, 0.0, 1.0]];
    let refused = list(&mut detector, &bad);
    assert!(matches!(refused, Err(Error::Input(InputError::Sphere { index: 1, .. }))), "{refused:?}");
    let large = [[0.0, 0.0, 0.0, 1e300]];
    let refused = list(&mut detector, &large);
    assert!(matches!(refused, Err(Error::Input(InputError::Images { .. }))), "{refused:?}");
    let apart = [[0.0, 0.0, 0.0, 0.1], [3e9, 0.0, 0.0, 0.1]];
    let refused = list(&mut detector, &apart);
    assert_eq!(refused, Err(Error::Input(InputError::Shift { i: 0, j: 1 })));
    assert_eq!(list(&mut detector, &[[0.0, 0.0, 0.0, 0.5]]), Ok(6));
    let report = detector.report();
    assert!(report.reason.contains("images") && report.spheres == 1, "{report:?}");
    assert_eq!(detector.count(&[[0.0, 0.0, 0.0, 0.5_f64]]), Ok(0));
    assert!(!detector.report().reason.contains("images"));
    let points = [[0.0_f64; 3]];
    let points = Spheres::points(&points, Radii::All(0.5)).expect("a set");
    assert_eq!(entries(&mut detector, Query::new(points), ListOptions::full().open()), Ok(Vec::new()));
}

#[test]
fn cell_vectors_beyond_their_types_are_refused() {
    let vectors = [[1.0, 0.0, 0.0], [0.4, 1.0, 0.0], [-0.3, 0.2, 1.0]];
    for scale in [1.0, 1e-300, 1e300] {
        let cell = vectors.map(|vector: [f64; 3]| Some(vector.map(|number| number * scale)));
        for vectors in [cell, [cell[0], cell[1], None], [None, cell[1], None]] {
            let space = Space::triclinic(vectors).expect("a cell");
            let mut detector = Detector::new(Config::default().space(space)).expect("a detector");
            let mut list = |spheres: &[[f64; 4]]| {
                let list = detector.neighbor_list(spheres, ListOptions::full().shifts());
                list.map(|list| list.len())
            };
            let cutoffs = [1e10, 1e19, 1e40, 1e155, 1e308, f64::MAX];
            let cutoffs = cutoffs.into_iter().flat_map(|cutoff| [cutoff, cutoff * scale]);
            for cutoff in cutoffs.filter(|cutoff| cutoff.is_finite() && *cutoff >= 1e10 * scale) {
                let refused = list(&[[0.0, 0.0, 0.0, cutoff]]).expect_err("many images");
                let is_named =
                    matches!(refused, Error::Input(InputError::Images { images, .. }) if images > 1e9);
                assert!(is_named, "{vectors:?}, {cutoff:e}: {refused:?}");
                let said = refused.to_string();
                assert!(
                    said.contains("choose a smaller cutoff") && said.contains("wrap the coordinates"),
                    "{said}"
                );
            }
            let [x, y, z] = vectors.into_iter().flatten().next().expect("a vector");
            for far in [3e9, 1e12, 1e18, 1e100, 1e250, 1e300] {
                let apart = [x * far, y * far, z * far, 0.1 * scale];
                if apart.iter().all(|number| number.is_finite()) {
                    let refused = list(&[[0.0, 0.0, 0.0, 0.1 * scale], apart]);
                    assert_eq!(
                        refused,
                        Err(Error::Input(InputError::Shift { i: 0, j: 1 })),
                        "{vectors:?}, {far:e}"
                    );
                }
            }
            let apart = [0.0, 1e20].map(|at| [at, at, 0.0, 0.7 * scale]);
            if scale < 1.0 {
                let refused = list(&apart);
                let is_named = matches!(refused, Err(Error::Input(InputError::Images { .. })));
                assert!(is_named, "{vectors:?}: {refused:?}");
                let refused = list(&apart.map(|[x, y, z, radius]| [x, y, z, 0.1 * radius]));
                let is_named = matches!(refused, Err(Error::Input(InputError::CoordinateRange { .. })));
                assert!(is_named, "{vectors:?}: {refused:?}");
            }
        }
    }
}
