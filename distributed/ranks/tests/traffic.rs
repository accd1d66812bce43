//! Loads, ghosts and pairs of thousands of spheres.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::{Random, naive, numbered, sorted_pairs, table};
use lazygrid::Interaction::{Never, Touch, Within};
use lazygrid::{Config, Space, Sphere};
use lazygrid_ranks::in_process::InProcessRanks;
use lazygrid_ranks::{LoadBalance, Particle, SphereWrapper};

fn uniform(spheres: usize, radii: &[f32]) -> Vec<Sphere> {
    let mut random = Random(1);
    let side = (spheres as f32).cbrt() * 2.0;
    let sphere = |k: usize| Sphere::new(random.point(side), radii[k % radii.len()]);
    (0..spheres).map(sphere).collect()
}

fn giant(spheres: usize) -> Vec<Sphere> {
    let mut all = uniform(spheres, &[0.4]);
    let side = (spheres as f32).cbrt() * 2.0;
    all[spheres / 2] = Sphere::new([side / 2.0; 3], side / 4.0);
    all
}

fn gaussian(spheres: usize) -> Vec<Sphere> {
    let mut random = Random(2);
    let scale = (spheres as f32).cbrt();
    (0..spheres).map(|_| Sphere::new([(); 3].map(|()| scale * random.normal()), 0.4)).collect()
}

fn found(in_process: &InProcessRanks, space: Space) -> (Vec<[u64; 2]>, LoadBalance) {
    let found = in_process.pairs(&Config::default().space(space).threads(1)).unwrap();
    let each: Vec<_> = found.iter().map(|rank| rank.pairs.len() as u64).collect();
    (sorted_pairs(found), LoadBalance::from_counts(&each))
}

#[test]
fn pairs_of_up_to_512_ranks_match_naive() {
    let scenes: [(&str, Vec<Sphere>); 4] = [
        ("uniform", uniform(2000, &[0.6])),
        ("five sizes", uniform(2000, &[1.6, 0.8, 0.4, 0.2, 0.1])),
        ("giant", giant(2000)),
        ("gaussian", gaussian(2000)),
    ];
    for (name, spheres) in scenes {
        let particles = numbered(spheres);
        for space in [Space::UNBOUNDED, Space::periodic([Some(25.0), None, Some(19.0)]).unwrap()] {
            let expected = naive(&particles, &space, None);
            for ranks in [1, 2, 3, 5, 8, 64, 512] {
                let in_process =
                    InProcessRanks::balanced(&particles, ranks, SphereWrapper::new(space, None)).unwrap();
                assert_eq!(in_process.owned().total, 2000);
                assert!(
                    in_process.owned().most <= 2000_u64.div_ceil(ranks.into()) + 2,
                    "{name}, {ranks} ranks"
                );
                let (pairs, _) = found(&in_process, space);
                assert!(pairs == expected, "{name} on {ranks} ranks: {} for {}", pairs.len(), expected.len());
            }
        }
    }
}

#[test]
fn coincident_spheres_and_their_pairs_are_balanced() {
    let n = 1600_u64;
    let particles = numbered(vec![Sphere::new([1.0, 2.0, 3.0], 0.5); n as usize]);
    for ranks in [2, 3, 8, 16] {
        let in_process = InProcessRanks::balanced(&particles, ranks, SphereWrapper::default()).unwrap();
        let (pairs, reported) = found(&in_process, Space::UNBOUNDED);
        assert_eq!((pairs.len() as u64, reported.total), (n * (n - 1) / 2, n * (n - 1) / 2));
        assert!(pairs.windows(2).all(|two| two[0] != two[1]), "a pair twice on {ranks} ranks");
        // For even P, only one of ranks k and k + P/2 reports their pairs.
        let most = 1.02 + if ranks % 2 == 0 { 1.0 / f64::from(ranks) } else { 0.0 };
        assert!(reported.imbalance() <= most, "{} on {ranks} ranks", reported.imbalance());
        let ranks = in_process.pairs(&Config::default().threads(1)).unwrap();
        assert!(ranks.iter().all(|rank| rank.counts.elsewhere == 0));
    }
}

#[test]
fn domains_balance_spheres_outside_the_sample() {
    for spheres in [uniform(100_000, &[0.4]), gaussian(100_000), vec![Sphere::default(); 100_000]] {
        let in_process = InProcessRanks::balanced(&numbered(spheres), 8, SphereWrapper::default()).unwrap();
        let owned = in_process.owned().imbalance();
        assert!(owned <= 1.05, "{owned}");
    }
}

#[test]
fn ghosts_are_near_domain_boundaries() {
    // A cube of 50³ spheres, 100 across, has three borders, each crossed by up to 0.8 from one side.
    let near = 3.0 * 0.8 / 100.0;
    for (name, spheres, most) in [
        ("uniform", uniform(125_000, &[0.4]), 1.1),
        ("five sizes", uniform(125_000, &[0.4, 0.2, 0.1, 0.05, 0.025]), 1.1),
        ("giant", giant(125_000), 1.1),
        ("gaussian", gaussian(125_000), 2.5),
    ] {
        let in_process = InProcessRanks::balanced(&numbered(spheres), 8, SphereWrapper::default()).unwrap();
        let fraction = in_process.ghosts().total as f64 / 125_000.0;
        assert!(
            fraction <= most * near,
            "{name}: {fraction} of all are ghosts, where {near} are near a border"
        );
    }
}

#[test]
fn giant_becomes_a_ghost_and_spheres_in_it_do_not() {
    let particles = numbered(giant(4000));
    let alone = numbered(uniform(4000, &[0.4]));
    let ghosts = |particles: &[Particle]| {
        InProcessRanks::balanced(particles, 8, SphereWrapper::default()).unwrap().ghosts().total
    };
    assert!(ghosts(&particles).abs_diff(ghosts(&alone)) <= 20, "{} {}", ghosts(&particles), ghosts(&alone));
}

#[test]
fn ghosts_go_only_to_ranks_with_a_partner_species() {
    let mut cluster = uniform(2000, &[0.6]);
    cluster.iter_mut().for_each(|sphere| sphere.center *= 0.3);
    let target = Sphere::new([3.5; 3], 0.7);
    let table = table([Never, Touch, Never, Never, Never, Never]);
    for (first, second) in [(0, 1), (1, 0)] {
        let mut owned = vec![Vec::new(); 2];
        let mut particles = numbered(cluster.iter().copied().chain([target]));
        let count = particles.len();
        for (k, particle) in particles.iter_mut().enumerate() {
            particle.species = u32::from(k + 1 == count);
            let rank = if k + 1 == count || k % 2 == 0 { first } else { second };
            particle.index = owned[rank].len() as u32;
            owned[rank].push(*particle);
        }
        let touches = |one: &&Particle| {
            let cutoff = f64::from(one.sphere.radius + target.radius);
            one.species == 0
                && Space::UNBOUNDED.distance_squared(one.sphere.center, target.center) <= cutoff * cutoff
        };
        let near = owned[second].iter().filter(touches).count() as u64;
        assert!(near > 1);
        let ranks =
            InProcessRanks::with_owners(owned.clone(), SphereWrapper::new(Space::UNBOUNDED, Some(&table)))
                .unwrap();
        let expected = if second == 0 { near } else { 1 };
        assert_eq!(ranks.ghosts().total, expected, "the target is on rank {first}");
        let found = ranks.pairs(&Config::default().interactions(table.clone()).threads(1)).unwrap();
        assert_eq!(sorted_pairs(found), naive(&particles, &Space::UNBOUNDED, Some(&table)));
        let all = InProcessRanks::with_owners(owned, SphereWrapper::default()).unwrap();
        assert!(all.ghosts().total >= 1000);
    }
}

#[test]
fn ghosts_are_within_the_distance_of_their_species() {
    let cluster = uniform(8000, &[0.3]);
    let (side, distance) = (40.0, 8.0);
    let interactions = [Within(0.05), Within(distance), Never, Never, Never, Never];
    let table = table(interactions);
    for (target, is_near) in [(None, false), (Some(1.0), false), (Some(0.5 * side), true)] {
        let target = target.map(|x| Sphere::new([x; 3], 0.3));
        let mut particles = numbered(cluster.iter().copied().chain(target));
        particles.iter_mut().for_each(|particle| particle.species = u32::from(particle.id == 8000));
        for space in [Space::UNBOUNDED, Space::periodic([None, Some(60.0), None]).unwrap()] {
            let ranks =
                InProcessRanks::balanced(&particles, 8, SphereWrapper::new(space, Some(&table))).unwrap();
            let of_target = |one: &&Particle| {
                let to_target = |target: Sphere| space.distance_squared(one.sphere.center, target.center);
                target.is_some_and(|target| to_target(target) <= distance * distance)
            };
            let most = if is_near { particles.iter().filter(of_target).count() as u64 } else { 0 };
            assert!(!is_near || most > 100);
            // About 30 spheres are within 0.05 of one of three borders.
            let ghosts = ranks.ghosts().total;
            assert!(ghosts <= 60 + most, "{ghosts} ghosts and {most} near the target at {target:?}");
            let found = ranks.pairs(&Config::default().space(space).interactions(table.clone()).threads(1));
            let pairs = sorted_pairs(found.unwrap());
            assert!(pairs == naive(&particles, &space, Some(&table)), "the target is at {target:?}");
        }
    }
}
