//! What ranks own, get and report in scenes of thousands of spheres: held to bounds, and the pairs to the definition.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::{Random, naive, numbered};
use lazygrid::{Config, Space, Sphere};
use lazygrid_ranks::model::Model;
use lazygrid_ranks::{Bodies, Census, Particle};

fn uniform(spheres: usize, radii: &[f32]) -> Vec<Sphere> {
    let mut random = Random(1);
    let edge = (spheres as f32).cbrt() * 2.0;
    let sphere = |k: usize| Sphere::new(random.point(edge), radii[k % radii.len()]);
    (0..spheres).map(sphere).collect()
}

fn giant(spheres: usize) -> Vec<Sphere> {
    let mut all = uniform(spheres, &[0.4]);
    let edge = (spheres as f32).cbrt() * 2.0;
    all[spheres / 2] = Sphere::new([edge / 2.0; 3], edge / 4.0);
    all
}

fn gaussian(spheres: usize) -> Vec<Sphere> {
    let mut random = Random(2);
    let scale = (spheres as f32).cbrt();
    (0..spheres).map(|_| Sphere::new([(); 3].map(|()| scale * random.normal()), 0.4)).collect()
}

fn found(model: &Model, space: Space) -> (Vec<[u64; 2]>, Census) {
    let found = model.pairs(&Config::default().space(space).threads(1)).unwrap();
    let each: Vec<_> = found.iter().map(|rank| rank.pairs.len() as u64).collect();
    let mut pairs: Vec<_> = found.into_iter().flat_map(|rank| rank.pairs).collect();
    pairs.sort_unstable();
    (pairs, Census::of(&each))
}

#[test]
fn two_thousand_spheres_on_up_to_512_ranks() {
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
                let model = Model::balanced(&particles, ranks, Bodies::new(space, None));
                assert_eq!(model.owned().total, 2000);
                // All of them are in the sample.
                assert!(model.owned().most <= 2000_u64.div_ceil(ranks.into()) + 2, "{name}, {ranks} ranks");
                let (pairs, _) = found(&model, space);
                assert!(pairs == expected, "{name} on {ranks} ranks: {} for {}", pairs.len(), expected.len());
            }
        }
    }
}

#[test]
fn spheres_at_one_point_are_shared_out_and_so_are_their_pairs() {
    let n = 1600_u64;
    let particles = numbered(vec![Sphere::new([1.0, 2.0, 3.0], 0.5); n as usize]);
    for ranks in [2, 3, 8, 16] {
        let model = Model::balanced(&particles, ranks, Bodies::default());
        let (pairs, reported) = found(&model, Space::UNBOUNDED);
        assert_eq!((pairs.len() as u64, reported.total), (n * (n - 1) / 2, n * (n - 1) / 2));
        assert!(pairs.windows(2).all(|two| two[0] != two[1]), "a pair twice on {ranks} ranks");
        // Where two ranks are half of all ranks apart, one of them reports all pairs of both.
        let most = 1.02 + if ranks % 2 == 0 { 1.0 / f64::from(ranks) } else { 0.0 };
        assert!(reported.imbalance() <= most, "{} on {ranks} ranks", reported.imbalance());
        // What is compared is what each rank owns with itself and with its ghosts: no ghosts with each other.
        let ranks = model.pairs(&Config::default().threads(1)).unwrap();
        assert!(ranks.iter().all(|rank| rank.tally.elsewhere == 0));
    }
}

#[test]
fn a_sample_shares_out_what_it_does_not_see() {
    for spheres in [uniform(100_000, &[0.4]), gaussian(100_000), vec![Sphere::default(); 100_000]] {
        let model = Model::balanced(&numbered(spheres), 8, Bodies::default());
        let owned = model.owned().imbalance();
        assert!(owned <= 1.05, "{owned}");
    }
}

#[test]
fn ghosts_are_those_near_a_border() {
    // A cube of 50³ spheres, 100 across, whose eight parts have three borders. A sphere crosses one at up to 0.8, from
    // one side only.
    let near = 3.0 * 0.8 / 100.0;
    for (name, spheres, most) in [
        ("uniform", uniform(125_000, &[0.4]), 1.1),
        ("five sizes", uniform(125_000, &[0.4, 0.2, 0.1, 0.05, 0.025]), 1.1),
        ("giant", giant(125_000), 1.1),
        ("gaussian", gaussian(125_000), 2.5),
    ] {
        let model = Model::balanced(&numbered(spheres), 8, Bodies::default());
        let part = model.ghosts().total as f64 / 125_000.0;
        assert!(part <= most * near, "{name}: {part} of all are ghosts, where {near} are near a border");
    }
}

#[test]
fn a_giant_travels_and_what_it_covers_stays() {
    let particles = numbered(giant(4000));
    let alone = numbered(uniform(4000, &[0.4]));
    let ghosts = |particles: &[Particle]| Model::balanced(particles, 8, Bodies::default()).ghosts().total;
    // At most once to each of the other ranks.
    assert!(ghosts(&particles).abs_diff(ghosts(&alone)) <= 20, "{} {}", ghosts(&particles), ghosts(&alone));
}
