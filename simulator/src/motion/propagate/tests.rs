use super::*;
use crate::model::particles::Particle;
use crate::model::receiver::{Receiver, ReceiverKind, WallFace};
use crate::model::vessel::Vessel;
use crate::model::{Decay, Species};
use crate::random::gaussian::normals;
use crate::random::philox::{Key, Purpose};

fn species(diffusion: f64) -> Species {
    Species { name: "A".into(), diffusion, drift: [1.0, 0.0, 0.0], ..Species::default() }
}

fn cloud(n: u32) -> Particles {
    let mut particles = Particles::default();
    (0..n).for_each(|id| particles.push(Particle { id: id * 7 + 3, ..Particle::default() }, false));
    particles
}

#[test]
fn a_move_depends_on_the_id_and_not_on_the_index() {
    let model = Model { time_step: 0.1, species: vec![species(2.0)], ..Model::default() };
    let motion = Propagator::new(&model);
    let mut all = cloud(10_001);
    let order: Vec<u32> = (0..10_001).map(|k| (k * 4_001) % 10_001).collect();
    let mut shuffled = all.permuted(&order);
    for step in 0..3 {
        assert!(motion.advance(&mut all, None, None, StepKey { key: Key::new(1), step }).unwrap().is_empty());
        motion.advance(&mut shuffled, None, None, StepKey { key: Key::new(1), step }).unwrap();
    }
    assert_eq!(all.permuted(&order), shuffled);
    let [x, ..] = normals(Key::new(1).draw(all.id[5], 0, 2, Purpose::Move));
    let mut two = cloud(10_001);
    (0..2).for_each(|step| {
        drop(motion.advance(&mut two, None, None, StepKey { key: Key::new(1), step }).unwrap())
    });
    let length = (2.0_f64 * 2.0 * 0.1).sqrt() as f32;
    assert_eq!(all.position[0][5], two.position[0][5] + (length * x + 0.1));
}

#[test]
fn walls_reverse_velocities() {
    let boundary = Boundary {
        axes: [
            crate::Axis::Reflecting { low: -1.0, high: 1.0 },
            crate::Axis::Periodic { low: -1.0, high: 1.0 },
            crate::Axis::Open,
        ],
        vessel: None,
    };
    let species = vec![Species { thermal_speed: 1.0, drift: [0.0; 3], ..species(0.0) }];
    let model = Model { time_step: 1.0, species, boundary, ..Model::default() };
    let mut particles = Particles::default();
    for (id, u) in (0..).zip([0.5, 1.5, -1.5, 3.5, -3.5]) {
        particles.push(Particle { id, velocity: [u; 3], ..Particle::default() }, true);
    }
    Propagator::new(&model)
        .advance(&mut particles, None, None, StepKey { key: Key::new(1), step: 0 })
        .unwrap();
    assert_eq!(particles.velocity[0], [0.5, -1.5, 1.5, 3.5, -3.5]);
    assert_eq!(particles.position[0], [0.5, 0.5, -0.5, -0.5, 0.5]);
    assert_eq!(particles.velocity[1], [0.5, 1.5, -1.5, 3.5, -3.5]);
    assert_eq!(particles.velocity[2], particles.velocity[1]);
}

#[test]
fn decays_share_their_probability() {
    let decay = |rate, product| Decay { products: [product, None], rate, ..Decay::default() };
    let model = Model {
        time_step: 0.5,
        species: vec![species(0.0), species(0.0)],
        decays: vec![decay(1.0, None), decay(3.0, Some(1))],
        ..Model::default()
    };
    let n = 100_000;
    let events = Propagator::new(&model)
        .advance(&mut cloud(n), None, None, StepKey { key: Key::new(9), step: 4 })
        .unwrap();
    for (which, fraction) in [(0, 0.25), (1, 0.75)] {
        let p = (1.0 - (-2.0_f64).exp()) * fraction;
        let count =
            events.iter().filter(|e| matches!(e, Event::Decayed { decay, .. } if *decay == which)).count();
        let error = (count as f64 - f64::from(n) * p) / (f64::from(n) * p * (1.0 - p)).sqrt();
        assert!(error.abs() < 4.0, "{which}: {count}, {error} standard errors");
    }
}

#[test]
fn path_beyond_the_range_of_numbers_is_an_error_in_every_boundary() {
    let vessel = Vessel { along: None, center: [0.0; 3], radius: 1.0 };
    for boundary in [
        Boundary::default(),
        Boundary::periodic([-1.0; 3], [1.0; 3]),
        Boundary::reflecting([-1.0; 3], [1.0; 3]),
        Boundary { vessel: Some(vessel), ..Boundary::default() },
    ] {
        let species = vec![Species { drift: [1e39, 0.0, 0.0], ..species(0.0) }];
        let model = Model { time_step: 1.0, species, boundary, ..Model::default() };
        let now = StepKey { key: Key::new(1), step: 2 };
        let moved = Propagator::new(&model).advance(&mut cloud(3), None, None, now);
        assert!(matches!(moved, Err(Error::NotFinite { step: 2, particles: 3 })), "{boundary:?}: {moved:?}");
    }
}

/// Both walls are equally far.
#[test]
fn first_of_two_walls_absorbs() {
    let wall = |axis| Receiver {
        kind: ReceiverKind::Wall(WallFace::Low(axis)),
        sees: vec![true],
        ..Receiver::default()
    };
    let model = Model {
        time_step: 0.01,
        species: vec![Species { drift: [0.0; 3], ..species(1.0) }],
        boundary: Boundary::reflecting([0.0; 3], [10.0; 3]),
        receivers: vec![wall(0), wall(1)],
        ..Model::default()
    };
    let mut particles = Particles::default();
    let position = [0.1, 0.1, 5.0];
    (0..40_000).for_each(|id| particles.push(Particle { id, position, ..Particle::default() }, false));
    let now = StepKey { key: Key::new(5), step: 0 };
    let events = Propagator::new(&model).advance(&mut particles, None, None, now).unwrap();
    let on = |wall: u32| events.iter().filter(|event| event.receiver() == wall).count() as f64;
    let [low_x, low_y] = [0, 1].map(on);
    let error = (low_x - low_y) / (low_x + low_y).sqrt();
    assert!(low_x > 10_000.0 && error.abs() < 5.0, "{low_x} and {low_y}");
}

/// A line that the wall at 0 reflects reaches the sphere or its position after the wall.
#[test]
fn wall_before_a_receiver_absorbs() {
    let receiver = |kind, x: f32| Receiver {
        center: [x, 5.0, 5.0],
        radius: 0.5,
        kind,
        sees: vec![true],
        ..Receiver::default()
    };
    let first = |kind: ReceiverKind, x: f32| {
        let model = Model {
            time_step: 1.0,
            species: vec![Species { drift: [-5.0, 0.0, 0.0], ..species(0.0) }],
            boundary: Boundary::reflecting([0.0; 3], [10.0; 3]),
            receivers: vec![receiver(ReceiverKind::Wall(WallFace::Low(0)), 0.0), receiver(kind, x)],
            ..Model::default()
        };
        let mut particles = Particles::default();
        particles.push(Particle { position: [2.0, 5.0, 5.0], ..Particle::default() }, false);
        let now = StepKey { key: Key::new(5), step: 0 };
        let events = Propagator::new(&model).advance(&mut particles, None, None, now).unwrap();
        events.iter().map(Event::receiver).collect::<Vec<_>>()
    };
    assert_eq!([3.0, 1.0].map(|x| first(ReceiverKind::Absorbing, x)), [[0], [1]]);
    assert_eq!(first(ReceiverKind::Endpoint, 3.0), [0]);
}
