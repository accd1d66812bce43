use super::*;
use crate::model::Species;
use crate::model::transmitter::{Schedule, Shape, Transmitter};
use crate::model::vessel::Vessel;
use crate::random::philox::{Key, open_unit};
use crate::release::PartialEvents;
use crate::release::rank_slice::RankSlice;
use crate::{Adsorption, Receiver, ReceiverKind};

const SPEED: f32 = 20.0;

/// Releases swimmers in steps of 0.1 s, each with at most 2 µm to go.
fn swimmers(boundary: Boundary, center: [f32; 3]) -> Model {
    let schedule = Schedule::Steady { from: 0.0, until: 1.0, rates: vec![(0, 2e4)] };
    Model {
        time_step: 0.1,
        species: vec![Species { speed: SPEED.into(), mass: 1.0, ..Species::default() }],
        transmitters: vec![Transmitter { center, schedule, ..Transmitter::default() }],
        boundary,
        ..Model::default()
    }
}

fn released(model: &Model) -> Vec<Particle> {
    let events = PartialEvents::new(model);
    let at = ReleaseStep { events: &events, key: Key::new(3), step: 1, next_id: 0, places: &[] };
    let particles = model.release(at, RankSlice::WHOLE).expect("a release").particles;
    (0..particles.len()).map(|at| particles.get(at)).collect()
}

#[test]
fn a_plane_wall_reverses_velocities_since_the_release() {
    let boundary = Boundary::reflecting([0.0; 3], [10.0; 3]);
    let [near, middle] = [0.05, 5.0];
    let particles = released(&swimmers(boundary, [near, middle, middle]));
    let passed: Vec<_> = particles.iter().filter(|particle| particle.position[0] > near).collect();
    assert!(passed.len() > 1000, "{}", passed.len());
    for Particle { position, velocity, .. } in particles {
        assert!(position[0] <= near || velocity[0] > 0.0, "{position:?}, {velocity:?}");
        assert_eq!(position[1] > middle, velocity[1] > 0.0, "{position:?}, {velocity:?}");
    }
}

/// From the center of a sphere of radius 1, half of the particles are on their way back.
#[test]
fn a_vessel_turns_velocities_since_the_release() {
    let vessel = Vessel { along: None, center: [0.0; 3], radius: 1.0 };
    let boundary = Boundary { vessel: Some(vessel), ..Boundary::default() };
    let particles = released(&swimmers(boundary, [0.0; 3]));
    let mut back = 0;
    for Particle { position, velocity, .. } in &particles {
        let dot: f32 = (0..3).map(|k| position[k] * velocity[k]).sum();
        let [distance, speed] = [position, velocity].map(|v| length(*v));
        assert!((speed - SPEED).abs() < 1e-3 && distance < 1.0 + 1e-6, "{position:?}, {velocity:?}");
        assert!((dot.abs() - distance * speed).abs() < 1e-3 * speed, "{position:?}, {velocity:?}");
        back += usize::from(dot < 0.0);
    }
    assert!(back.abs_diff(particles.len() / 2) <= 2, "{back} of {}", particles.len());
}

#[test]
fn receivers_out_of_reach_change_nothing() {
    let kinds = [
        ReceiverKind::Absorbing,
        ReceiverKind::Reflecting,
        ReceiverKind::Partial(Adsorption::Reactivity(50.0)),
    ];
    let words = |k: u32| Key::new(8).draw(k, 0, 0, Purpose::Release).map(open_unit);
    let receivers: Vec<_> = (0..300_u32)
        .map(|k| {
            let [x, y, z, r] = words(k);
            let center = [x, y, z].map(|u| 8.0 * u - 4.0);
            let (kind, sees) = (kinds[k as usize % 3].clone(), vec![true]);
            Receiver { center, radius: 0.1 + 0.3 * r, kind, sees, diffusion: 1.0, ..Receiver::default() }
        })
        .collect();
    let schedule = Schedule::Steady { from: 0.0, until: 1.0, rates: vec![(0, 5e5)] };
    let model = Model {
        time_step: 0.02,
        species: vec![Species { diffusion: 1.0, mass: 1.0, ..Species::default() }],
        transmitters: vec![Transmitter { schedule, shape: Shape::Box([1.0; 3]), ..Transmitter::default() }],
        boundary: Boundary::periodic([-4.0; 3], [4.0; 3]),
        receivers,
        ..Model::default()
    };
    let moved = |(k, receiver): (u32, &Receiver)| {
        let [x, y, z, _] = words(1000 + k);
        Place { center: receiver.center, displacement: [x, y, z].map(|u| 0.4 * u - 0.2) }
    };
    let places: Vec<_> = (0..).zip(&model.receivers).map(moved).collect();
    let events = PartialEvents::new(&model);
    let at = ReleaseStep { events: &events, key: Key::new(3), step: 1, next_id: 0, places: &places };
    let (mut arrived, mut left_out) = (0, 0);
    for (_, batch) in model.all_batches(1, at.key) {
        let born: Vec<_> =
            (0..batch.count).map(|k| (model.born(&batch, (k, k), at.key), batch.age(k, 0))).collect();
        let moves: Vec<_> = born.iter().map(|&born| model.path(&batch, born, at)).collect();
        let all: Vec<_> = events.surfaces.bodies.all.iter().collect();
        for (&born, moved) in born.iter().zip(moves) {
            let near = at.near(&model.boundary, &[moved]);
            left_out += all.len() - near.len();
            let Some((moved, _)) = moved else { continue };
            let [found, expected] =
                [&near, &all].map(|receivers| model.fate(&batch, born, (moved, &receivers[..]), at));
            assert_eq!(found, expected);
            arrived += usize::from(matches!(found, Fate::Arrived { .. }));
        }
    }
    assert!(arrived > 100 && left_out > 100_000, "{arrived} arrived, {left_out} receivers left out");
}
