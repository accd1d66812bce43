use lazygrid::Algorithm;

use super::*;
use crate::model::particles::Particle;
use crate::model::receiver::signed_distance;
use crate::random::philox::{Key, open_unit, philox};
use crate::reaction::rate::binding_radius;
use crate::{Reaction, ReactionRate, Receiver, ReceiverKind, Shape, Simulation, Species, State, Transmitter};

fn model(radius: f32) -> Model {
    let species = Species { name: "A".into(), radius, diffusion: 1.0, ..Species::default() };
    Model { species: vec![species], contact: Contact::Separate, time_step: 1.0, ..Model::default() }
}

/// Returns the number of overlaps in each of four steps, and `true` if a particle moved.
fn pushed(x: f32, overlap: f32) -> (Vec<u64>, bool) {
    let model = model(0.5 + 0.5 * overlap);
    let mut particles = Particles::default();
    for id in 0..2 {
        let position = [x + id as f32, 0.0, 0.0];
        let radius = model.species[0].radius;
        particles.push(Particle { id, position, radius, ..Particle::default() }, false);
    }
    let begun = particles.clone();
    let contacts = Contacts::new(&model);
    let resolved = (0..4).map(|step| {
        contacts.resolve(&mut particles, &[Pair::new(0, 1)], |_| true, StepKey { key: Key::new(1), step })
    });
    (resolved.collect(), particles != begun)
}

#[test]
fn overlap_below_rounding_remains_and_is_not_counted() {
    assert_eq!(pushed(0.0, 1e-3), (vec![1, 0, 0, 0], true));
    assert_eq!(pushed(8192.0, 1e-3), (vec![0; 4], false));
    assert_eq!(pushed(8192.0, 0.25), (vec![1, 0, 0, 0], true));
}

#[test]
fn separation_ignores_the_order_of_pairs_and_particles() {
    let n = 60;
    let position = |id: u32| [0.2 * (id % 4) as f32, 0.15 * (id / 4 % 4) as f32, 0.1 * (id / 16) as f32];
    let run = |order: &dyn Fn(u32) -> u32| {
        let mut particles = Particles::default();
        for id in (0..n).map(order) {
            particles
                .push(Particle { id, position: position(id), radius: 0.5, ..Particle::default() }, false);
        }
        let all = (0..n).flat_map(|i| (0..i).map(move |j| Pair::new(i, j)));
        let mut pairs: Vec<Pair> = all.collect();
        if order(0) != 0 {
            pairs.reverse();
        }
        let contacts = Contacts::new(&model(0.5));
        let resolved =
            contacts.resolve(&mut particles, &pairs, |_| true, StepKey { key: Key::new(1), step: 3 });
        let mut rows: Vec<_> =
            (0..n as usize).map(|at| (particles.id[at], particles.position_of(at))).collect();
        rows.sort_by_key(|row| row.0);
        (resolved, rows)
    };
    let forward = run(&|id| id);
    assert_eq!(forward, run(&|id| n - 1 - id));
    assert!(forward.0 > 500 && forward.1.iter().any(|(id, p)| *p != position(*id)));
}

fn kind(name: &str, radius: f32) -> Species {
    Species { name: name.into(), radius, diffusion: 1.0, ..Species::default() }
}

fn burst(shape: Shape, release: &[(u32, u32)]) -> Transmitter {
    Transmitter { shape, release: release.to_vec(), ..Transmitter::default() }
}

fn run(model: &Model, steps: u32, mut look: impl FnMut(&Simulation)) -> Simulation {
    let mut simulation = Simulation::new(model.clone(), 5, Algorithm::Auto).unwrap();
    for _ in 0..steps {
        simulation.step().unwrap();
        look(&simulation);
    }
    simulation
}

#[test]
fn reaction_within_contact_distance_has_its_rate() {
    let reacted = |contact| {
        let side = 1.5;
        let time_step = 1e-5;
        let binding_radius = binding_radius(0.5, 2.0, time_step).unwrap() as f32;
        assert!(binding_radius < 0.03, "{binding_radius}");
        let reaction = Reaction {
            reactants: [0, 1],
            products: [Some(2), None],
            binding_radius,
            chance: ReactionRate::PerStep(1.0),
            ..Reaction::default()
        };
        let model = Model {
            time_step,
            species: vec![kind("A", 0.05), kind("B", 0.05), kind("C", 0.0)],
            reactions: vec![reaction],
            contact,
            boundary: Boundary::periodic([0.0; 3], [side; 3]),
            transmitters: vec![Transmitter {
                center: [side / 2.0; 3],
                ..burst(Shape::Box([side; 3]), &[(0, 400), (1, 400)])
            }],
            ..Model::default()
        };
        run(&model, 200, |_| {}).state().totals.reacted[0] as f64
    };
    let [ignored, separated] = [Contact::Ignore, Contact::Separate].map(reacted);
    // Poisson errors of both counts are 14 % each, and excluded volumes change the rate.
    assert!(ignored > 30.0 && (separated / ignored - 1.0).abs() < 0.5, "{separated} and {ignored}");
}

#[test]
fn crowd_does_not_push_particles_into_a_receiver() {
    for velocity in [0.0, 20.0] {
        let receiver = Receiver {
            radius: 2.5,
            kind: ReceiverKind::Reflecting,
            sees: vec![true],
            velocity: [velocity, 0.0, 0.0],
            ..Receiver::default()
        };
        let model = Model {
            time_step: 0.01,
            species: vec![kind("A", 0.5)],
            contact: Contact::Separate,
            boundary: Boundary::periodic([-5.0; 3], [5.0; 3]),
            receivers: vec![receiver],
            transmitters: vec![burst(Shape::Shell(2.6, 5.0), &[(0, 500)])],
            ..Model::default()
        };
        let mut separated = 0;
        run(&model, 60, |simulation| {
            let State { centers, particles, totals, .. } = simulation.state();
            separated += totals.contacts;
            for at in 0..particles.len() {
                let height = signed_distance(2.5, centers[0], &model.boundary, particles.position_of(at));
                assert!(height >= 0.0, "{at} is {height} µm inside");
            }
        });
        assert!(separated > 1000, "{separated}");
    }
}

#[test]
fn spheres_found_by_a_search_match_all_tests() {
    let point = |k: u32| {
        let [x, y, z, by] = philox([k, 0, 0, 0], [3, 4]).map(open_unit);
        ([10.0 * x, 10.0 * y, 10.0 * z], 0.6 * by)
    };
    let receiver = |k: u32| Receiver {
        center: point(k).0,
        radius: 1.5 * point(k).1,
        kind: ReceiverKind::Reflecting,
        sees: vec![true, k.is_multiple_of(3)],
        ..Receiver::default()
    };
    let boundary = Boundary::periodic([0.0; 3], [10.0; 3]);
    let receivers = (0..300).map(receiver).collect();
    let reflecting_spheres = ReflectingSpheres::new(&Model { receivers, boundary, ..Model::default() });
    let shift = |k: u32| {
        let (from, by) = point(1000 + k);
        let to = boundary.confine([from[0] + by, from[1] - by, from[2] + 0.5 * by]);
        Shift { at: k as usize, species: k % 2, from, to }
    };
    let all: Vec<Shift> = (0..2000).map(shift).collect();
    let retained = |size: usize| -> Vec<usize> {
        let chunks = all.chunks(size).map(|chunk| {
            let mut chunk = chunk.to_vec();
            reflecting_spheres.retain_outside(&mut chunk);
            chunk
        });
        chunks.flatten().map(|shift| shift.at).collect()
    };
    assert_eq!(retained(2000), retained(1));
    assert!((200..1900).contains(&retained(1).len()), "{}", retained(1).len());
}

#[test]
fn drift_creates_no_overlaps_at_walls() {
    let seen = |drift: f64| {
        let model = Model {
            time_step: 0.01,
            species: vec![Species { drift: [0.0, 0.0, drift], ..kind("A", 0.5) }],
            contact: Contact::Separate,
            boundary: Boundary::reflecting([-5.0; 3], [5.0; 3]),
            transmitters: vec![burst(Shape::Lattice([9.0; 3], [6, 6, 5]), &[(0, 180)])],
            ..Model::default()
        };
        let (mut overlaps, mut contacts) = (0, 0);
        run(&model, 100, |simulation| {
            overlaps += simulation.state().totals.pairs;
            contacts += simulation.state().totals.contacts;
        });
        (overlaps, contacts)
    };
    let (still, drifting) = (seen(0.0), seen(-1e-6));
    assert!(still.1 > 1000, "{still:?}");
    assert!(
        drifting.0 <= still.0 + 2 && drifting.1.abs_diff(still.1) < still.1 / 10,
        "{still:?} {drifting:?}"
    );
}
