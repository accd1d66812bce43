mod crowds;

use std::ops::Range;

use lazygrid_kernels::{Algorithm, Interaction, Interactions, Pair, Space, Sphere, Spheres};

use super::{CellList, DensityCache, max_cells};
use crate::compare::{ChunkTarget, ChunkedOutput, PairTest};
use crate::executor::Executor;
use crate::input::{Division, Preparation, SearchInput};
use crate::test_support::{Random, assert_matches_naive, new_detector};
use crate::{Order, Report, Settings, Simd};

fn pairs(spheres: &[Sphere], algorithm: Algorithm, simd: Simd) -> Vec<Pair> {
    let settings = Settings { algorithm, simd, order: Order::Canonical, ..Settings::default() };
    let mut detector = new_detector(settings);
    detector.pairs(spheres).expect("the spheres are valid").to_vec()
}

fn scattered(n: u32, sizes: u32, spread: f32) -> Vec<Sphere> {
    let mut random = Random(7);
    (0..n)
        .map(|k| {
            let center = random.point(0.5).map(|x| spread * x * x.abs());
            Sphere::new(center, 0.5_f32.powi((k % (sizes + 1)) as i32))
        })
        .collect()
}

#[test]
fn every_simd_width_matches_naive() {
    for (n, sizes, spread) in [(0, 0, 1.0), (1, 0, 1.0), (17, 0, 9.0), (3000, 0, 60.0), (3000, 9, 40.0)] {
        let spheres = scattered(n, sizes, spread);
        let expected = pairs(&spheres, Algorithm::Naive, Simd::Portable);
        for simd in [Simd::Portable, Simd::Avx2, Simd::Avx512] {
            assert_eq!(pairs(&spheres, Algorithm::Naive, simd), expected, "naive, {n}, {simd:?}");
            assert_eq!(pairs(&spheres, Algorithm::CellList, simd), expected, "{n}, {simd:?}");
        }
    }
}

#[test]
fn agrees_with_all_pairs() {
    assert_matches_naive(&Settings { algorithm: Algorithm::CellList, ..Settings::default() });
}

#[test]
fn gas_in_a_periodic_box_matches_naive() {
    let spheres: Vec<_> = scattered(6000, 0, 60.0)
        .into_iter()
        .map(|sphere| Sphere::new((sphere.center * 17.0) % 15.0, 0.5))
        .collect();
    for lengths in [[Some(15.0); 3], [Some(15.0), None, None], [None, Some(15.0), Some(14.0)]] {
        let space = Space::periodic(lengths).expect("a box");
        let pairs = |algorithm, simd| {
            let settings = Settings { algorithm, simd, space, ..Settings::default() };
            let mut detector = new_detector(settings);
            detector.pairs(&spheres).expect("the spheres are valid").to_vec()
        };
        let expected = pairs(Algorithm::Naive, Simd::Portable);
        for simd in [Simd::Portable, Simd::Avx2, Simd::Avx512] {
            assert!(pairs(Algorithm::CellList, simd) == expected, "{lengths:?}, {simd:?}");
            assert!(pairs(Algorithm::Naive, simd) == expected, "naive, {lengths:?}, {simd:?}");
        }
    }
}

#[test]
fn folded_table_matches_naive() {
    let mut at = glam::Vec3::new(-700.0, 400.0, 90.0);
    let mut spheres = scattered(2000, 3, 30.0);
    for sphere in &mut spheres {
        at += sphere.center.abs() * 0.1 + 0.05;
        sphere.center = at;
    }
    let expected = pairs(&spheres, Algorithm::Naive, Simd::Portable);
    assert!(expected.len() > 1000);
    assert_eq!(pairs(&spheres, Algorithm::CellList, Simd::detect()), expected);
}

#[test]
fn groups_of_species_match_naive() {
    let kinds = [Interaction::Never, Interaction::Touch, Interaction::Within(0.9), Interaction::Within(4.0)];
    for seed in 0..60_u32 {
        let species = 1 + seed % 7;
        let mut table = Interactions::new(species, Interaction::Never).expect("a table");
        let uniform = seed % 3 == 0;
        for (k, (a, b)) in (0..species).flat_map(|a| (0..=a).map(move |b| (a, b))).enumerate() {
            let mixed = (seed * 31 + k as u32).wrapping_mul(2_654_435_761) >> 16;
            let kind = if uniform { mixed % 2 * (1 + seed % 2) } else { mixed % 4 };
            table.set(a, b, kinds[kind as usize]).expect("species of the table");
        }
        let (n, extent) = match seed % 20 {
            13 => (3000_u32, 0.2),
            _ => (900, if seed % 5 == 0 { 4.0 } else { 25.0 }),
        };
        let all = scattered(n, seed % 4, extent);
        let ids: Vec<u32> =
            (0..n).map(|k| (k.wrapping_mul(2_654_435_761) >> 20) % species.max(2) % species).collect();
        let subset = |range: Range<usize>| {
            Spheres::from(&all[range.clone()]).with_species(&ids[range]).expect("as many")
        };
        let spheres = subset(0..all.len());
        let space = match seed % 4 {
            3 => Space::periodic([Some(16.0), None, Some(17.5)]).expect("a box"),
            _ => Space::UNBOUNDED,
        };
        let settings = Settings { interactions: Some(table), space, ..Settings::default() };
        for split in [None, Some(300)] {
            let mut report = Report::default();
            let mut buffers = crate::QueryBuffers::default();
            let phases = &mut report.phases;
            let query = spheres.into();
            let preparation = Preparation {
                settings: &settings,
                wraps: true,
                has_same_species: false,
                uses_only_radii: false,
            };
            let prepared = buffers.prepare(&query, preparation, Executor::Caller, phases);
            let prepared = prepared.expect("all are valid");
            let test = prepared.test(&settings);
            let groups = prepared.groups;
            let searched = SearchInput::with_stats(test, &settings);
            let executor = Executor::Caller;
            let mut input = SearchInput { executor, split, groups, ..searched };
            let mut expected = Vec::new();
            for i in 0..n {
                for j in i + 1..n {
                    let is_requested = split.is_none_or(|split| (i < split as u32) != (j < split as u32));
                    if is_requested && input.test.is_pair(i, j) {
                        expected.push(Pair { i, j });
                    }
                }
            }
            for division in [Division::Merged, Division::ByPartners, Division::ByDistance] {
                let mut list = CellList::default();
                let density_cache = DensityCache::from_last(None, &input)
                    .expect("there is memory")
                    .with_division(division, &input);
                list.build(&input, &density_cache, &mut report).expect("there is memory");
                if list.touch_decides() {
                    input.test.decided_by_radii();
                }
                let output = ChunkedOutput::new(
                    ChunkTarget::List { limit: u64::MAX, collected: 0.into() },
                    Vec::new(),
                );
                let (_, chunks) =
                    list.search(&input, &output).and_then(|sink| sink.finish()).expect("there is memory");
                let mut found = chunks.concat();
                found.sort_unstable();
                assert!(found == expected, "seed {seed}, {split:?}, {division:?}");
            }
            for &algorithm in Algorithm::CPU {
                let settings = Settings { algorithm, threads: Some(1), ..settings.clone() };
                let mut detector = new_detector(settings);
                let first = split.unwrap_or(0);
                let found = match split {
                    None => detector.pairs(spheres),
                    Some(split) => detector.pairs((subset(0..split), subset(split..all.len()))),
                };
                let found: Vec<_> = found
                    .expect("the spheres are valid")
                    .iter()
                    .map(|pair| Pair { i: pair.i, j: pair.j + first as u32 })
                    .collect();
                assert!(found == expected, "seed {seed}, {split:?}, {algorithm}");
            }
        }
    }
}

#[test]
fn slightly_too_many_cells_do_not_fold_the_table() {
    // Sums of four coordinates are about normal, so the smallest cells are best.
    let cloud: Vec<_> = scattered(80_000, 0, 1e5)
        .chunks(4)
        .map(|four| Sphere::new(four.iter().map(|sphere| sphere.center).sum::<glam::Vec3>(), 1.0))
        .collect();
    for shift in 0..10 {
        let mut spheres = cloud.clone();
        spheres.iter_mut().for_each(|sphere| sphere.center += 1700.0 * shift as f32);
        let settings = Settings::default();
        let input = SearchInput::with_stats(PairTest::new((&spheres).into(), None), &settings);
        let mut list = CellList::default();
        let density_cache = DensityCache::from_last(None, &input).expect("there is memory");
        list.build(&input, &density_cache, &mut Report::default()).expect("there is memory");
        assert!(list.levels.iter().all(|level| !level.grid.folded), "{:?}", list.levels);
    }
}

/// The difference of the centers rounds to the giant's radius.
#[test]
fn giant_touches_points_of_another_group_by_rounding_alone() {
    let giant = Sphere::new([1_048_576.0, 0.0, 0.0], 1_048_576.0);
    let points = (0..1000).map(|k| Sphere::new([if k < 500 { -1e-10 } else { 0.0 }, 0.0, 0.0], 0.0));
    let spheres: Vec<_> = std::iter::once(giant).chain(points).collect();
    let ids: Vec<u32> = (0..1001).map(|k| u32::from(k == 0)).collect();
    let mut table = Interactions::new(2, Interaction::Never).expect("few species");
    table.set(0, 1, Interaction::Touch).expect("known species");
    for space in [Space::UNBOUNDED, Space::periodic([None, Some(1e7), None]).expect("a box")] {
        let count = |algorithm| {
            let settings =
                Settings { algorithm, interactions: Some(table.clone()), space, ..Settings::default() };
            let mut detector = new_detector(settings);
            detector.count(Spheres::from(&spheres).with_species(&ids).expect("one id for each"))
        };
        assert_eq!((count(Algorithm::Naive), count(Algorithm::CellList)), (Ok(1000), Ok(1000)), "{space:?}");
    }
}

#[test]
fn numbers_of_all_cells_have_32_bits() {
    assert_eq!([1, 64].map(max_cells), [1 << 26, (1 << 26) - 1]);
    for levels in [1, 20, 65, 200] {
        assert!(levels as u64 * max_cells(levels) <= u64::from(u32::MAX), "{levels}");
    }
}
