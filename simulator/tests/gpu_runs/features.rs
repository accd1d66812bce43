use lazygrid::gpu::GpuDevice;
use lazygrid_sim::gpu::{GpuOptions, GpuSimulation};
use lazygrid_sim::model::receiver::WallFace;
use lazygrid_sim::{
    Arrival, Axis, Boundary, Decay, Flow, Model, ReactionRate, Receiver, ReceiverKind, ReceptorType,
    Schedule, Shape, Species, Transmitter, Unbinding, Vessel,
};

use super::device;
use super::models::{
    Runs, assert_close, brownian, by_id, cpu, decay, dyadic, gpu_with, reaction, receiver, species, steps,
};
use super::surfaces::{compare, surfaces};

fn swimmers() -> Model {
    let mut model = surfaces();
    model.time_step = 0.004;
    model.species[0] = Species { speed: 20.0, tumble_rate: 40.0, ..model.species[0].clone() };
    model.species[1] = Species { thermal_speed: 5.0, diffusion: 0.25, ..model.species[1].clone() };
    model.species.push(Species { speed: 30.0, ..species("C", 0.0, [0.0; 3]) });
    model.reactions =
        vec![reaction([0, 1], [Some(2), None], 0.125, 0.5), reaction([1, 2], [Some(0), Some(2)], 0.125, 0.5)];
    model.decays = vec![decay(0, Some(1), 5.0), decay(2, Some(0), 5.0), decay(1, Some(2), 5.0)];
    for receiver in &mut model.receivers {
        receiver.sees = vec![true; 3];
    }
    model.receivers.retain(|receiver| !matches!(receiver.name.as_str(), "rate" | "part" | "absorber"));
    for receiver in &mut model.receivers {
        if let ReceiverKind::Receptors(_) = receiver.kind {
            receiver.radius = 1.0;
        }
    }
    model.receivers.retain(|receiver| !matches!(receiver.kind, ReceiverKind::Receptors(_)));
    model
}

#[test]
fn swimmers_move_as_on_the_cpu() {
    for periodic in [false, true] {
        let mut model = swimmers();
        if periodic {
            model.boundary = Boundary::periodic([-2.0; 3], [2.0; 3]);
        }
        let state = compare(&model, 21, 8);
        if device().is_some() {
            let totals = &state.totals;
            assert!(totals.reacted.iter().chain(&totals.decayed).all(|&count| count > 0), "{totals:?}");
        }
        model.receivers.retain(|receiver| !receiver.kind.reflects());
        compare(&model, 22, 8);
    }
}

#[test]
fn unbound_swimmers_have_the_velocities_of_the_cpu() {
    let mut model = brownian(false);
    model.time_step = 0.002;
    model.species[0].speed = 2.0;
    let receptors = vec![ReceptorType::new(400, 400.0, 100.0, [0, 1])];
    model.receivers = vec![receiver("cell", [0.0; 3], 1.0, ReceiverKind::Receptors(receptors))];
    let state = compare(&model, 23, 8);
    if device().is_some() {
        assert!(state.totals.arrived[0].iter().all(|&count| count > 0), "{:?}", state.totals.arrived);
    }
}

fn in_vessel(along: usize, ends: Axis) -> Model {
    let mut axes = [Axis::Open; 3];
    axes[along] = ends;
    let vessel = Vessel { along: Some(along), center: [0.125, -0.25, 0.5], radius: 1.5 };
    let mut model = brownian(true);
    model.time_step = 0.02;
    model.boundary = Boundary { axes, vessel: Some(vessel) };
    model.flow = Some(Flow::Poiseuille { mean: 1.0 });
    model.species[1].radius = 0.125;
    model.species[1].drift = [0.0; 3];
    let mut center = vessel.center;
    center[(along + 1) % 3] += 1.25;
    model.receivers = vec![receiver("wall", center, 1.0, ReceiverKind::Absorbing)];
    for transmitter in &mut model.transmitters {
        transmitter.center = vessel.center;
        transmitter.shape = Shape::Cylinder(along, 1.25, 3.0);
    }
    model
}

#[test]
fn vessels_carry_as_on_the_cpu() {
    let ends =
        [Axis::Open, Axis::Reflecting { low: -2.0, high: 2.0 }, Axis::Periodic { low: -2.0, high: 2.0 }];
    for (along, ends) in ends.into_iter().enumerate() {
        let state = compare(&in_vessel(along, ends), 24, 8);
        if device().is_some() {
            assert!(state.totals.reacted[0] > 0 && state.totals.arrived[0].iter().all(|&n| n > 0), "{along}");
        }
        let mut swimming = in_vessel(along, ends);
        swimming.receivers.clear();
        swimming.species[0].speed = 20.0;
        compare(&swimming, 25, 8);
    }
    let mut sphere = in_vessel(0, Axis::Open);
    sphere.boundary.vessel = sphere.boundary.vessel.map(|vessel| Vessel { along: None, ..vessel });
    sphere.flow = None;
    for transmitter in &mut sphere.transmitters {
        transmitter.shape = Shape::Shell(0.0, 1.25);
    }
    let state = compare(&sphere, 24, 8);
    if device().is_some() {
        assert!(state.totals.reacted[0] > 0 && state.totals.arrived[0].iter().all(|&n| n > 0));
    }
    sphere.receivers.clear();
    sphere.species[0].speed = 20.0;
    compare(&sphere, 25, 8);
}

/// The ends of the pulse are within steps.
#[test]
fn pulses_of_flow_match_the_cpu() {
    let Some(device) = device() else { return };
    let plug = |velocity| Model { flow: Some(Flow::Plug(velocity)), time_step: 0.004, ..brownian(true) };
    let models = [plug([40.0, 0.0, 0.0]), plug([-0.5, 30.0, 0.0]), in_vessel(1, Axis::Open)];
    for (k, mut model) in models.into_iter().enumerate() {
        let time_step = model.time_step;
        model.flow_pulse = Some([2.25, 5.75].map(|steps| steps * time_step));
        let mut runs = Runs::new(&device, &model, 31);
        for steps in [5, 4] {
            runs.steps(steps);
            runs.assert_close(2e-4);
        }
        model.flow_pulse = None;
        let mut steady = cpu(&model, 31);
        steps(&mut steady, 9);
        assert_ne!(steady.state().particles, runs.cpu.state().particles, "model {k}");
    }
}

fn wall(name: &str, face: WallFace) -> Receiver {
    receiver(name, [0.0; 3], 0.0, ReceiverKind::Wall(face))
}

fn with_walls(mut model: Model, faces: &[WallFace]) -> Model {
    model.logs_arrivals = true;
    model.decays = vec![decay(1, Some(0), 5.0)];
    model.receivers.extend(faces.iter().map(|&face| wall("wall", face)));
    model
}

#[test]
fn walls_absorb_as_on_the_cpu() {
    let Some(device) = device() else { return };
    let faces = [WallFace::Low(0), WallFace::High(0), WallFace::High(1), WallFace::Low(2)];
    let mut planes = Model { time_step: 0.02, ..with_walls(brownian(true), &faces) };
    planes.species[0].radius = 0.125;
    planes.species[0].drift = [-1.0, 0.5, 1.0];
    planes.receivers[3].sees = vec![false, true];
    planes.receivers.insert(1, receiver("at the wall", [1.75, 0.0, 0.0], 0.5, ReceiverKind::Absorbing));
    let mut mirrors = planes.clone();
    mirrors.receivers[1].kind = ReceiverKind::Reflecting;
    let faces = [WallFace::Side, WallFace::Low(1), WallFace::High(1)];
    let ends = Axis::Reflecting { low: -2.0, high: 2.0 };
    let mut cylinder = with_walls(in_vessel(1, ends), &faces);
    cylinder.receivers.remove(0);
    let vessel = Vessel { along: None, center: [0.125, -0.25, 0.5], radius: 1.5 };
    let mut sphere = with_walls(brownian(true), &faces[..1]);
    sphere.boundary = Boundary { axes: [Axis::Open; 3], vessel: Some(vessel) };
    sphere.species[1].drift = [0.0; 3];
    for transmitter in &mut sphere.transmitters {
        (transmitter.center, transmitter.shape) = (vessel.center, Shape::Shell(0.0, 1.25));
    }
    let long = Model { time_step: 0.05, ..sphere.clone() };
    let beyond = Model { time_step: 1.5, ..sphere.clone() };
    for (k, model) in [planes, mirrors, cylinder, sphere, long, beyond].into_iter().enumerate() {
        let mut runs = Runs::new(&device, &model, 32);
        let mut expected = Vec::new();
        for _ in 0..6 {
            runs.cpu.step().expect("a step");
            expected.extend_from_slice(runs.cpu.arrivals());
        }
        runs.gpu.run(6).expect("steps");
        assert_eq!(runs.gpu.arrivals(), expected, "model {k}");
        runs.assert_close(2e-4);
        let silent = |row: &&Vec<u64>| row.iter().sum::<u64>() == 0;
        assert_eq!(
            runs.cpu.state().totals.arrived.iter().filter(silent).count(),
            usize::from(k == 1),
            "model {k}"
        );
    }
}

#[test]
fn decay_chains_match_the_cpu() {
    let mut model = brownian(true);
    model.species.push(species("C", 0.5, [0.0; 3]));
    model.species[2].radius = 0.25;
    model.decays = vec![
        decay(0, Some(1), 900.0),
        decay(1, Some(2), 700.0),
        decay(2, Some(0), 1500.0),
        decay(2, None, 50.0),
    ];
    let state = compare(&model, 26, 6);
    if device().is_some() {
        assert!(state.totals.decayed[0] > 3000, "{:?}", state.totals.decayed);
    }
}

#[test]
fn reaction_channels_match_the_cpu() {
    let mut model = brownian(true);
    model.species.push(species("C", 0.5, [0.0; 3]));
    model.reactions = vec![
        reaction([0, 1], [Some(2), None], 0.25, 0.25),
        reaction([1, 0], [Some(1), Some(2)], 0.125, 0.5),
        reaction([0, 1], [None, None], 0.1875, 0.25),
        reaction([0, 0], [Some(2), Some(1)], 0.125, 0.5),
        reaction([0, 0], [Some(1), None], 0.25, 0.125),
        reaction([2, 1], [Some(0), Some(1)], 0.125, 0.125),
    ];
    model.reactions[5].chance = ReactionRate::PerTime(40.0);
    let state = compare(&model, 27, 8);
    if device().is_some() {
        assert!(state.totals.reacted.iter().all(|&count| count > 10), "{:?}", state.totals.reacted);
    }
}

pub(super) fn dissociating() -> Model {
    let mut model = brownian(true);
    model.species.push(Species { radius: 0.0625, ..species("C", 0.5, [0.0; 3]) });
    model.reactions = vec![reaction([0, 1], [Some(2), None], 0.25, 0.5)];
    let dissociation =
        |products, unbinding, rate| Decay { reactant: 2, products, unbinding, rate, ..Decay::default() };
    model.decays = vec![
        dissociation([Some(0), Some(1)], Unbinding::Apart(0.125), 200.0),
        dissociation([Some(1), Some(0)], Unbinding::Within(0.25), 200.0),
        dissociation([Some(1), None], Unbinding::Apart(0.0), 50.0),
    ];
    model.receivers = vec![
        Receiver {
            sees: vec![true; 3],
            ..receiver("absorber", [1.0, 0.0, 0.0], 0.5, ReceiverKind::Absorbing)
        },
        Receiver {
            sees: vec![true, false, true],
            ..receiver("endpoint", [-1.0, 0.0, 0.0], 0.5, ReceiverKind::Endpoint)
        },
    ];
    model.transmitters[0].schedule = Schedule::Times(vec![0.0, 0.003, 0.004]);
    model.transmitters.push(Transmitter {
        schedule: Schedule::Steady { from: 0.0055, until: 0.009, rates: vec![(2, 20_000.0)] },
        ..model.transmitters[1].clone()
    });
    model.logs_arrivals = true;
    model
}

fn in_portions(
    device: &GpuDevice,
    model: &Model,
    options: GpuOptions,
    portions: &[u32],
) -> (Vec<Arrival>, GpuSimulation) {
    let mut run = gpu_with(device, model, 28, options);
    let mut arrivals = Vec::new();
    for &steps in portions {
        run.run(steps).expect("steps");
        arrivals.extend_from_slice(run.arrivals());
    }
    (arrivals, run)
}

#[test]
fn dissociations_and_arrivals_match_the_cpu() {
    let Some(device) = device() else { return };
    let model = dissociating();
    let mut cpu_run = cpu(&model, 28);
    let mut expected = Vec::new();
    for _ in 0..12 {
        cpu_run.step().expect("a step");
        expected.extend_from_slice(cpu_run.arrivals());
    }
    assert!(cpu_run.state().totals.decayed.iter().all(|&count| count > 20), "{:?}", cpu_run.state().totals);
    assert!(expected.len() > 100 && expected.iter().any(|arrival| arrival.receiver == 1));
    let tight =
        GpuOptions { birth_capacity: 1, event_capacity: 1, pair_capacity: 1, ..GpuOptions::default() };
    for (options, portions) in [
        (GpuOptions::default(), vec![1; 12]),
        (GpuOptions::default(), vec![12]),
        (tight, vec![5, 7]),
        (tight, vec![12]),
    ] {
        let (arrivals, run) = in_portions(&device, &model, options, &portions);
        let state = run.state().expect("a state");
        assert_close(&state, cpu_run.state(), 2e-4);
        assert_eq!(state.origins, cpu_run.state().origins, "{options:?}");
        assert_eq!(arrivals, expected, "{options:?} {portions:?}");
    }
}

#[test]
fn dissociating_swimmers_have_the_velocities_of_the_cpu() {
    let mut model = dissociating();
    model.receivers.clear();
    model.logs_arrivals = false;
    model.species[0].speed = 10.0;
    model.species[2].speed = 20.0;
    let state = compare(&model, 29, 8);
    for particle in by_id(&state) {
        let expected = model.species[particle.species as usize].speed;
        let found = particle.velocity.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt();
        assert!((found - expected).abs() < 1e-4, "{found}, not {expected}: {particle:?}");
    }
}

#[test]
fn changed_thermal_speeds_match_the_cpu() {
    let mut model = dissociating();
    model.receivers.clear();
    model.logs_arrivals = false;
    for (species, thermal_speed) in model.species.iter_mut().zip([10.0, 0.0, 5.0]) {
        species.thermal_speed = thermal_speed;
    }
    let state = compare(&model, 30, 8);
    let resting = by_id(&state).into_iter().filter(|particle| particle.species == 1);
    assert!(resting.into_iter().all(|particle| particle.velocity == [0.0; 3]));
    model.decays = vec![decay(1, Some(2), 200.0)];
    compare(&model, 31, 8);
}

#[test]
fn dissociation_grows_beyond_the_capacity_for_particles() {
    let Some(device) = device() else { return };
    let mut model = brownian(false);
    model.time_step = 1.0;
    model.species.iter_mut().for_each(|species| species.diffusion = 0.0);
    model.decays = vec![Decay {
        reactant: 0,
        products: [Some(0), Some(0)],
        unbinding: Unbinding::Apart(0.25),
        rate: 0.7,
        ..Decay::default()
    }];
    let mut runs = Runs::new(&device, &model, 30);
    runs.steps(5);
    assert!(runs.cpu.state().particles.len() > 8_000);
    runs.assert_close(2e-4);
}

#[test]
fn arrivals_of_exact_runs_match_the_cpu() {
    let Some(device) = device() else { return };
    let model = Model { logs_arrivals: true, ..dyadic() };
    let mut cpu_run = cpu(&model, 28);
    let mut expected = Vec::new();
    for _ in 0..9 {
        cpu_run.step().expect("a step");
        expected.extend_from_slice(cpu_run.arrivals());
    }
    assert!(expected.len() > 20);
    let (arrivals, run) = in_portions(&device, &model, GpuOptions::default(), &[9]);
    assert_eq!(arrivals, expected);
    assert_eq!(run.state().expect("a state").origins, cpu_run.state().origins);
}
