//! All ranks' pairs are those of the naive search, for any placement.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::{naive, numbered, sorted_pairs, table};
use lazygrid::Interaction::{self, Never, Touch, Within};
use lazygrid::{Config, Space, Sphere};
use lazygrid_ranks::in_process::InProcessRanks;
use lazygrid_ranks::{Particle, SphereWrapper};
use proptest::prelude::*;
use proptest::sample::select;

#[derive(Clone, Debug)]
enum Placement {
    Balanced,
    Listed(Vec<u32>),
    Single(u32),
}

#[derive(Clone, Debug)]
struct Scene {
    spheres: Vec<Sphere>,
    lengths: [Option<f32>; 3],
    tilts: [f32; 3],
    ranks: u32,
    placement: Placement,
    interactions: Option<[Interaction; 6]>,
}

const TABLES: [[Interaction; 6]; 3] = [
    [Touch, Within(2.5), Touch, Never, Never, Within(0.0)],
    [Within(0.5), Within(4.0), Within(0.0), Never, Within(1.0), Touch],
    [Within(0.0), Within(3.0), Never, Within(1.0), Within(0.1), Within(3e38)],
];

impl Scene {
    fn ranks(&self, particles: &[Particle], wrapper: SphereWrapper) -> InProcessRanks {
        let owner = |k: usize| match &self.placement {
            Placement::Listed(words) => words[k % words.len()] % self.ranks,
            Placement::Single(word) => word % self.ranks,
            Placement::Balanced => 0,
        };
        if let Placement::Balanced = self.placement {
            return InProcessRanks::balanced(particles, self.ranks, wrapper).unwrap();
        }
        let mut owned = vec![Vec::new(); self.ranks as usize];
        for (k, particle) in particles.iter().enumerate() {
            owned[owner(k) as usize].push(*particle);
        }
        InProcessRanks::with_owners(owned, wrapper).unwrap()
    }

    fn check(&self) {
        let particles = numbered(self.spheres.iter().copied());
        let ([x, y, z], [xy, xz, yz]) = (self.lengths, self.tilts);
        let vectors = [x.map(|x| [x, 0.0, 0.0]), y.map(|y| [xy, y, 0.0]), z.map(|z| [xz, yz, z])];
        let space =
            Space::triclinic(vectors.map(|vector| vector.map(|vector| vector.map(f64::from)))).unwrap();
        let table = self.interactions.map(table);
        let mut config = Config::default().space(space).threads(1);
        if let Some(table) = &table {
            config = config.interactions(table.clone());
        }
        let ranks = self.ranks(&particles, SphereWrapper::new(space, table.as_ref()));
        let pairs = sorted_pairs(ranks.pairs(&config).unwrap());
        assert_eq!(pairs, naive(&particles, &space, table.as_ref()), "on {} ranks", self.ranks);
    }
}

fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => (-3_i8..4).prop_map(f32::from),
        2 => -4.0_f32..4.0,
        1 => select(vec![0.0, -0.0, 2.0_f32.next_up(), 1e6, -1e6, 1e-30, 3e38, -3e38]),
    ]
}

fn radius() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => select(vec![0.0, 0.5, 1.0, 1.5]),
        2 => 0.0_f32..1.0,
        1 => select(vec![1e-40, 1e-6, 40.0, 1e6, -0.0, 3e38]),
    ]
}

fn sphere() -> impl Strategy<Value = Sphere> {
    ([coordinate(), coordinate(), coordinate()], radius())
        .prop_map(|(center, radius)| Sphere::new(center, radius))
}

fn spheres() -> impl Strategy<Value = Vec<Sphere>> {
    prop_oneof![
        6 => prop::collection::vec(sphere(), 0..40),
        1 => (sphere(), prop::collection::vec(radius(), 0..40)).prop_map(|(at, radii)| {
            radii.into_iter().map(|radius| Sphere::new(at.center, radius)).collect()
        }),
        1 => (sphere(), 0_usize..40).prop_map(|(sphere, n)| vec![sphere; n]),
    ]
}

fn scene() -> impl Strategy<Value = Scene> {
    let length = || prop_oneof![Just(None), select(vec![Some(6.0), Some(4.0), Some(2.5), Some(1e7)])];
    let placement = prop_oneof![
        2 => Just(Placement::Balanced),
        2 => prop::collection::vec(any::<u32>(), 1..40).prop_map(Placement::Listed),
        1 => any::<u32>().prop_map(Placement::Single),
    ];
    let ranks = select(vec![1, 2, 3, 4, 5, 8, 13]);
    let tilts = select(vec![[0.0; 3], [0.0; 3], [1.0, -0.5, 2.0], [0.0, 3.0, 0.0], [7.0, 0.0, -1.25]]);
    let bounds = ([length(), length(), length()], tilts);
    let interactions = prop::option::of(select(TABLES.to_vec()));
    (spheres(), bounds, ranks, placement, interactions).prop_map(
        |(spheres, (lengths, tilts), ranks, placement, interactions)| Scene {
            spheres,
            lengths,
            tilts,
            ranks,
            placement,
            interactions,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn few_ranks(scene in scene()) {
        scene.check();
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(32) })]

    #[test]
    fn many_ranks(scene in scene(), ranks in select(vec![64, 100, 512])) {
        Scene { ranks, ..scene }.check();
    }
}
