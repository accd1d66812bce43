use super::*;
use crate::model::Species;
use crate::model::transmitter::{Schedule, Shape, Transmitter};
use crate::model::vessel::Vessel;
use crate::random::philox::{Key, open_unit};
use crate::release::PartialEvents;
use crate::release::rank_slice::RankSlice;
use crate::{Adsorption, Receiver, ReceiverKind};

const SPEED: f32 = 20.0;

fn swimmers(boundary: Boundary, center: [f32; 3]) -> Model {
    let schedule = Schedule::Steady { from: 0.0, until: 1.0, rates: vec![(0, 2e4)] };
    Model {
        time_step: 0.1,
        species: vec![Species { speed: SPEED.into(), ..Species::default() }],
        transmitters: vec![Transmitter { center, schedule, ..Transmitter::default() }],
        boundary,
        ..Model::default()
    }
}

fn released(model: &Model) -> Vec<Particle> {
    let events = PartialEvents::new(model);
    let at = first_step(&events, &[]);
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

#[test]
fn a_vessel_reflects_velocities_since_the_release() {
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

fn first_step<'a>(events: &'a PartialEvents, receiver_moves: &'a [ReceiverMove]) -> ReleaseStep<'a> {
    ReleaseStep { events, key: Key::new(3), step: 1, next_id: 0, receiver_moves }
}

fn crowd() -> (Model, Vec<ReceiverMove>) {
    let kinds = [
        ReceiverKind::Absorbing,
        ReceiverKind::Reflecting,
        ReceiverKind::Partial(Adsorption::Reactivity(50.0)),
    ];
    let words = |k: u32| Key::new(8).draw(k, 0, 0, Purpose::Release).map(open_unit);
    let receiver = |k: u32| {
        let [x, y, z, r] = words(k);
        let center = [x, y, z].map(|u| 8.0 * u + 10.0);
        let (kind, sees) = (kinds[k as usize % 3].clone(), vec![true]);
        Receiver { center, radius: 0.1 + 0.3 * r, kind, sees, diffusion: 1.0, ..Receiver::default() }
    };
    let schedule = Schedule::Steady { from: 0.0, until: 1.0, rates: vec![(0, 5e5)] };
    let shape = Shape::Box([1.0; 3]);
    let model = Model {
        time_step: 0.02,
        species: vec![Species { diffusion: 1.0, ..Species::default() }],
        // At a corner, so that particles appear at all corners.
        transmitters: vec![Transmitter { schedule, shape, center: [10.1; 3], ..Transmitter::default() }],
        boundary: Boundary::periodic([10.0; 3], [18.0; 3]),
        receivers: (0..300).map(receiver).collect(),
        logs_arrivals: true,
        ..Model::default()
    };
    let moved = |(k, receiver): (u32, &Receiver)| {
        let [x, y, z, _] = words(1000 + k);
        ReceiverMove { center: receiver.center, displacement: [x, y, z].map(|u| 0.4 * u - 0.2) }
    };
    let receiver_moves = (0..).zip(&model.receivers).map(moved).collect();
    (model, receiver_moves)
}

#[test]
fn distant_receivers_change_nothing() {
    let (model, receiver_moves) = crowd();
    let events = PartialEvents::new(&model);
    let at = first_step(&events, &receiver_moves);
    let all: Vec<_> = events.surfaces.active_receivers.all.iter().collect();
    let batch = model.all_batches(1, at.key).next().expect("a batch");
    let born: Vec<_> = (0..batch.count)
        .map(|k| AgedParticle {
            particle: model.create_particle(&batch, (k, k), at.key),
            age: batch.age(k, 0),
        })
        .collect();
    let moves: Vec<_> = born.iter().map(|&born| model.partial_move(&batch, born, at)).collect();
    let (mut arrived, mut left_out, mut first) = (0, 0, 0);
    for length in (1..=7).cycle() {
        let range = first..(first + length).min(born.len());
        if range.is_empty() {
            break;
        }
        first = range.end;
        let near = at.receivers_near(&model.boundary, &moves[range.clone()]);
        left_out += all.len() - near.len();
        for (&born, moved) in born[range.clone()].iter().zip(&moves[range]) {
            let [found, expected] =
                [&near, &all].map(|receivers| model.partial_outcome(born, moved.clone(), receivers, at));
            assert_eq!(found, expected);
            arrived += usize::from(matches!(found.end_state, EndState::Arrived { .. }));
        }
    }
    assert!(first == 10_000 && arrived > 100 && left_out > 100_000, "{arrived} arrived, {left_out} left out");
}

#[test]
fn neither_threads_nor_ranks_change_a_release() {
    let (model, receiver_moves) = crowd();
    let events = PartialEvents::new(&model);
    let at = first_step(&events, &receiver_moves);
    let whole = model.release(at, RankSlice::WHOLE).expect("a release");
    assert!(whole.particles.len() > 5000 && whole.arrivals.len() > 100);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(7).build().expect("a pool");
    let other = pool.install(|| model.release(at, RankSlice::WHOLE)).expect("a release");
    assert!(other.particles == whole.particles && other.arrivals == whole.arrivals);
    let (mut particles, mut arrivals) = (crate::model::particles::Particles::default(), Vec::new());
    for rank in 0..3 {
        let slice = model.release(at, RankSlice::new(rank, 3)).expect("a release");
        (0..slice.particles.len()).for_each(|at| particles.push(slice.particles.get(at), false));
        arrivals.extend(slice.arrivals);
    }
    assert!(particles == whole.particles && arrivals == whole.arrivals);
}

/// Rounding leaves tiny ages to particles due at the end of a step.
#[test]
fn flow_pulse_carries_particles_of_the_least_ages() {
    let schedule = Schedule::Steady { from: 0.0, until: 1e9, rates: vec![(0, 100.0)] };
    let model = Model {
        time_step: 0.1,
        species: vec![Species::default()],
        transmitters: vec![Transmitter { schedule, ..Transmitter::default() }],
        flow: Some(crate::model::Flow::Plug([5.0, 0.0, 0.0])),
        flow_pulse: Some([0.0, f64::INFINITY]),
        ..Model::default()
    };
    let (events, mut min_age) = (PartialEvents::new(&model), f64::INFINITY);
    for step in 1..100 {
        let at = ReleaseStep { events: &events, key: Key::new(3), step, next_id: 0, receiver_moves: &[] };
        for batch in model.all_batches(step, at.key) {
            let ages = (0..batch.count).map(|nth| batch.age(nth, 0)).filter(|&age| age > 0.0);
            min_age = ages.fold(min_age, f64::min);
        }
        let particles = model.release(at, RankSlice::WHOLE).expect("a release").particles;
        let positions = (0..particles.len()).map(|at| particles.position_of(at));
        positions.for_each(|at| assert!(at[0] >= 0.0 && at[0] <= 0.5, "{at:?} in step {step}"));
    }
    assert!(min_age < 1e-16, "{min_age} s");
}
