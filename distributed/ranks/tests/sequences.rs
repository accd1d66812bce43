//! One search per rank, call after call: any input may change, and any call may fail.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use std::ops::ControlFlow;

use common::{naive, table};
use lazygrid::Interaction::{self, Never, Touch, Within};
use lazygrid::{Algorithm, Config, Detector, Order, Skin, Space, Sphere, Spheres};
use lazygrid_ranks::{
    Communicator, Ghosts, Migration, PairKind, Particle, Partitioner, RankBounds, Search, SphereWrapper,
    threads, tie_breaker,
};
use proptest::prelude::*;
use proptest::sample::select;

const SIDE: f32 = 12.0;
const TABLES: [[Interaction; 6]; 2] = [
    [Touch, Within(0.7), Touch, Touch, Never, Touch],
    [Within(0.1), Within(1.5), Within(0.7), Never, Within(0.05), Within(0.4)],
];

#[derive(Clone, Debug)]
enum Change {
    Repeat(u8),
    Drift(u8, f32),
    Radii {
        factor: f32,
        all: bool,
    },
    /// Bounds the naive comparison to about 500 spheres per rank.
    Resize(u32),
    Teleport(u64),
    Species,
    SetPlacement(Placement),
}

#[derive(Clone, Copy, Debug)]
struct InjectedFailure {
    rank: u32,
    radius: bool,
}

#[derive(Clone, Copy, Debug)]
enum Placement {
    Spread,
    Single(u32),
    Rebalanced,
}

#[derive(Clone, Debug)]
struct Frame {
    particles: Vec<Particle>,
    placement: Placement,
    fails: Option<InjectedFailure>,
}

#[derive(Clone, Debug)]
struct Scene {
    changes: Vec<(Change, Option<InjectedFailure>)>,
    ranks: u32,
    is_periodic: bool,
    interactions: Option<[Interaction; 6]>,
    algorithm: Algorithm,
    skin: Skin,
}

fn random(id: u64, stream: u64) -> f32 {
    (tie_breaker(tie_breaker(id) ^ stream) >> 40) as f32 / (1_u32 << 24) as f32
}

fn point(id: u64, stream: u64) -> [f32; 3] {
    [0, 1, 2].map(|axis| SIDE * random(id, 4 * stream + axis))
}

fn particle(id: u64) -> Particle {
    let radius = 0.4 * 0.5_f32.powi(id as i32 % 4);
    Particle { sphere: Sphere::new(point(id, 0), radius), id, species: (id % 3) as u32, index: 0 }
}

impl Scene {
    fn frames(&self) -> Vec<Frame> {
        let mut particles: Vec<Particle> = (0..900).map(particle).collect();
        let mut placement = Placement::Spread;
        let mut frames = Vec::new();
        for (stream, (change, fails)) in (1..).zip(&self.changes) {
            let mut calls = 1;
            match *change {
                Change::Repeat(times) => calls = times,
                Change::Drift(times, _) => calls = times,
                Change::Radii { factor, all } => {
                    let changed = particles.iter_mut().filter(|one| all || one.id % 4 == 0);
                    changed.for_each(|one| one.sphere.radius = (one.sphere.radius * factor).clamp(1e-6, 1.0));
                }
                Change::Resize(n) => {
                    let first = particles.len() as u64;
                    particles.extend((first..n.into()).map(particle));
                    particles.truncate(n as usize);
                }
                Change::Teleport(eighths) => particles
                    .iter_mut()
                    .filter(|one| tie_breaker(one.id ^ stream) % 8 < eighths)
                    .for_each(|one| one.sphere.center = point(one.id, stream).into()),
                Change::Species => {
                    particles
                        .iter_mut()
                        .for_each(|one| one.species = (tie_breaker(one.id ^ stream) % 3) as u32);
                }
                Change::SetPlacement(to) => placement = to,
            }
            for call in 0..u64::from(calls) {
                if let Change::Drift(_, by) = *change {
                    let step = |id| {
                        [0, 1, 2].map(|axis| by * (2.0 * random(id, stream << 8 | call << 2 | axis) - 1.0))
                    };
                    particles
                        .iter_mut()
                        .for_each(|one| one.sphere.center += lazygrid::glam::Vec3::from(step(one.id)));
                }
                let frame = Frame { particles: particles.clone(), placement, fails: None };
                frames.extend(
                    fails.filter(|_| call == 0).map(|fail| Frame { fails: Some(fail), ..frame.clone() }),
                );
                frames.push(frame);
            }
        }
        frames
    }

    fn space(&self) -> Space {
        if self.is_periodic { Space::periodic([Some(f64::from(SIDE)); 3]).unwrap() } else { Space::UNBOUNDED }
    }

    fn check(&self) {
        let (frames, space, table) = (self.frames(), self.space(), self.interactions.map(table));
        let of_ranks = threads::on(self.ranks, |communicator| {
            let mut rank = Rank::new(self, communicator);
            frames.iter().map(|frame| rank.call(frame)).collect::<Vec<_>>()
        });
        for (k, frame) in frames.iter().enumerate() {
            let answers: Vec<_> = of_ranks.iter().map(|rank| &rank[k]).collect();
            if frame.fails.is_some_and(|fail| has_spheres(frame, fail.rank % self.ranks, self.ranks)) {
                assert!(answers.iter().all(|answer| answer.is_err()), "call {k} gave an answer");
                continue;
            }
            let mut found: Vec<_> = answers.into_iter().flat_map(|answer| answer.clone().unwrap()).collect();
            found.sort_unstable();
            let expected = naive(&frame.particles, &space, table.as_ref());
            assert!(
                found == expected,
                "call {k} of {}: {} pairs and not {} of {} spheres",
                frames.len(),
                found.len(),
                expected.len(),
                frame.particles.len()
            );
        }
    }
}

fn owner(placement: Placement, id: u64, ranks: u32) -> u32 {
    match placement {
        Placement::Spread | Placement::Rebalanced => (id % u64::from(ranks)) as u32,
        Placement::Single(rank) => rank % ranks,
    }
}

fn has_spheres(frame: &Frame, rank: u32, ranks: u32) -> bool {
    frame.particles.iter().any(|one| owner(frame.placement, one.id, ranks) == rank)
}

struct Rank<C> {
    communicator: C,
    wrapper: SphereWrapper,
    partitioner: Partitioner,
    search: Search,
}

impl<C: Communicator<Error = String>> Rank<C> {
    fn new(scene: &Scene, communicator: C) -> Self {
        let (space, table) = (scene.space(), scene.interactions.map(table));
        let config =
            Config::default().space(space).interactions(table.clone()).threads(1).order(Order::Unordered);
        let config = config.skin(scene.skin);
        let detector = Detector::new(config.clone().algorithm(scene.algorithm)).unwrap();
        let wrapper = SphereWrapper::new(space, table.as_ref());
        let (rank, ranks) = (communicator.rank(), communicator.ranks());
        let search = Search::new(detector, config, wrapper.clone(), rank, ranks).unwrap();
        Self { communicator, wrapper, partitioner: Partitioner::default(), search }
    }

    fn call(&mut self, frame: &Frame) -> Result<Vec<[u64; 2]>, String> {
        let (rank, ranks) = (self.communicator.rank(), self.communicator.ranks());
        let mine = |one: &&Particle| owner(frame.placement, one.id, ranks) == rank;
        let mut owned: Vec<Particle> = frame.particles.iter().filter(mine).copied().collect();
        if let (Placement::Rebalanced, None) = (frame.placement, frame.fails) {
            let ids: Vec<u64> = owned.iter().map(|one| one.id).collect();
            let wrapped = self.wrapper.wrap_all(owned.iter().copied()).unwrap();
            let assignment = self.partitioner.assign(&mut self.communicator, &wrapped, &ids, 1.2)?;
            let migration = Migration::to_ranks(&assignment.ranks, ranks).unwrap();
            owned = migration.apply(&mut self.communicator, "spheres", |k| owned[k as usize])?;
        }
        let wrapped = self.wrapper.wrap_all(owned.iter().copied()).unwrap();
        let bounds = RankBounds::gather(&mut self.communicator, &wrapped)?;
        let leaving = bounds.ghosts(rank, &wrapped, &self.wrapper).unwrap();
        let ghosts = Ghosts::exchange(&mut self.communicator, &leaving, |k| owned[k as usize])?;
        let mut spheres: Vec<Sphere> = owned.iter().map(|one| one.sphere).collect();
        if let (Some(fail), Some(sphere)) = (frame.fails, spheres.last_mut())
            && fail.rank % ranks == rank
        {
            if fail.radius { sphere.radius = -1.0 } else { sphere.center.y = f32::NAN }
        }
        let species: Vec<u32> = owned.iter().map(|one| one.species).collect();
        let with = Spheres::from(&spheres).with_species(&species).unwrap();
        let mut pairs = Vec::new();
        let found = self.search.run(with, &ghosts, |found, indices| {
            pairs.extend(indices.iter().map(|&[i, j]| {
                let other = match found {
                    PairKind::Local => owned[j as usize].id,
                    PairKind::WithGhost => ghosts.particles()[j as usize].id,
                };
                let one = owned[i as usize].id;
                [one.min(other), one.max(other)]
            }));
            ControlFlow::Continue(())
        });
        let found = found.and_then(|counts| Ok((counts, self.search.count(with, &ghosts)?)));
        let (counts, counted) =
            self.communicator.agree(found.map_err(|error| self.communicator.failure(error.to_string())))?;
        assert_eq!((counts.reported(), counted.reported()), (pairs.len() as u64, pairs.len() as u64));
        Ok(pairs)
    }
}

fn change() -> impl Strategy<Value = Change> {
    let placement = prop_oneof![
        Just(Placement::Spread),
        any::<u32>().prop_map(Placement::Single),
        Just(Placement::Rebalanced)
    ];
    let factor = select(vec![1e-3, 0.2, 0.99, 1.01, 2.0, 4.0, 1e3]);
    prop_oneof![
        3 => (1_u8..6).prop_map(Change::Repeat),
        3 => (1_u8..6, select(vec![1e-4_f32, 1e-2, 0.3])).prop_map(|(calls, by)| Change::Drift(calls, by)),
        3 => (factor, any::<bool>()).prop_map(|(factor, all)| Change::Radii { factor, all }),
        2 => select(vec![0, 1, 299, 420, 501, 620, 900, 1500, 1500]).prop_map(Change::Resize),
        1 => (1_u64..9).prop_map(Change::Teleport),
        1 => Just(Change::Species),
        1 => placement.prop_map(Change::SetPlacement),
    ]
}

fn scene() -> impl Strategy<Value = Scene> {
    let fail = (any::<u32>(), any::<bool>()).prop_map(|(rank, radius)| InjectedFailure { rank, radius });
    let changes = prop::collection::vec((change(), prop::option::weighted(0.4, fail)), 1..16);
    let algorithm =
        select(vec![Algorithm::Auto, Algorithm::Auto, Algorithm::CellList, Algorithm::RecursiveGrid]);
    let skin = select(vec![Skin::Auto, Skin::Auto, Skin::Fixed(0.2), Skin::Off]);
    let interactions = prop::option::of(select(TABLES.to_vec()));
    (changes, select(vec![1, 1, 2, 3, 5]), any::<bool>(), interactions, algorithm, skin).prop_map(
        |(changes, ranks, is_periodic, interactions, algorithm, skin)| Scene {
            changes,
            ranks,
            is_periodic,
            interactions,
            algorithm,
            skin: if algorithm == Algorithm::RecursiveGrid { Skin::Off } else { skin },
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(32) })]

    #[test]
    fn every_call_of_a_sequence_matches_naive(scene in scene()) {
        scene.check();
    }
}

#[test]
fn candidate_list_of_tiny_spheres_is_rebuilt_when_radii_grow() {
    for (ranks, skin) in [(1, Skin::Auto), (3, Skin::Auto), (2, Skin::Fixed(0.2))] {
        for n in [420, 900] {
            let radii = |factor| Change::Radii { factor, all: true };
            let fail = Some(InjectedFailure { rank: 0, radius: false });
            let changes = vec![
                (Change::Resize(n), None),
                (radii(1e-3), None),
                (Change::Drift(8, 1e-4), None),
                (radii(1e3), fail),
                (Change::Repeat(4), None),
                (radii(1e-3), fail),
                (Change::Drift(8, 1e-4), fail),
                (radii(1e3), None),
                (Change::Repeat(2), None),
            ];
            let algorithm = Algorithm::Auto;
            Scene { changes, ranks, is_periodic: false, interactions: None, algorithm, skin }.check();
        }
    }
}
