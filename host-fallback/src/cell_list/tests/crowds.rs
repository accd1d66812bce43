use std::ops::Range;

use lazygrid_kernels::{Algorithm, Interaction, Interactions, Query, Space, Sphere, Spheres};

use super::super::{CellList, DensityCache};
use crate::executor::Executor;
use crate::input::{Division, Preparation, SearchInput};
use crate::test_support::{Random, is_served, new_detector};
use crate::{QueryBuffers, Report, Settings, Skin};

fn crowd(n: usize, (others, width): (usize, f32)) -> Vec<Sphere> {
    let mut random = Random(3);
    let mut center = |k: usize| if k < n { random.point(0.5) } else { random.point(width / 2.0) };
    (0..n + others).map(|k| Sphere::new(center(k), 0.004)).collect()
}

fn species(n: usize, others: usize) -> Vec<u32> {
    (0..n + others).map(|k| u32::from(k >= n)).collect()
}

fn table(of_last: Interaction) -> Interactions {
    let mut table = Interactions::new(3, Interaction::Within(3.0)).expect("few species");
    table.set(0, 0, Interaction::Within(0.008)).expect("known species");
    table.set(1, 1, of_last).expect("known species");
    (0..3).for_each(|with| table.set(2, with, Interaction::Within(50.0)).expect("known species"));
    table
}

fn build(spheres: Spheres<'_>, settings: &Settings) -> (CellList, Division) {
    let (mut list, mut report, mut buffers) =
        (CellList::default(), Report::default(), QueryBuffers::default());
    let query = spheres.into();
    let preparation = Preparation { settings, wraps: true, has_same_species: false, uses_only_radii: false };
    let prepared = buffers.prepare(&query, preparation, Executor::Caller, &mut report.phases).expect("valid");
    let searched = SearchInput::with_stats(prepared.test(settings), settings);
    let input = SearchInput { groups: prepared.groups, ..searched };
    let cache = DensityCache::from_last(None, &input).expect("there is memory");
    list.build(&input, &cache, &mut report).expect("there is memory");
    (list, cache.division())
}

fn spaces() -> [Space; 3] {
    let lengths = [[None; 3], [Some(60.0); 3], [Some(60.0), None, Some(61.0)]];
    lengths.map(|lengths| Space::periodic(lengths).expect("a box"))
}

#[test]
fn crowd_among_distant_spheres_has_small_cells() {
    for space in spaces() {
        let settings = Settings { space, algorithm: Algorithm::CellList, ..Settings::default() };
        let spheres = crowd(54_000, (6000, 60.0));
        let (list, _) = build((&spheres).into(), &settings);
        let most = list.starts.windows(2).map(|cell| cell[1] - cell[0]).max();
        assert!(most.is_some_and(|most| most < 60), "{most:?} spheres in a cell of {:?}", list.levels);
        let pairs = |algorithm| {
            let settings = Settings { algorithm, ..settings.clone() };
            new_detector(settings).pairs(&spheres).expect("valid").to_vec()
        };
        assert_eq!(pairs(Algorithm::CellList), pairs(Algorithm::Naive), "{space:?}");
    }
}

#[test]
fn crowded_species_is_divided_by_its_own_distance() {
    let (n, others) = (3600, 400);
    let (spheres, ids) = (crowd(n, (others, 60.0)), species(n, others));
    let spheres_with_ids = Spheres::from(&spheres).with_species(&ids).expect("one id for each");
    for of_last in [Interaction::Never, Interaction::Within(0.1), Interaction::Within(3.0)] {
        for space in spaces() {
            let interactions = Some(table(of_last));
            let settings = Settings { space, interactions, ..Settings::default() };
            let (list, division) = build(spheres_with_ids, &settings);
            assert_eq!(division, Division::ByDistance, "{of_last:?}, {space:?}");
            let of_crowd = &list.levels[0];
            assert_eq!(of_crowd.members, 0..n);
            let first = of_crowd.base..of_crowd.base + of_crowd.grid.cells() as usize;
            let most = list.starts[first].windows(2).map(|cell| cell[1] - cell[0]).max();
            assert!(most.is_some_and(|most| most < 60), "{most:?} spheres in a cell");
        }
    }
}

fn wide(spheres: &[Sphere]) -> Vec<[f64; 4]> {
    let row = |sphere: &Sphere| [sphere.center.x, sphere.center.y, sphere.center.z, sphere.radius];
    spheres.iter().map(|sphere| row(sphere).map(f64::from)).collect()
}

#[test]
fn groups_with_cells_for_their_own_radius_match_naive() {
    let (n, others) = (1000, 500);
    let (mut spheres, ids) = (crowd(n, (others, 12.0)), species(n, others));
    spheres.iter_mut().for_each(|sphere| sphere.center += 30.0);
    let rows = wide(&spheres);
    let tilted = [Some([60.0, 0.0, 0.0]), Some([20.0, 61.0, 0.0]), Some([-9.0, 7.0, 62.0])];
    let spaces = spaces().into_iter().chain([Space::triclinic(tilted).expect("a cell")]);
    for (k, space) in spaces.enumerate() {
        for of_last in [Interaction::Never, Interaction::Touch, Interaction::Within(3.0)] {
            let interactions = Some(table(of_last));
            let answers = |algorithm, skin| {
                let interactions = interactions.clone();
                let settings = Settings { algorithm, skin, space, interactions, ..Settings::default() };
                let mut detector = new_detector(settings);
                let of_f32 = |range: Range<usize>| {
                    Spheres::from(&spheres[range.clone()]).with_species(&ids[range]).expect("an id for each")
                };
                let of_f64 = Spheres::from(&rows).with_species(&ids).expect("an id for each");
                let (all, sets) = (of_f32(0..n + others), (of_f32(0..n / 2), of_f32(n / 2..n + others)));
                let queries: [Query<'_>; 5] =
                    [all.into(), all.into(), of_f64.into(), of_f64.into(), sets.into()];
                queries.map(|query| detector.pairs(query).expect("valid").to_vec())
            };
            let expected = answers(Algorithm::Naive, Skin::Off);
            assert!(expected.iter().all(|pairs| !pairs.is_empty()));
            for skin in [Skin::Off, Skin::Fixed(0.01)] {
                assert!(answers(Algorithm::CellList, skin) == expected, "space {k}, {of_last:?}, {skin:?}");
            }
        }
    }
}

#[test]
fn group_at_one_point_is_found_by_others() {
    let (mut random, point) = (Random(3), [3.0; 3]);
    let crowd = (0..3600).map(|_| (random.point(0.5), 0));
    let few = (0..4).map(|k| ([4.0 + 0.1 * k as f32, 3.0, 3.0], 1));
    let at_point = (0..1000).map(|_| (point, 2));
    let (spheres, ids): (Vec<_>, Vec<u32>) =
        crowd.chain(few).chain(at_point).map(|(center, id)| (Sphere::new(center, 0.004), id)).unzip();
    let mut table = Interactions::new(3, Interaction::Never).expect("few species");
    for (a, b, distance) in [(0, 0, 0.008), (0, 1, 3.0), (1, 2, 3.0)] {
        table.set(a, b, Interaction::Within(distance)).expect("known species");
    }
    for space in spaces() {
        let settings = Settings { space, interactions: Some(table.clone()), ..Settings::default() };
        let spheres_with_ids = Spheres::from(&spheres).with_species(&ids).expect("an id for each");
        assert_eq!(build(spheres_with_ids, &settings).1, Division::ByDistance, "{space:?}");
        let count = |algorithm| {
            let settings = Settings { algorithm, ..settings.clone() };
            new_detector(settings).count(spheres_with_ids).expect("valid")
        };
        assert_eq!(count(Algorithm::CellList), count(Algorithm::Naive), "{space:?}");
    }
}

/// Distances to other species hide growing radii in a crowd.
#[test]
fn radii_that_grow_in_a_divided_crowd_lose_no_pair() {
    let (n, others) = (3600, 400);
    for (width, distance, may_serve) in [(1.0, 3.0, false), (8.0, 1.0, true)] {
        let (mut spheres, ids) = (crowd(n, (others, 60.0)), species(n, others));
        spheres[..n].iter_mut().for_each(|sphere| sphere.center *= width);
        let mut table = Interactions::new(2, Interaction::Within(distance)).expect("few species");
        table.set(0, 0, Interaction::Touch).expect("known species");
        for skin in [Skin::Fixed(0.01), Skin::Fixed(0.1), Skin::Auto] {
            let settings = Settings { skin, interactions: Some(table.clone()), ..Settings::default() };
            let naive = Settings { algorithm: Algorithm::Naive, skin: Skin::Off, ..settings.clone() };
            let spheres_with_ids = Spheres::from(&spheres).with_species(&ids).expect("an id for each");
            assert_eq!(build(spheres_with_ids, &settings).1, Division::ByDistance, "{width}");
            let [mut detector, mut naive] = [settings, naive].map(new_detector);
            let mut served = 0;
            for radius in [0.004, 0.004, 0.1, 0.02, 0.3] {
                spheres.iter_mut().for_each(|sphere| sphere.radius = radius);
                let spheres_with_ids = Spheres::from(&spheres).with_species(&ids).expect("an id for each");
                let expected = naive.count(spheres_with_ids).expect("valid");
                assert_eq!(
                    detector.count(spheres_with_ids),
                    Ok(expected),
                    "{width}, {skin:?}, radius {radius}"
                );
                served += usize::from(is_served(&detector));
            }
            assert!(served > 0 || !may_serve, "{skin:?}");
            spheres.iter_mut().for_each(|sphere| sphere.radius = 0.004);
        }
    }
}
