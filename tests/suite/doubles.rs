//! `f64` spheres: each algorithm finds exactly the pairs of the contract's expression.

use lazygrid::{
    Backend, Config, Detector, Error, Exclusions, InputError, Interaction, Interactions, Order, Pair, Query,
    Radii, Skin, Space, Sphere, Spheres,
};
use lazygrid_io::scenes::Scene;
use lazygrid_tests::results::match_the_list;
use lazygrid_tests::{DetectorVariant, SuiteVariant, in_pool, variants};

pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// Every second sphere touches the previous one, up to 2 ulp or 2⁻¹⁶ to 2⁻²⁷ of its radius.
pub(crate) fn scene(count: usize, extent: f64, offset: [f64; 3], random: &mut Random) -> Vec<[f64; 4]> {
    let mut spheres: Vec<[f64; 4]> = Vec::new();
    for k in 0..count {
        let radius = [0.3, 0.017, 0.11, 0.0][k / 2 % 4] * (1.0 + 0.1 * random.signed());
        let [x, y, z] = [0, 1, 2].map(|axis: usize| offset[axis] + extent * random.signed());
        spheres.push(match spheres.last() {
            Some(&[a, b, c, r]) if k % 2 == 1 => {
                let apart = [random.signed(), random.signed(), random.signed()];
                let length = (apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2]).sqrt();
                let scale = (r + radius) / length;
                let center = [a + apart[0] * scale, b + apart[1] * scale, c + apart[2] * scale];
                let off = (k / 2 % 5) as i64 - 2;
                let factor = 1.0 + (off.signum() as f64) * 0.5_f64.powi(16 + (k / 20 % 12) as i32);
                let radius = match k / 10 % 2 {
                    0 => f64::from_bits((radius.to_bits() as i64 + off).max(0) as u64),
                    _ => radius * factor,
                };
                [center[0], center[1], center[2], radius]
            }
            _ => [x, y, z, radius],
        });
    }
    spheres
}

const IMAGE_RANGE: std::ops::RangeInclusive<i32> = -2..=2;

fn images(space: &Space) -> Vec<[f64; 3]> {
    let vectors = space.cell_vectors();
    let [counts_a, counts_b, counts_c] =
        vectors.map(|vector| if vector.is_some() { IMAGE_RANGE } else { 0..=0 });
    let mut images = Vec::new();
    for a in counts_a {
        for b in counts_b.clone() {
            for c in counts_c.clone() {
                let counts = [a, b, c].map(f64::from);
                let term = |k: usize, axis: usize| vectors[k].map_or(0.0, |vector| counts[k] * vector[axis]);
                images.push([0, 1, 2].map(|axis| term(0, axis) + term(1, axis) + term(2, axis)));
            }
        }
    }
    images
}

fn distance_squared(images: &[[f64; 3]], from: [f64; 4], to: [f64; 4]) -> f64 {
    let apart = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
    let mut least = f64::INFINITY;
    for image in images {
        let [x, y, z] = [apart[0] + image[0], apart[1] + image[1], apart[2] + image[2]];
        least = least.min(x * x + y * y + z * z);
    }
    least
}

/// The species of sphere `k` is `k % 2`.
pub(crate) fn oracle(spheres: &[[f64; 4]], space: &Space, table: Option<&Interactions>) -> Vec<Pair> {
    let images = images(space);
    let mut pairs = Vec::new();
    for (j, b) in spheres.iter().enumerate() {
        for (i, a) in spheres[..j].iter().enumerate() {
            let cutoff = match table.map(|table| table.get(i as u32 % 2, j as u32 % 2)) {
                None | Some(Interaction::Touch) => a[3] + b[3],
                Some(Interaction::Within(distance)) => distance,
                Some(Interaction::Never) => continue,
            };
            if distance_squared(&images, *a, *b) <= cutoff * cutoff {
                pairs.push(Pair { i: i as u32, j: j as u32 });
            }
        }
    }
    pairs.sort_unstable();
    pairs
}

fn spaces() -> [Space; 5] {
    spaces_of(|length| length)
}

pub(crate) fn spaces_of(map: impl Fn(f64) -> f64) -> [Space; 5] {
    let tilts = [[7.3, 0.0, 0.0], [2.9, 6.1, 0.0], [-1.7, 0.4, 5.9]].map(|vector| Some(vector.map(&map)));
    let periodic = |lengths: [Option<f64>; 3]| Space::periodic(lengths.map(|length| length.map(&map)));
    [
        Space::UNBOUNDED,
        periodic([Some(10.1), Some(8.0 / 3.0), None]).expect("lengths"),
        periodic([Some(10.0), Some(7.0), Some(6.5)]).expect("lengths"),
        Space::triclinic(tilts).expect("cell vectors"),
        Space::triclinic([tilts[0], None, tilts[2]]).expect("cell vectors"),
    ]
}

pub(crate) fn agrees(detector: &mut Detector, query: Query<'_>, expected: &[Pair]) -> Result<(), String> {
    let found = detector.pairs(query).map_err(|error| error.to_string())?;
    if found != expected {
        let (extra, missing) = (
            found.iter().filter(|pair| !expected.contains(pair)).count(),
            expected.iter().filter(|pair| !found.contains(pair)).count(),
        );
        return Err(format!("{extra} of {} pairs are extra, {missing} are missing", found.len()));
    }
    match_the_list(detector, query, expected)
}

#[test]
fn pairs_match_the_contract_in_all_spaces_and_magnitudes() {
    let mut random = Random(7);
    for (number, space) in spaces().into_iter().enumerate() {
        for offset in [[0.0; 3], [1e3, -2e3, 5e2], [1e9, 1e9, -1e9]] {
            let spheres = scene(240, 2.4, offset, &mut random);
            let expected = oracle(&spheres, &space, None);
            assert!(expected.len() > 60, "{}", expected.len());
            // On a GPU, two offsets suffice, as the host subtracts the frame's origin.
            let is_asked = |variant: &DetectorVariant| variant.backend() == Backend::Cpu || offset[0] != 1e3;
            for variant in variants::each_algorithm().into_iter().filter(is_asked) {
                variant.run(|| {
                    let config = variant.settings().space(space).skin(Skin::Off);
                    let mut detector = Detector::new(config).expect("a detector");
                    agrees(&mut detector, Query::new(&spheres), &expected)
                        .unwrap_or_else(|text| panic!("{variant}, space {number}, {offset:?}: {text}"));
                });
            }
        }
    }
}

#[test]
fn equal_numbers_in_both_precisions_give_equal_pairs() {
    for scene in [Scene::Equal, Scene::FiveSizes, Scene::Burst] {
        let narrow = scene.spheres(1500, 3);
        let row = |sphere: &Sphere| {
            let [x, y, z] = sphere.center.to_array();
            [x, y, z, sphere.radius].map(f64::from)
        };
        let rows: Vec<_> = narrow.iter().map(row).collect();
        let column = |k: usize| rows.iter().map(|row| row[k]).collect::<Vec<_>>();
        let [x, y, z, r] = [0, 1, 2, 3].map(column);
        let centers: Vec<_> = rows.iter().map(|[x, y, z, _]| [*x, *y, *z]).collect();
        for variant in variants::each_algorithm() {
            let mut detector = Detector::new(variant.settings()).expect("a detector");
            let mut cpu = Detector::new(Config::default().backend(Backend::Cpu)).expect("a detector");
            let expected = cpu.pairs(&narrow).expect("valid");
            let columns = Spheres::columns(&x, &y, &z, &r).expect("one length");
            let points = Spheres::points(&centers, Radii::Each(&r)).expect("one length");
            for spheres in [Spheres::from(&rows), columns, points] {
                let found = variant.run(|| detector.pairs(spheres).map(<[Pair]>::to_vec));
                assert!(found.as_ref().is_ok_and(|found| found == expected), "{scene}, {variant}");
            }
        }
    }
}

#[test]
fn two_sets_species_and_exclusions_are_decided_in_f64() {
    let mut random = Random(13);
    let mut table = Interactions::new(2, Interaction::Touch).expect("few species");
    table.set(0, 1, Interaction::Within(0.1)).expect("a distance");
    table.set(1, 1, Interaction::Never).expect("known species");
    for space in spaces() {
        let spheres = scene(200, 1.5, [0.0; 3], &mut random);
        let species: Vec<u32> = (0..200).map(|k| k % 2).collect();
        let all = oracle(&spheres, &space, Some(&table));
        let excluded: Vec<_> = all.iter().step_by(3).map(|pair| (pair.i, pair.j)).collect();
        let exclusions = Exclusions::new(200, excluded.iter().copied()).expect("of spheres");
        let expected_pairs: Vec<Pair> =
            all.iter().filter(|pair| !excluded.contains(&(pair.i, pair.j))).copied().collect();
        let across: Vec<Pair> = all
            .iter()
            .filter(|pair| pair.i < 80 && pair.j >= 80)
            .map(|pair| Pair { i: pair.i, j: pair.j - 80 })
            .collect();
        let one = Spheres::from(&spheres).with_species(&species).expect("one each");
        let [a, b] = [0..80, 80..200].map(|range| {
            Spheres::from(&spheres[range.clone()]).with_species(&species[range]).expect("one each")
        });
        for variant in variants::each_algorithm() {
            let config = variant.settings().space(space).interactions(table.clone());
            let mut detector = Detector::new(config).expect("a detector");
            variant.run(|| {
                let among = agrees(&mut detector, Query::new(one).without(&exclusions), &expected_pairs);
                let across = agrees(&mut detector, Query::new((a, b)), &across);
                among.and(across).unwrap_or_else(|text| panic!("{variant}, {space:?}: {text}"));
            });
        }
    }
}

#[test]
fn candidates_of_f64_spheres_lose_no_pair() {
    let mut table = Interactions::new(2, Interaction::Touch).expect("few species");
    table.set(0, 1, Interaction::Never).expect("known species");
    table.set(1, 1, Interaction::Within(0.7)).expect("a distance");
    for (space, table) in [(spaces()[0], None), (spaces()[1], None), (spaces()[3], None)]
        .into_iter()
        .chain([spaces()[0], spaces()[1]].map(|space| (space, Some(&table))))
    {
        let mut random = Random(17);
        let mut spheres = scene(900, 2.4, [1e7, 0.0, -1e7], &mut random);
        let mut steps = Vec::new();
        for step in 0..9 {
            steps.push((Columns::from_rows(&spheres), oracle(&spheres, &space, table)));
            let far = if step == 5 { 0.2 } else { 0.002 };
            for sphere in &mut spheres {
                (0..3).for_each(|axis| sphere[axis] += far * random.signed());
            }
        }
        for variant in variants::each_algorithm() {
            if !matches!(variant.algorithm, lazygrid::Algorithm::CellList | lazygrid::Algorithm::Auto) {
                continue;
            }
            let config = variant.settings().space(space).skin(Skin::Fixed(0.05)).order(Order::Canonical);
            let config = table.iter().fold(config, |config, &table| config.interactions(table.clone()));
            in_pool(variant.threads(), || {
                for layout in 0..3 {
                    let served = serve(&config, layout, &steps, table.is_some());
                    let served = served.unwrap_or_else(|text| panic!("{variant}, layout {layout}, {text}"));
                    assert!(served > 4, "{variant}: {served} of 9 calls were served");
                }
            });
        }
    }
}

pub(crate) struct Columns {
    rows: Vec<[f64; 4]>,
    centers: Vec<[f64; 3]>,
    columns: [Vec<f64>; 4],
    species: Vec<u32>,
}

impl Columns {
    pub(crate) fn from_rows(rows: &[[f64; 4]]) -> Self {
        Self {
            rows: rows.to_vec(),
            centers: rows.iter().map(|[x, y, z, _]| [*x, *y, *z]).collect(),
            columns: [0, 1, 2, 3].map(|axis| rows.iter().map(|row| row[axis]).collect()),
            species: (0..rows.len() as u32).map(|k| k % 2).collect(),
        }
    }

    fn layout(&self, layout: usize) -> Spheres<'_> {
        let [x, y, z, r] = &self.columns;
        match layout {
            0 => Spheres::from(&self.rows),
            1 => Spheres::columns(x, y, z, r).expect("one length"),
            _ => Spheres::points(&self.centers, Radii::Each(r)).expect("one length"),
        }
    }
}

/// Returns the number of calls served by candidates.
pub(crate) fn serve(
    config: &Config,
    layout: usize,
    steps: &[(Columns, Vec<Pair>)],
    has_species: bool,
) -> Result<u32, String> {
    let mut detector = Detector::new(config.clone()).expect("a detector");
    let mut served = 0;
    for (step, (spheres, expected)) in steps.iter().enumerate() {
        let view = spheres.layout(layout);
        let view = if has_species { view.with_species(&spheres.species).expect("one each") } else { view };
        let found = detector.pairs(view).expect("valid");
        if found != expected {
            return Err(format!("step {step}: {} of {}", found.len(), expected.len()));
        }
        served += u32::from(detector.report().candidates.is_some_and(|stats| stats.rebuilt.is_none()));
    }
    Ok(served)
}

#[test]
fn calls_of_both_precisions_can_alternate() {
    let vectors = [Some([4.0, 0.0, 0.0]), Some([1.0, 4.0, 0.0]), Some([0.0, 1.0, 4.0])];
    let space = Space::triclinic(vectors).expect("cell vectors");
    let narrow = [[0.0_f32, 0.0, 0.0, 0.5], [0.9, 0.0, 0.0, 0.5], [2.0, 2.0, 0.0, 0.1]];
    let wide = [[0.0_f64, 0.0, 0.0, 1e300], [0.9, 0.0, 0.0, 0.5], [2.0, 2.0, 0.0, 0.1]];
    for variant in variants::each_algorithm() {
        let mut detector = Detector::new(variant.settings().space(space)).expect("a detector");
        for _ in 0..2 {
            assert_eq!(detector.count(&narrow), Ok(1), "{variant}");
            assert_eq!(detector.count(&wide), Ok(2), "{variant}");
        }
    }
}

#[test]
fn calls_without_spheres_change_no_later_one() {
    let mut random = Random(19);
    for (number, space) in spaces().into_iter().enumerate() {
        let spheres = scene(240, 2.4, [0.0; 3], &mut random);
        let expected = oracle(&spheres, &space, None);
        let narrow: Vec<[f32; 4]> = spheres.iter().map(|sphere| sphere.map(|number| number as f32)).collect();
        let exact: Vec<[f64; 4]> = narrow.iter().map(|sphere| sphere.map(f64::from)).collect();
        let expected_narrow = oracle(&exact, &space, None);
        for variant in variants::each_algorithm() {
            let new = || Detector::new(variant.settings().space(space)).expect("a detector");
            let (mut wide, mut rounded) = (new(), new());
            variant.run(|| {
                for _ in 0..2 {
                    assert_eq!(wide.count(&[[0.0_f64; 4]; 0]), Ok(0), "{variant}, space {number}");
                    agrees(&mut wide, Query::new(&spheres), &expected)
                        .unwrap_or_else(|text| panic!("{variant}, space {number}: {text}"));
                    assert_eq!(rounded.count(&[[0.0_f32; 4]; 0]), Ok(0), "{variant}, space {number}");
                    let found = rounded.count(&narrow).expect("valid");
                    let is_on_cpu = variant.backend() == Backend::Cpu;
                    assert!(!is_on_cpu || found == expected_narrow.len() as u64, "{variant}, space {number}");
                }
            });
        }
    }
}

#[test]
fn bad_f64_spheres_are_named_with_their_numbers() {
    let good = [0.1, 0.2, 0.3, 1.0];
    for bad in [[f64::NAN, 0.0, 0.0, 1.0], [0.0, f64::INFINITY, 0.0, 1.0], [0.0, 0.0, 0.0, -1e-320]] {
        let spheres = [good, good, bad, good];
        for variant in variants::each_algorithm() {
            let mut detector = Detector::new(variant.settings()).expect("a detector");
            for query in [Query::new(&spheres), Query::new((&spheres, &[good]))] {
                let error = detector.count(query).expect_err("a bad sphere");
                let Error::Input(InputError::Sphere { index: 2, radius, count: 1, total: 4, .. }) = error
                else {
                    panic!("{variant}: {error}")
                };
                assert_eq!(radius.to_bits(), bad[3].to_bits(), "{variant}");
            }
            assert_eq!(detector.count(&[good, good]), Ok(1), "{variant}");
        }
    }
}
