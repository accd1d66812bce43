use lazygrid::Algorithm;
use lazygrid_sim::gpu::{GpuOptions, GpuSimulation};
use lazygrid_sim::{
    Adsorption, Axis, Boundary, Error, Model, Receiver, ReceiverKind, ReceptorType, Schedule, Shape,
    Simulation, State, Transmitter,
};

use super::device;
use super::models::{Runs, assert_close, brownian, burst, cpu, gpu, receiver, species, steps};

pub(super) fn surfaces() -> Model {
    let receptors = |count| ReceiverKind::Receptors(vec![ReceptorType::new(count, 40.0, 60.0, [0, 1])]);
    Model {
        receivers: vec![
            receiver("mirror", [0.0, 0.0, 0.0], 0.75, ReceiverKind::Reflecting),
            receiver("rate", [1.25, 0.0, 0.0], 0.5, ReceiverKind::Partial(Adsorption::Reactivity(30.0))),
            receiver("part", [-1.25, 0.0, 0.5], 0.5, ReceiverKind::Partial(Adsorption::PerStep(0.25))),
            receiver("few", [0.0, 1.25, 0.0], 0.5, receptors(4)),
            receiver("many", [0.0, -1.25, 0.0], 0.5, receptors(400)),
            receiver("absorber", [1.25, 1.25, 1.25], 0.375, ReceiverKind::Absorbing),
            receiver("ghost", [-1.0, -1.0, -1.0], 0.625, ReceiverKind::Transparent),
            receiver("endpoint", [-1.25, 1.25, -1.25], 0.375, ReceiverKind::Endpoint),
        ],
        time_step: 0.005,
        ..brownian(true)
    }
}

fn reflecting_receivers() -> Model {
    let mut model = surfaces();
    for (k, receiver) in model.receivers.iter_mut().enumerate().skip(1) {
        receiver.velocity = [0.5 * k as f64, -1.0, 0.25];
        receiver.diffusion = if k % 2 == 0 { 0.25 } else { 0.0 };
    }
    model
}

pub(super) fn compare(model: &Model, seed: u64, steps: u32) -> State {
    let Some(device) = device() else { return State::default() };
    let mut runs = Runs::new(&device, model, seed);
    for _ in 0..steps {
        runs.steps(1);
        runs.assert_close(2e-4);
    }
    runs.cpu.state().clone()
}

#[test]
fn arrivals_since_the_release_match_the_cpu() {
    let Some(device) = device() else { return };
    let schedule = Schedule::Steady { from: 0.0, until: 1.0, rates: vec![(0, 4e4)] };
    let steady = |center| Transmitter { center, schedule: schedule.clone(), ..burst(Shape::Point, &[]) };
    let mut model = reflecting_receivers();
    model.transmitters = vec![steady([0.85, 1.25, 1.25]), steady([0.0, 0.0, 0.8])];
    model.logs_arrivals = true;
    let mut runs = Runs::new(&device, &model, 5);
    runs.steps(1);
    assert!(runs.cpu.arrivals().len() > 20, "{} arrivals", runs.cpu.arrivals().len());
    assert_eq!(runs.gpu.arrivals(), runs.cpu.arrivals());
    runs.assert_close(0.0);
}

#[test]
fn surfaces_act_as_on_the_cpu() {
    for periodic in [false, true] {
        let mut model = surfaces();
        if periodic {
            model.boundary = Boundary::periodic([-2.0; 3], [2.0; 3]);
        }
        let state = compare(&model, 11, 8);
        if device().is_some() {
            let arrived = state.totals.arrived.iter().map(|row| row.iter().sum::<u64>());
            let silent: Vec<usize> = arrived.enumerate().filter(|(_, n)| *n == 0).map(|(k, _)| k).collect();
            assert_eq!(silent, [0, 6], "{:?}", state.totals.arrived);
            assert!((2..=4).contains(&state.totals.arrived[3].iter().sum::<u64>()));
        }
    }
}

#[test]
fn transmitters_go_where_they_go_on_the_cpu() {
    let Some(device) = device() else { return };
    let mut model = reflecting_receivers();
    model.transmitters[0].schedule = Schedule::Times((0..8).map(|k| 0.005 * f64::from(k)).collect());
    model.transmitters[0].release[0].1 = 100;
    model.transmitters[0].carrier = Some(7);
    let schedule = Schedule::Steady { from: 0.0, until: 1.0, rates: vec![(1, 20_000.0)] };
    model.transmitters.push(Transmitter { schedule, carrier: Some(6), ..burst(Shape::Point, &[]) });
    let mut runs = Runs::new(&device, &model, 14);
    runs.steps(8);
    runs.assert_close(2e-4);
    assert!(runs.cpu.state().totals.released[1] > 1500);
}

#[test]
fn receivers_move_as_on_the_cpu() {
    let Some(device) = device() else { return };
    let mut model = reflecting_receivers();
    model.boundary.axes[0] = Axis::Periodic { low: -2.0, high: 2.0 };
    let state = compare(&model, 12, 8);
    let mut at_once = gpu(&device, &model, 12);
    at_once.run(8).expect("steps");
    assert_close(&at_once.state().expect("a state"), &state, 2e-4);
    let mut model = reflecting_receivers();
    model.receivers.retain(|receiver| !receiver.kind.reflects());
    compare(&model, 13, 8);
}

fn crowd_of_receivers(boundary: Boundary, speed: f64) -> Model {
    let kinds = surfaces().receivers.into_iter().map(|receiver| receiver.kind);
    let kinds: Vec<ReceiverKind> = kinds.collect();
    let center = |k: u32| [k % 5, k / 5 % 5, k / 25].map(|c| 0.8 * c as f32 - 1.6);
    let one = |k: u32| {
        let [x, y, z] = center(k);
        let velocity = if k.is_multiple_of(3) { [speed, -speed, 0.5 * speed] } else { [0.0; 3] };
        let sees = vec![true, !k.is_multiple_of(4)];
        let center = [x, y + 0.125 * (k % 3) as f32, z];
        let mut kind = kinds[k as usize % kinds.len()].clone();
        if let ReceiverKind::Receptors(types) = &mut kind {
            types[0].ligands.retain(|ligand| sees[ligand.species as usize]);
        }
        Receiver { velocity, sees, ..receiver("one", center, 0.125, kind) }
    };
    Model { receivers: (0..100).map(one).collect(), boundary, time_step: 0.002, ..brownian(true) }
}

#[test]
fn listed_receivers_act_as_on_the_cpu() {
    let Some(device) = device() else { return };
    let periodic = Boundary::periodic([-2.0; 3], [2.0; 3]);
    for boundary in [Boundary::default(), Boundary::reflecting([-2.0; 3], [2.0; 3]), periodic] {
        for speed in [0.0, 2.0] {
            let model = crowd_of_receivers(boundary, speed);
            let mut runs = Runs::new(&device, &model, 18);
            runs.steps(6);
            runs.assert_close(2e-4);
            let met = runs.cpu.state().totals.arrived.iter().filter(|row| row.iter().any(|&n| n > 0)).count();
            assert!(met > 40, "{met}");
        }
    }
    let mut model = crowd_of_receivers(periodic, 2.0);
    model.receivers.retain(|receiver| !receiver.kind.reflects());
    let mut runs = Runs::new(&device, &model, 19);
    runs.steps(6);
    runs.assert_close(2e-4);
}

#[test]
fn resting_particles_are_pushed() {
    let pusher = Receiver {
        velocity: [0.0, 1.0, 0.0],
        ..receiver("pusher", [0.0, -2.0, 0.0], 1.0, ReceiverKind::Reflecting)
    };
    let mut model = brownian(false);
    model.species = vec![species("A", 0.0, [0.0; 3]), species("B", 0.0, [0.0, -0.5, 0.0])];
    model.time_step = 0.125;
    model.boundary.axes[1] = Axis::Open;
    model.receivers = vec![pusher];
    compare(&model, 14, 16);
}

/// Receivers push a particle from one to the next, out of the distance at which one receiver absorbs.
fn throwing() -> Model {
    let mirror = |center: [f32; 3], radius, velocity: f64| Receiver {
        velocity: [velocity, 0.0, 0.0],
        sees: vec![true],
        ..receiver("mirror", center, radius, ReceiverKind::Reflecting)
    };
    Model {
        time_step: 0.01,
        species: vec![species("A", 0.0, [0.0; 3])],
        receivers: vec![
            mirror([-0.06, 0.0, 0.0], 0.05, 100.0),
            mirror([0.76, -0.218, 0.0], 0.5, -100.0),
            mirror([-2.502, 2.224, 0.0], 0.3, 0.0),
        ],
        transmitters: vec![burst(Shape::Point, &[(0, 1)])],
        ..Model::default()
    }
}

#[test]
fn receivers_in_the_path_of_a_pushed_particle_are_found() {
    let Some(device) = device() else { return };
    for (center, velocity) in [([-2.502, 2.224, 0.0], [0.0; 3]), ([-2.6, 2.4, 0.0], [40.0, -40.0, 0.0])] {
        let mut model = throwing();
        (model.receivers[2].center, model.receivers[2].velocity) = (center, velocity);
        let mut runs = Runs::new(&device, &model, 17);
        runs.steps(1);
        runs.assert_close(1e-5);
        // Without the third receiver: (-2.345, 2.095).
        let [x, y, _] = runs.cpu.state().particles.position_of(0);
        assert!(x > -2.2 && y < 2.0, "{x}, {y}");
    }
}

/// With so large a number of receivers a particle searches once.
#[test]
fn a_push_beyond_the_receiver_search_is_an_error() {
    let Some(device) = device() else { return };
    let mut model = throwing();
    let far = |k: u32| receiver("mirror", [100.0 + k as f32, 0.0, 0.0], 0.25, ReceiverKind::Reflecting);
    model.receivers.extend((0..24_000).map(|k| Receiver { sees: vec![true], ..far(k) }));
    let mut run = gpu(&device, &model, 17);
    let error = run.run(1).expect_err("an error").to_string();
    assert!(error.contains("searches for moving surfaces"), "{error}");
    assert_eq!(run.state().expect("a state").step, 0);
}

#[test]
fn few_receptors_go_to_the_lowest_ranks() {
    let Some(device) = device() else { return };
    let kind = ReceiverKind::Receptors(vec![ReceptorType::new(700, 1e4, 20.0, [0])]);
    let model = Model {
        receivers: vec![
            Receiver { sees: vec![true], ..receiver("rx", [0.0; 3], 0.25, kind.clone()) },
            Receiver { sees: vec![true], ..receiver("other", [0.5; 3], 0.25, kind) },
        ],
        time_step: 0.01,
        species: vec![species("A", 1.0, [0.0; 3])],
        transmitters: vec![burst(Shape::Box([1.0; 3]), &[(0, 20_000)])],
        boundary: Boundary::reflecting([-0.5; 3], [0.5; 3]),
        ..Model::default()
    };
    let mut runs = Runs::new(&device, &model, 15);
    for _ in 0..4 {
        runs.steps(1);
        let (a, b) = (runs.gpu.state().expect("a state"), runs.cpu.state());
        assert_eq!(a.totals, b.totals);
        assert_eq!(a.totals.arrived[0][0], 700);
        let ids = |state: &State| {
            let mut ids: Vec<u32> = state.bound.iter().map(|held| held.id).collect();
            ids.sort_unstable();
            ids
        };
        assert_eq!(ids(&a), ids(b));
    }
}

#[test]
fn either_side_continues_with_bound_particles() {
    let Some(first_device) = device() else { return };
    let model = reflecting_receivers();
    let mut whole = cpu(&model, 16);
    steps(&mut whole, 9);
    let mut first = cpu(&model, 16);
    steps(&mut first, 3);
    assert!(!first.state().bound.is_empty());
    let mut second =
        GpuSimulation::resume(model.clone(), 16, first_device, GpuOptions::default(), first.state())
            .expect("a state");
    assert_close(&second.state().expect("a state"), first.state(), 0.0);
    assert_eq!(second.received(), first.received());
    second.run(3).expect("steps");
    let mut third = Simulation::resume(model.clone(), 16, Algorithm::Auto, second.state().expect("a state"))
        .expect("a state");
    steps(&mut third, 3);
    assert_close(third.state(), whole.state(), 2e-4);
    let other = Model { receivers: model.receivers[..1].to_vec(), ..model };
    let second_device = device().expect("a device");
    let refused = GpuSimulation::resume(other, 16, second_device, GpuOptions::default(), first.state());
    assert!(matches!(refused, Err(Error::Model(_))));
}

#[test]
fn steps_that_reach_too_many_surfaces_are_an_error() {
    let Some(device) = device() else { return };
    let mut model = brownian(false);
    model.time_step = 1.0;
    let center = |k: u32| [k % 5, k / 5 % 5, 0].map(|c| 0.25 * c as f32 - 0.5);
    model.receivers =
        (0..25).map(|k| receiver("mirror", center(k), 0.0625, ReceiverKind::Reflecting)).collect();
    let mut run = gpu(&device, &model, 1);
    let error = run.run(3).expect_err("an error").to_string();
    assert!(error.contains("surfaces within reach of a particle's step"), "{error}");
    assert_eq!(run.state().expect("a state").step, 0);
}
