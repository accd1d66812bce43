//! `f64` spheres of any size. Scaling by a power of two and a common offset change no pair if they round no
//! number: the contract's expression then computes the scaled differences.

use lazygrid::{
    Algorithm, Detector, Error, Exclusions, InputError, Interaction, Interactions, Order, Pair, Query, Skin,
    Space, Spheres,
};
use lazygrid_tests::{DetectorVariant, SuiteVariant, in_pool, variants};

use crate::doubles::{Columns, Random, oracle, serve, spaces_of};

/// The unit of all numbers of a scene. Not all multiples are `f32` numbers, and squared distances of tangent spheres
/// are exact.
const QUANTUM: f64 = 1.0 / (1 << 24) as f64;

/// Vectors of whole numbers and their lengths, which are whole numbers too.
const DIRECTIONS: [([f64; 3], f64); 4] =
    [([1.0, -2.0, 2.0], 3.0), ([-2.0, 3.0, 6.0], 7.0), ([4.0, 4.0, -7.0], 9.0), ([-2.0, -6.0, 9.0], 11.0)];

fn quantized(number: f64) -> f64 {
    (number / QUANTUM).round() * QUANTUM
}

/// Every second sphere touches the previous one, up to two quanta.
fn scene(count: usize, random: &mut Random) -> Vec<[f64; 4]> {
    let mut spheres: Vec<[f64; 4]> = Vec::new();
    for k in 0..count {
        let radius = quantized([0.3, 0.017, 0.11, 0.0][k / 2 % 4]);
        let [x, y, z] = [(); 3].map(|()| quantized(2.0 * random.signed()));
        spheres.push(match spheres.last() {
            Some(&[a, b, c, r]) if k % 2 == 1 => {
                let (mut direction, length) = DIRECTIONS[k / 8 % 4];
                direction.rotate_left(k % 3);
                let steps = ((r + radius) / (length * QUANTUM)).ceil();
                let [x, y, z] = direction.map(|component| component * steps * QUANTUM);
                let overlap = (k / 2 % 5) as f64 - 2.0;
                let radius = steps * length * QUANTUM - r + overlap * QUANTUM;
                [a + x, b + y, c + z, radius.max(0.0)]
            }
            _ => [x, y, z, radius],
        });
    }
    spheres
}

#[derive(Clone, Copy, Debug)]
struct Magnitude {
    /// Scales a scene by a power of two.
    exponent: i32,
    /// A multiple of the scaled quantum.
    offset: [f64; 3],
}

/// Sizes from 1e-310 to 1e307. The quantum of the last two is the distance of neighboring numbers at 1e30.
const MAGNITUDES: [Magnitude; 8] = [
    Magnitude { exponent: -1030, offset: [0.0; 3] },
    Magnitude { exponent: -700, offset: [0.0; 3] },
    Magnitude { exponent: -150, offset: [0.0; 3] },
    Magnitude { exponent: 150, offset: [0.0; 3] },
    Magnitude { exponent: 700, offset: [0.0; 3] },
    Magnitude { exponent: 1020, offset: [0.0; 3] },
    Magnitude { exponent: 71, offset: [1e30, -1e30, 1e30] },
    Magnitude { exponent: 71, offset: [-1e30, 0.0, 1e30] },
];

impl Magnitude {
    fn unit(self) -> f64 {
        2.0_f64.powi(self.exponent / 2) * 2.0_f64.powi(self.exponent - self.exponent / 2)
    }

    fn spheres(self, scene: &[[f64; 4]]) -> Vec<[f64; 4]> {
        let ([x, y, z], unit) = (self.offset, self.unit());
        scene.iter().map(|[a, b, c, r]| [a * unit + x, b * unit + y, c * unit + z, r * unit]).collect()
    }

    fn exact_spheres(self, scene: &[[f64; 4]]) -> Vec<[f64; 4]> {
        let spheres = self.spheres(scene);
        let ([x, y, z], unit) = (self.offset, self.unit());
        let back = |[a, b, c, r]: &[f64; 4]| [(a - x) / unit, (b - y) / unit, (c - z) / unit, r / unit];
        assert!(spheres.iter().map(back).eq(scene.iter().copied()), "{self:?} rounds numbers");
        spheres
    }

    fn spaces(self) -> [Space; 5] {
        spaces_of(|length| quantized(length) * self.unit())
    }
}

#[test]
fn no_magnitude_overflows_or_underflows() {
    let base = scene(160, &mut Random(11));
    let expected = spaces_of(quantized).map(|space| oracle(&base, &space, None));
    for magnitude in MAGNITUDES {
        let spheres = magnitude.exact_spheres(&base);
        for (space, expected) in magnitude.spaces().into_iter().zip(&expected) {
            assert!(expected.len() > 50, "{}", expected.len());
            for variant in variants::each_algorithm() {
                let mut detector = Detector::new(variant.settings().space(space)).expect("a detector");
                let found = variant.run(|| detector.pairs(&spheres).map(<[Pair]>::to_vec));
                let is_right = found.as_ref() == Ok(expected);
                assert!(is_right, "{variant}, {magnitude:?}, {space:?}: {:?}", found.map(|f| f.len()));
            }
        }
    }
}

fn table(unit: f64) -> Interactions {
    let mut table = Interactions::new(2, Interaction::Touch).expect("few species");
    table.set(0, 1, Interaction::Within(quantized(0.1) * unit)).expect("a distance");
    table
}

#[test]
fn two_sets_groups_and_exclusions_of_any_magnitude_match_the_contract() {
    const FIRST_SET_SIZE: usize = 80;
    let base = scene(2 * FIRST_SET_SIZE, &mut Random(41));
    // Spheres that touch by construction are in different sets.
    let base: Vec<_> = [0, 1].into_iter().flat_map(|k| base.iter().copied().skip(k).step_by(2)).collect();
    let ids: Vec<u32> = (0..2 * FIRST_SET_SIZE as u32).map(|k| k % 2).collect();
    let groups: Vec<u32> =
        (0..2 * FIRST_SET_SIZE as u32).map(|k| if k % 5 == 0 { Spheres::NO_GROUP } else { k % 3 }).collect();
    for (magnitude, number) in [(0, 1), (0, 3), (5, 2), (5, 4), (6, 0), (6, 1), (7, 3)] {
        let magnitude = MAGNITUDES[magnitude];
        let mut all = oracle(&base, &spaces_of(quantized)[number], Some(&table(1.0)));
        all.retain(|pair| (pair.i as usize) < FIRST_SET_SIZE && pair.j as usize >= FIRST_SET_SIZE);
        let is_grouped = |pair: &Pair| {
            let [a, b] = [pair.i, pair.j].map(|k| groups[k as usize]);
            a == b && a != Spheres::NO_GROUP
        };
        let grouped = all.iter().filter(|pair| is_grouped(pair)).count();
        all.retain(|pair| !is_grouped(pair));
        let all: Vec<_> = all.iter().map(|pair| (pair.i, pair.j - FIRST_SET_SIZE as u32)).collect();
        let exclusions = Exclusions::across(FIRST_SET_SIZE, FIRST_SET_SIZE, all.iter().step_by(3).copied())
            .expect("in range");
        let remaining = all.iter().filter(|&&(i, j)| !exclusions.contains(i, j));
        let expected: Vec<_> = remaining.map(|&(i, j)| Pair { i, j }).collect();
        assert!(grouped > 0 && expected.len() > 30, "{grouped} and {}", expected.len());

        let (spheres, space) = (magnitude.exact_spheres(&base), magnitude.spaces()[number]);
        let [first, second] = [0..FIRST_SET_SIZE, FIRST_SET_SIZE..2 * FIRST_SET_SIZE].map(|range| {
            let set = Spheres::from(&spheres[range.clone()]).with_species(&ids[range.clone()]);
            set.and_then(|set| set.with_groups(&groups[range])).expect("one each")
        });
        let query = Query::new((first, second)).without(&exclusions);
        for variant in variants::each_algorithm() {
            let config = variant.settings().space(space).interactions(table(magnitude.unit()));
            let mut detector = Detector::new(config).expect("a detector");
            let found = variant.run(|| detector.pairs(query).map(<[Pair]>::to_vec));
            let is_right = found.as_ref() == Ok(&expected);
            assert!(is_right, "{variant}, {magnitude:?}, {space:?}: {:?}", found.map(|f| f.len()));
        }
    }
}

fn cell_lists() -> impl Iterator<Item = DetectorVariant> {
    variants::each_algorithm().into_iter().filter(|variant| variant.algorithm == Algorithm::CellList)
}

/// The longest skins and the distances of neighboring numbers at this offset are less than a factor of 1000
/// apart.
#[test]
fn candidates_of_spheres_far_from_the_origin_lose_no_pair() {
    let farthest = [1e30, -1e30, 1e30];
    // Candidates serve up to 2²⁰ lengths away from an orthogonal box.
    for (number, offset) in [(0, farthest), (1, [1e24, -1e24, 1e30]), (3, farthest)] {
        let magnitude = Magnitude { exponent: 59, offset };
        let mut random = Random(43);
        let mut base = scene(300, &mut random);
        let (unit, space) = (magnitude.unit(), magnitude.spaces()[number]);
        let mut steps = Vec::new();
        for step in 0..7 {
            let spheres = magnitude.spheres(&base);
            steps.push((Columns::from_rows(&spheres), oracle(&spheres, &space, None)));
            let longest = if step == 3 { 0.2 } else { 0.002 };
            for sphere in &mut base {
                (0..3).for_each(|axis| sphere[axis] += longest * random.signed());
            }
        }
        let pairs: Vec<_> = steps.iter().map(|(_, pairs)| pairs).collect();
        assert!(pairs.windows(2).any(|pairs| pairs[0] != pairs[1]), "nothing moves");
        for variant in cell_lists() {
            let skin = Skin::Fixed(0.05 * unit);
            let config = variant.settings().space(space).skin(skin).order(Order::Canonical);
            let served = in_pool(variant.threads(), || serve(&config, 0, &steps, false));
            let served = served.unwrap_or_else(|text| panic!("{variant}, {space:?}, {text}"));
            assert!(served > 3, "{variant}, {space:?}: {served} of 7 calls were served");
        }
    }
}

fn is_out_of_range<T: std::fmt::Debug>(result: Result<T, Error>, range: [f64; 2]) -> bool {
    let Err(Error::Input(InputError::CoordinateRange { axis: 'x', from, to, limit })) = result else {
        return false;
    };
    [from, to] == range && limit < to - from
}

/// The number of cell vectors between these spheres is no `f64` number.
#[test]
fn uncountable_cell_vectors_are_refused() {
    let cell = [[1e-300, 0.0, 0.0], [4e-301, 1e-300, 0.0], [-3e-301, 2e-301, 1e-300]].map(Some);
    for vectors in [cell, [cell[0], cell[1], None], [None, cell[1], None]] {
        let space = Space::triclinic(vectors).expect("a cell");
        for variant in variants::each_algorithm() {
            let mut detector = Detector::new(variant.settings().space(space)).expect("a detector");
            let far = [[0.0, 0.0, 0.0, 1e-300], [1e20, 1e20, 0.0, 1e-300]];
            let near = [far[0], [1.2e-300, 0.0, 0.0, 1e-300]];
            variant.run(|| {
                assert_eq!(detector.count(&near), Ok(1), "{variant}, {vectors:?}");
                let refused = detector.pairs(&far).map(<[Pair]>::len);
                assert!(is_out_of_range(refused, [0.0, 1e20]), "{variant}, {vectors:?}");
                assert!(is_out_of_range(detector.count(&far), [0.0, 1e20]), "{variant}, {vectors:?}");
                let refused = detector.count((&far[..1], &far[1..]));
                assert!(is_out_of_range(refused, [0.0, 1e20]), "{variant}, {vectors:?}");
                let refused = detector.count(&[[1.0_f32, 0.0, 0.0, 0.1], [1e20; 4]]);
                assert!(is_out_of_range(refused, [1.0, 1e20_f32.into()]), "{variant}, {vectors:?}");
                assert_eq!(detector.count(&near), Ok(1), "{variant}, {vectors:?}");
            });
        }
    }
    let error = InputError::CoordinateRange { axis: 'x', from: 0.0, to: 1e20, limit: 1e6 };
    assert!(error.to_string().contains("from 0e0 to 1e20 are more than 1e6 apart"), "{error}");
}

#[test]
fn sphere_that_leaves_the_range_of_candidates_is_refused() {
    let space = spaces_of(|length| length)[3];
    let mut spheres = scene(300, &mut Random(47));
    let expected = oracle(&spheres, &space, None);
    for variant in cell_lists() {
        let config = variant.settings().space(space).skin(Skin::Fixed(0.05));
        let mut detector = Detector::new(config).expect("a detector");
        variant.run(|| {
            for _ in 0..3 {
                assert_eq!(detector.pairs(&spheres), Ok(&expected[..]), "{variant}");
            }
            let stats = detector.report().candidates.expect("a list");
            assert_eq!(stats.rebuilt, None, "{variant}");
            let coordinate = std::mem::replace(&mut spheres[7][0], 1e308);
            let refused = detector.count(&spheres);
            let is_named = matches!(refused, Err(Error::Input(InputError::CoordinateRange { .. })));
            assert!(is_named, "{variant}: {refused:?}");
            spheres[7][0] = coordinate;
            assert_eq!(detector.pairs(&spheres), Ok(&expected[..]), "{variant}");
        });
    }
}
