use lazygrid::Algorithm;

use super::*;
use crate::model::particles::{Particle, Particles};
use crate::model::receiver::{Adsorption, Receiver, ReceiverKind};
use crate::model::receptors::ReceptorType;
use crate::model::vessel::Vessel;
use crate::model::{Flow, Model, Species};
use crate::motion::propagate::{Event, Propagator};
use crate::motion::receiver_state::move_receivers;
use crate::random::philox::{Key, StepKey, open_unit, philox};
use crate::{Simulation, Transmitter};

const MANY: u32 = 60;

fn random_point(k: u32) -> [f32; 3] {
    let [x, y, z, _] = philox([k, 1, 0, 0], [8, 8]).map(|word| 6.0 * open_unit(word) - 3.0);
    [x, y, z]
}

fn model(boundary: Boundary, flow: Option<Flow>, speed: f64) -> Model {
    let sizes = [0.05, 0.2, 0.5];
    let kinds = [
        ReceiverKind::Absorbing,
        ReceiverKind::Endpoint,
        ReceiverKind::Transparent,
        ReceiverKind::Reflecting,
        ReceiverKind::Partial(Adsorption::PerStep(0.3)),
        ReceiverKind::Partial(Adsorption::Reactivity(2.0)),
        ReceiverKind::Receptors(vec![ReceptorType::new(9, 2.0, 1.0, [0])]),
    ];
    let receiver = |k: u32| Receiver {
        name: "rx".into(),
        center: random_point(k),
        radius: sizes[k as usize % 3],
        kind: kinds[k as usize / 3 % 7].clone(),
        sees: vec![true, !k.is_multiple_of(4)],
        velocity: if k.is_multiple_of(5) { [speed, 0.0, -speed] } else { [0.0; 3] },
        diffusion: if k.is_multiple_of(7) { speed } else { 0.0 },
        ..Receiver::default()
    };
    let species = |name: &str, diffusion, drift, thermal_speed| Species {
        name: name.into(),
        radius: 0.01,
        diffusion,
        drift,
        thermal_speed,
        ..Species::default()
    };
    Model {
        time_step: 0.01,
        species: vec![species("A", 1.0, [0.0; 3], 0.0), species("B", 0.1, [20.0, 5.0, 0.0], 1.0)],
        receivers: (0..MANY).map(receiver).collect(),
        boundary,
        flow,
        ..Model::default()
    }
}

fn run(model: &Model, steps: u32, searches: bool) -> ((Vec<Event>, Particles), usize) {
    let mut motion = Propagator::new(model);
    let mut receiver_search =
        ReceiverSearch::new(&motion.surfaces.active_receivers, &model.boundary).unwrap().filter(|_| searches);
    assert_eq!(receiver_search.is_some(), searches);
    let mut searched = 0;
    let mut particles = Particles::default();
    for id in 0..1500 {
        let position = model.center_domains()[0].confine(random_point(id + 1000));
        let particle = Particle { id, position, radius: 0.01, species: id % 2, velocity: [1.0, 0.0, 0.5] };
        particles.push(particle, true);
    }
    let mut centers: Vec<[f32; 3]> = model.receivers.iter().map(|receiver| receiver.center).collect();
    let mut all = Vec::new();
    for step in 0..steps {
        searched += usize::from(
            receiver_search.as_ref().is_some_and(|receiver_search| receiver_search.cost.pause == 0),
        );
        let receiver_moves = move_receivers(model, &centers, Key::new(3), step);
        motion.surfaces.active_receivers.set(&centers, &receiver_moves, &vec![5; centers.len()]);
        let events = motion
            .advance(&mut particles, receiver_search.as_mut(), None, StepKey { key: Key::new(3), step })
            .unwrap();
        let mut removed: Vec<u32> = events.iter().map(Event::at).collect();
        particles.remove(&mut removed);
        centers = receiver_moves.iter().map(|receiver_move| receiver_move.center).collect();
        all.extend(events);
    }
    ((all, particles), searched)
}

#[test]
fn loop_replaces_searches_if_all_particles_are_near_receivers() {
    let model_of = |half: f32| {
        let mut model = model(Boundary::reflecting([-half; 3], [half; 3]), None, 0.0);
        let receiver = Receiver { center: [0.0; 3], radius: 0.2, ..model.receivers[9].clone() };
        model.receivers = vec![Receiver { kind: ReceiverKind::Reflecting, ..receiver }];
        model.species[1].drift = [0.0; 3];
        model
    };
    for (half, min_searched, max_searched) in [(0.35, 2, 40), (3.0, 400, 600)] {
        let model = model_of(half);
        let (found, searched) = run(&model, 600, true);
        assert!(
            (min_searched..=max_searched).contains(&searched),
            "{searched} of 600 steps searched in {half}"
        );
        assert_eq!(found, run(&model, 600, false).0, "{half}");
    }
}

#[test]
fn a_search_finds_the_receivers_of_a_loop() {
    let vessel = Vessel { along: Some(0), center: [0.0; 3], radius: 3.0 };
    let tube = Boundary { vessel: Some(vessel), ..Boundary::default() };
    let cases = [
        (Boundary::default(), None, 0.0),
        (Boundary::periodic([-3.0; 3], [3.0; 3]), None, 0.0),
        (Boundary::reflecting([-3.0; 3], [3.0; 3]), Some(Flow::Plug([3.0, 0.0, 0.0])), 0.0),
        (tube, Some(Flow::Poiseuille { mean: 10.0 }), 0.0),
        (Boundary::periodic([-3.0; 3], [3.0; 3]), None, 4.0),
        (Boundary::reflecting([-3.0; 3], [3.0; 3]), None, 4.0),
        (Boundary::periodic([-3.0; 3], [3.0; 3]), None, 60.0),
        (Boundary::default(), None, 60.0),
    ];
    for (boundary, flow, speed) in cases {
        let model = model(boundary, flow, speed);
        let (steps, min_searched) = if speed > 10.0 { (12, 8) } else { (100, 50) };
        let ((found, particles), searched) = run(&model, steps, true);
        assert!(searched > min_searched, "{searched}");
        assert!(found.len() > 100 && particles.len() > 100, "{} {}", found.len(), particles.len());
        assert_eq!((found, particles), run(&model, steps, false).0, "{boundary:?}, {speed}");
    }
}

#[test]
fn receivers_in_the_path_of_a_pushed_particle_are_found() {
    let receiver_at = |center: f32, kind, velocity| Receiver {
        name: "rx".into(),
        center: [center, 0.0, 0.0],
        radius: 0.5,
        kind,
        sees: vec![true],
        velocity: [velocity, 0.0, 0.0],
        ..Receiver::default()
    };
    for (kind, back) in
        [(ReceiverKind::Absorbing, 0.0), (ReceiverKind::Reflecting, 0.0), (ReceiverKind::Reflecting, -100.0)]
    {
        let model = Model {
            time_step: 0.01,
            species: vec![Species { name: "A".into(), radius: 0.01, ..Species::default() }],
            receivers: vec![
                receiver_at(-0.51, ReceiverKind::Reflecting, 100.0),
                receiver_at(2.1, kind.clone(), back),
                receiver_at(4.2, ReceiverKind::Absorbing, 0.0),
            ],
            ..Model::default()
        };
        let after = [true, false].map(|searches| {
            let mut motion = Propagator::new(&model);
            let mut receiver_search = ReceiverSearch::new(&motion.surfaces.active_receivers, &model.boundary)
                .unwrap()
                .filter(|_| searches);
            let mut particles = Particles::default();
            particles.push(Particle::default(), false);
            let centers: Vec<_> = model.receivers.iter().map(|receiver| receiver.center).collect();
            motion.surfaces.active_receivers.set(
                &centers,
                &move_receivers(&model, &centers, Key::new(3), 0),
                &[0; 3],
            );
            let events = motion
                .advance(
                    &mut particles,
                    receiver_search.as_mut(),
                    None,
                    StepKey { key: Key::new(3), step: 0 },
                )
                .unwrap();
            (events, particles)
        });
        assert_eq!(after[0], after[1]);
        let x = after[0].1.position[0][0];
        assert!(
            kind == ReceiverKind::Absorbing && after[0].0.len() == 1
                || kind == ReceiverKind::Reflecting && x < 1.6,
            "{after:?}"
        );
    }
}

#[test]
fn receivers_by_the_side_of_a_vessel_are_found_without_diffusion() {
    let vessel = Vessel { along: Some(0), center: [0.0; 3], radius: 5.0 };
    let receiver = Receiver { center: [0.0, 4.0, 0.0], radius: 0.5, sees: vec![true], ..Receiver::default() };
    let model = Model {
        time_step: 0.1,
        species: vec![Species { drift: [0.0, 99.0, 0.0], ..Species::default() }],
        receivers: vec![receiver],
        boundary: Boundary { vessel: Some(vessel), ..Boundary::default() },
        transmitters: vec![Transmitter { release: vec![(0, 5)], ..Transmitter::default() }],
        ..Model::default()
    };
    let mut simulation = Simulation::new(model, 1, Algorithm::Auto).unwrap();
    simulation.step().unwrap();
    assert_eq!(simulation.state().totals.arrived[0][0], 5);
}
