//! Inputs that are hard for grids, and comparisons with naive.

use glam::Vec3;
use lazygrid_kernels::{Algorithm, Interaction, Interactions, Pair, Space, Sphere, Spheres};

use crate::{HostDetector, Order, Settings};

pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }

    pub(crate) fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    pub(crate) fn point(&mut self, scale: f32) -> [f32; 3] {
        [(); 3].map(|()| scale * self.unit())
    }
}

fn many(n: usize, seed: u64, mut sphere: impl FnMut(&mut Random, usize) -> ([f32; 3], f32)) -> Vec<Sphere> {
    let mut random = Random(seed);
    (0..n).map(|k| sphere(&mut random, k)).map(|(center, radius)| Sphere::new(center, radius)).collect()
}

pub(crate) fn inputs() -> Vec<(&'static str, Vec<Sphere>)> {
    let shifted = |by: f32, mut spheres: Vec<Sphere>| {
        spheres.iter_mut().for_each(|sphere| sphere.center += by);
        spheres
    };
    let powers = |random: &mut Random, steps: u64| (-((random.next() % steps) as f32)).exp2();
    let lattice = |spacing: f32| {
        many(512, 0, |_, k| ([k / 64, k / 8 % 8, k % 8].map(|c| spacing * c as f32), spacing / 2.0))
    };
    vec![
        ("none", Vec::new()),
        ("one", many(1, 0, |_, _| ([1.0; 3], 1.0))),
        ("two that touch", many(2, 0, |_, k| ([2.0 * k as f32, 0.0, 0.0], 1.0))),
        ("two apart", many(2, 0, |_, k| ([3.0 * k as f32, 0.0, 0.0], 1.0))),
        ("two at the ends of space", many(2, 0, |_, k| ([[f32::MAX, f32::MIN][k]; 3], 1e-6))),
        ("two that fill space", many(2, 0, |_, k| ([[f32::MAX, f32::MIN][k]; 3], f32::MAX))),
        ("lattice in contact", lattice(1.0)),
        ("lattice in contact, fifths", lattice(0.2)),
        ("lattice in contact, far", shifted(4096.0, lattice(0.25))),
        ("gas", many(900, 1, |r, _| (r.point(8.0), 0.5))),
        ("dense gas", many(500, 2, |r, _| (r.point(2.0), 0.5))),
        ("duplicates", many(600, 3, |r, _| (r.point(3.0).map(f32::round), 0.25))),
        ("one point", many(400, 4, |_, _| ([1.7; 3], 0.25))),
        ("one point, the origin", many(400, 4, |_, _| ([0.0; 3], 0.25))),
        ("one point, the origin, many sizes", many(500, 5, |r, _| ([0.0; 3], powers(r, 10)))),
        ("one point, many sizes", many(500, 5, |r, _| ([-3.3; 3], powers(r, 10)))),
        ("giant among tiny", many(800, 6, |r, k| (r.point(1000.0), if k == 99 { 1e3 } else { 1e-3 }))),
        ("giant among clustered tiny", {
            many(800, 7, |r, k| if k == 99 { ([9.0; 3], 1e3) } else { (r.point(0.01), 1e-3) })
        }),
        ("powers of two", many(700, 8, |r, _| (r.point(4.0), powers(r, 11)))),
        ("powers of two, wide", many(700, 9, |r, _| (r.point(2.0), powers(r, 40)))),
        ("all scales at once", {
            many(600, 10, |r, _| {
                let scale = powers(r, 60);
                (r.point(scale), scale / 8.0)
            })
        }),
        ("line", many(700, 11, |r, _| ([r.unit() * 50.0, 1.0, 2.0], 0.5 * powers(r, 5)))),
        ("plane", many(700, 12, |r, _| ([r.unit() * 9.0, -7.0, r.unit() * 9.0], 0.5 * powers(r, 5)))),
        ("clusters of clusters", {
            many(700, 13, |r, k| {
                let center = [k % 2, k % 4 / 2, k % 8 / 4].map(|c| c as f32 * 100.0);
                let middle = [k % 16 / 8, k % 32 / 16, k % 64 / 32].map(|c| c as f32 * 5.0);
                let inner = r.point(0.3);
                ([0, 1, 2].map(|a| center[a] + middle[a] + inner[a]), 0.1 * powers(r, 6))
            })
        }),
        ("far from the origin", shifted(1e9, many(400, 14, |r, _| (r.point(1000.0), 40.0)))),
        ("far and small", shifted(1e9, many(400, 15, |r, _| (r.point(200.0), 0.01)))),
        ("subnormal", many(400, 16, |r, _| (r.point(1e-40), 1e-41))),
        ("subnormal among normal", many(400, 17, |r, k| (r.point(1e-38), [1e-41, 1e-37][k % 2]))),
        ("smallest", many(400, 18, |r, _| (r.point(3.0).map(|c| c.round() * 1.4e-45), 1.4e-45))),
        ("points", many(600, 19, |r, _| (r.point(4.0).map(f32::round), 0.0))),
        ("points at one point", many(300, 20, |_, _| ([5.0, 6.0, 7.0], 0.0))),
        ("points and spheres", many(700, 21, |r, k| (r.point(3.0), [0.0, 0.3][k % 2]))),
        ("ends of space", many(400, 22, |r, _| (r.point(1.4).map(|c| f32::MAX * c.round()), 1e-6))),
        ("space filled", many(400, 23, |r, _| (r.point(f32::MAX), 1e37))),
        ("huge and tiny everywhere", {
            many(500, 24, |r, k| {
                let scale = [1.0, 1e10, 1e20, 1e30, 3e38][k % 5];
                (r.point(scale), scale * [0.1, 1e-7][k / 5 % 2])
            })
        }),
        ("crowds of coincident", many(600, 25, |r, k| (r.point(1.0).map(f32::round), [1.0, 1e-4][k % 2]))),
    ]
}

fn reactions() -> Interactions {
    let mut table = Interactions::new(3, Interaction::Touch).expect("three species");
    table.set(0, 1, Interaction::Within(0.7)).expect("a distance");
    table.set(2, 2, Interaction::Never).expect("species of the table");
    table
}

fn spaces(spheres: &[Sphere]) -> Vec<Space> {
    let corners = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (min, max) = spheres.iter().fold(corners, |(a, b), s| (a.min(s.center), b.max(s.center)));
    let extent = (max.as_dvec3() - min.as_dvec3()).max_element().max(1e-44);
    let space = |fractions: [f64; 3]| {
        let length = |fraction: f64| {
            (fraction > 0.0).then_some(f64::from((fraction * extent).min(f64::from(f32::MAX)) as f32))
        };
        Space::periodic(fractions.map(length)).unwrap_or_default()
    };
    [[1.0, 1.0, 1.0], [0.37, 0.0, 0.81], [0.0, 0.0, 0.11], [3.0, 1.7, 0.02]].map(space).into()
}

pub(crate) fn new_detector(settings: Settings) -> HostDetector {
    HostDetector::new(settings).expect("settings within range")
}

/// Returns `true` if candidates of an earlier call answered the last one.
pub(crate) fn is_served(detector: &HostDetector) -> bool {
    detector.report().candidates.is_some_and(|list| list.rebuilt.is_none())
}

pub(crate) fn pairs(spheres: Spheres<'_>, settings: &Settings) -> Vec<Pair> {
    let mut detector = new_detector(settings.clone());
    let first = detector.pairs(spheres).expect("valid spheres").to_vec();
    let count = detector.count(spheres).expect("valid spheres");
    assert_eq!(count, first.len() as u64, "counted and listed");
    assert!(detector.pairs(spheres).expect("valid spheres") == first, "the second call differs");
    first
}

pub(crate) fn assert_matches_naive(settings: &Settings) {
    for (name, spheres) in inputs() {
        for space in spaces(&spheres) {
            let with = |algorithm, threads| Settings {
                algorithm,
                space,
                threads: Some(threads),
                ..settings.clone()
            };
            let expected = pairs((&spheres).into(), &with(Algorithm::Naive, 1));
            for threads in [1, 2] {
                let found = pairs((&spheres).into(), &with(settings.algorithm, threads));
                assert!(
                    found == expected,
                    "{name}, {space:?}, {settings:?}: {} pairs, not {}",
                    found.len(),
                    expected.len()
                );
            }
        }
        let species: Vec<u32> = (0..3).cycle().take(spheres.len()).collect();
        let plain = Spheres::from(&spheres);
        let with_species = plain.with_species(&species).expect("one id per sphere");
        for (spheres, interactions) in [(plain, None), (with_species, Some(reactions()))] {
            let with = |algorithm, threads, order| Settings {
                algorithm,
                threads: Some(threads),
                order,
                interactions: interactions.clone(),
                ..settings.clone()
            };
            let expected = pairs(spheres, &with(Algorithm::Naive, 1, Order::Canonical));
            let found = pairs(spheres, &with(settings.algorithm, 1, Order::Canonical));
            assert!(
                found == expected,
                "{name}, species {}, {settings:?}: {} pairs, not {}",
                interactions.is_some(),
                found.len(),
                expected.len()
            );
            let alone = pairs(spheres, &with(settings.algorithm, 1, Order::Unordered));
            for threads in [2, 7] {
                let shared = pairs(spheres, &with(settings.algorithm, threads, Order::Unordered));
                assert!(shared == alone, "{name}, {settings:?}: another order with {threads} threads");
            }
        }
    }
}

pub(crate) fn crowd(n: usize) -> Vec<Sphere> {
    many(n, 26, |r, k| {
        let scale = if k % 3 == 0 { 30.0 } else { 1.0 };
        (r.point(scale), 0.1 * (-((k % 7) as f32)).exp2())
    })
}

pub(crate) fn assert_threads_match_naive(settings: &Settings) {
    let spheres = crowd(30_000);
    let with =
        |algorithm, threads, order| Settings { algorithm, threads: Some(threads), order, ..settings.clone() };
    let expected = pairs((&spheres).into(), &with(Algorithm::Naive, 2, Order::Canonical));
    let found = pairs((&spheres).into(), &with(settings.algorithm, 2, Order::Canonical));
    assert!(found == expected, "{settings:?}: {} pairs, not {}", found.len(), expected.len());
    let alone = pairs((&spheres).into(), &with(settings.algorithm, 1, Order::Unordered));
    for threads in [2, 7] {
        let shared = pairs((&spheres).into(), &with(settings.algorithm, threads, Order::Unordered));
        assert!(shared == alone, "{settings:?}: another order with {threads} threads");
    }
}
