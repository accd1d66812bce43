use std::f64::consts::PI;

use lazygrid_sim::model::vessel::Vessel;
use lazygrid_sim::{Boundary, Contact, Model, Particles, Schedule, Shape, Species, Transmitter};

use super::*;

pub(super) fn crowd(contact: Contact, packing: f64, length: f64, per_side: u32) -> Model {
    let n = per_side.pow(3);
    let side = (f64::from(n) * PI / 6.0 / packing).cbrt() as f32;
    let time_step = if contact == Contact::Elastic { length } else { length * length / 2.0 };
    let thermal_speed = if contact == Contact::Elastic { 1.0 } else { 0.0 };
    let diffusion = if contact == Contact::Elastic { 0.0 } else { 1.0 };
    let kind = Species { radius: 0.5, thermal_speed, ..species("A", diffusion, [0.0; 3]) };
    let heavy = Species { mass: 2.0, radius: 0.4, diffusion: 0.5 * diffusion, ..kind.clone() };
    let half = side / 2.0;
    Model {
        time_step,
        species: vec![kind, heavy],
        contact,
        boundary: Boundary::periodic([-half; 3], [half; 3]),
        transmitters: vec![Transmitter {
            shape: Shape::Lattice([side; 3], [per_side; 3]),
            release: vec![(0, n - n / 4), (1, n / 4)],
            ..models::lattice([0.0; 3], &[0.0], 0, per_side)
        }],
        ..Model::default()
    }
}

fn distance(a: &Particles, b: &Particles, boundary: &Boundary) -> f32 {
    let rows = |all: &Particles| {
        let mut rows: Vec<_> = (0..all.len()).map(|at| (all.id[at], all.position_of(at))).collect();
        rows.sort_by_key(|row| row.0);
        rows
    };
    let (a, b) = (rows(a), rows(b));
    assert_eq!(a.len(), b.len());
    let mut farthest = 0.0;
    for ((id, p), (other, q)) in a.into_iter().zip(b) {
        assert_eq!(id, other);
        farthest = f32::max(farthest, boundary.displacement(p, q).map(|c| c * c).iter().sum::<f32>().sqrt());
    }
    farthest
}

#[test]
fn collisions_match_the_cpu() {
    let Some(device) = device() else { return };
    for contact in [Contact::Separate, Contact::Elastic] {
        for case in 0..5 {
            let mut model = crowd(contact, 0.25, 0.15, 6);
            let half = 4.0;
            match case {
                // Reactants pass through each other, however seldom they react.
                0 => model.reactions = vec![models::reaction([0, 1], [None; 2], 0.1, 0.0)],
                1 => model.boundary = Boundary::reflecting([-half; 3], [half; 3]),
                2 | 3 => {
                    let vessel = Vessel { along: (case == 2).then_some(2), center: [0.0; 3], radius: 6.5 };
                    model.boundary = Boundary { vessel: Some(vessel), ..Boundary::default() };
                }
                _ => model.boundary = Boundary::default(),
            }
            model.transmitters[0].shape = Shape::Lattice([6.6; 3], [6; 3]);
            let mut runs = Runs::new(&device, &model, 5);
            let mut met = 0;
            for step in 0..4 {
                runs.steps(1);
                assert_eq!(
                    runs.gpu.totals().contacts,
                    runs.cpu.state().totals.contacts,
                    "{contact:?} {case} {step}"
                );
                met += runs.gpu.totals().contacts;
                let far = distance(
                    &runs.gpu.state().expect("a state").particles,
                    &runs.cpu.state().particles,
                    &model.boundary,
                );
                assert!(far < 3e-4 * 4f32.powi(step), "{contact:?} {case} {step}: {far}");
            }
            assert!(met > 50, "{met}");
        }
    }
}

#[test]
fn points_of_a_burst_collide_with_spheres_as_on_the_cpu() {
    let Some(device) = device() else { return };
    for contact in [Contact::Separate, Contact::Elastic] {
        let mut model = crowd(contact, 0.3, 0.15, 6);
        model.species[1].radius = 0.0;
        model.transmitters.push(burst(Shape::Point, &[(1, 200)]));
        let mut runs = Runs::new(&device, &model, 5);
        let mut met = 0;
        for step in 0..3 {
            runs.steps(1);
            let contacts = runs.cpu.state().totals.contacts;
            assert_eq!(runs.gpu.totals().contacts, contacts, "{contact:?} {step}");
            met += contacts;
            let gpu_particles = runs.gpu.state().expect("a state").particles;
            let far = distance(&gpu_particles, &runs.cpu.state().particles, &model.boundary);
            assert!(far < 3e-4 * 4f32.powi(step), "{contact:?} {step}: {far}");
        }
        assert!(met > 50, "{contact:?}: {met}");
    }
}

#[test]
fn long_steps_keep_energy_and_leave_no_overlap() {
    let Some(device) = device() else { return };
    let model = crowd(Contact::Elastic, 0.3, 1.0, 5);
    let mut gpu_run = gpu_with(&device, &model, 3, GpuOptions { pair_capacity: 1, ..GpuOptions::default() });
    let energy = |state: &lazygrid_sim::State| -> f64 {
        let all = &state.particles;
        let square = |at: usize| -> f64 {
            let mass = model.species[all.species[at] as usize].mass;
            mass * all.get(at).velocity.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>()
        };
        (0..all.len()).map(square).sum()
    };
    let before = energy(&gpu_run.state().expect("a state"));
    gpu_run.run(3).expect("steps");
    let state = gpu_run.state().expect("a state");
    assert!(gpu_run.totals().contacts > 200, "{}", gpu_run.totals().contacts);
    assert!((energy(&state) / before - 1.0).abs() < 1e-5, "{}", energy(&state) / before);
    let all = &state.particles;
    for a in 0..all.len() {
        for b in 0..a {
            let d = model.boundary.displacement(all.position_of(a), all.position_of(b));
            let touch = all.radius[a] + all.radius[b];
            let gap = d.map(|c| c * c).iter().sum::<f32>().sqrt() - touch;
            assert!(gap > -0.008 * touch, "{gap}");
        }
    }
}

#[test]
fn overlaps_are_separated_as_on_the_cpu() {
    let Some(device) = device() else { return };
    let mut model = crowd(Contact::Separate, 0.1, 0.02, 4);
    model.transmitters[0].shape = Shape::Shell(0.0, 0.7);
    for probability in [0.05, 0.0] {
        model.reactions = vec![models::reaction([0, 1], [None, Some(1)], 0.5, probability)];
        let mut runs = Runs::new(&device, &model, 5);
        runs.steps(1);
        let totals = &runs.cpu.state().totals;
        assert!(totals.contacts > 300 && (totals.reacted[0] > 3) == (probability > 0.0), "{totals:?}");
        assert_eq!(runs.gpu.totals().contacts, totals.contacts);
        assert_eq!(runs.gpu.totals().reacted, totals.reacted);
        let gpu_particles = runs.gpu.state().expect("a state").particles;
        let far = distance(&gpu_particles, &runs.cpu.state().particles, &model.boundary);
        assert!(far < 1e-4, "{probability}: {far}");
    }
}

#[test]
fn crowd_is_not_pushed_into_a_receiver_and_moves_as_on_the_cpu() {
    let Some(device) = device() else { return };
    for velocity in [0.0, 20.0] {
        let mut model = crowd(Contact::Separate, 0.3, 0.14, 6);
        model.transmitters[0].shape = Shape::Shell(2.6, 3.5);
        let receiver = |radius, sees| Receiver {
            radius,
            sees,
            kind: ReceiverKind::Reflecting,
            velocity: [velocity, 0.0, 0.0],
            ..Receiver::default()
        };
        // Four or more receivers have lists.
        model.receivers = vec![receiver(2.5, vec![true, true])];
        model.receivers.extend((1..5).map(|k| receiver(0.2 * k as f32, vec![true, false])));
        let mut runs = Runs::new(&device, &model, 5);
        let step = |run: &mut GpuSimulation| {
            run.run(1).expect("a step");
            let state = run.state().expect("a state");
            for at in 0..state.particles.len() {
                let p = state.particles.position_of(at);
                let d = model.boundary.displacement(state.centers[0], p);
                let height = d.map(|c| c * c).iter().sum::<f32>().sqrt() - 2.5;
                assert!(height > -1e-5, "{at} is {height} µm inside");
            }
            state
        };
        let state = step(&mut runs.gpu);
        runs.cpu.step().expect("a step");
        assert!(runs.cpu.state().totals.contacts > 300);
        assert_eq!(runs.gpu.totals().contacts, runs.cpu.state().totals.contacts);
        let far = distance(&state.particles, &runs.cpu.state().particles, &model.boundary);
        assert!(far < 1e-4, "{velocity}: {far}");
        (0..20).for_each(|_| drop(step(&mut runs.gpu)));
    }
}

#[test]
fn drift_creates_no_overlaps_at_walls_as_on_the_cpu() {
    let Some(device) = device() else { return };
    let mut model = crowd(Contact::Separate, 0.15, 0.3, 6);
    let Axis::Periodic { low, high } = model.boundary.axes[0] else { unreachable!() };
    model.boundary = Boundary::reflecting([low; 3], [high; 3]);
    model.transmitters[0].shape = Shape::Lattice([high - low - 1.0; 3], [6; 3]);
    model.species.iter_mut().for_each(|species| species.drift = [-1e-6; 3]);
    let mut gpu_run = gpu(&device, &model, 5);
    gpu_run.run(20).expect("steps");
    let overlaps: u64 = gpu_run.pairs_by_step().iter().sum();
    assert!(overlaps < 3, "{overlaps}");
    let mut runs = Runs::new(&device, &model, 5);
    runs.steps(2);
    let far =
        distance(&runs.gpu.state().expect("a state").particles, &runs.cpu.state().particles, &model.boundary);
    assert!(far < 1e-3, "{far}");
}

#[test]
fn pressure_and_diffusion_match_hard_spheres() {
    let Some(device) = device() else { return };
    let mut model = crowd(Contact::Elastic, 0.3, 0.25, 8);
    model.transmitters[0].release = vec![(0, 512)];
    let mut gpu_run = gpu(&device, &model, 3);
    gpu_run.run(16).expect("steps");
    let (mut collisions, steps) = (0, 48);
    for _ in 0..steps {
        gpu_run.run(1).expect("a step");
        collisions += gpu_run.totals().contacts;
    }
    let particles = gpu_run.state().expect("a state").particles;
    let n = particles.len() as f64;
    let square = |at: usize| particles.get(at).velocity.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>();
    let thermal = ((0..particles.len()).map(square).sum::<f64>() / (3.0 * n)).sqrt();
    let rate = 2.0 * collisions as f64 / (n * f64::from(steps) * model.time_step);
    let measured = 1.0 + PI.sqrt() / 6.0 * rate / thermal;
    let phi = 0.3_f64;
    let expected = (1.0 + phi + phi.powi(2) - phi.powi(3)) / (1.0 - phi).powi(3);
    assert!((measured / expected - 1.0).abs() < 0.02, "{measured} and not {expected}");

    let slowed = |packing: f64| {
        let mut model = crowd(Contact::Separate, packing, 0.3, 6);
        model.transmitters[0].release = vec![(0, 216)];
        let mut gpu_run = gpu(&device, &model, 7);
        gpu_run.run(10).expect("steps");
        let mut moved = vec![[0.0_f32; 3]; 216];
        let mut last = gpu_run.state().expect("a state").particles;
        let steps = 24;
        for _ in 0..steps {
            gpu_run.run(1).expect("a step");
            let now = gpu_run.state().expect("a state").particles;
            for (at, moved) in moved.iter_mut().enumerate() {
                let d = model.boundary.displacement(last.position_of(at), now.position_of(at));
                (0..3).for_each(|k| moved[k] += d[k]);
            }
            last = now;
        }
        let square: f64 = moved.iter().flatten().map(|&c| f64::from(c).powi(2)).sum();
        square / (216.0 * 6.0 * f64::from(steps) * model.time_step)
    };
    let [thin, middle, dense] = [0.1, 0.25, 0.4].map(slowed);
    assert!(thin < 1.0 && thin > middle + 0.05 && middle > dense + 0.05, "{thin}, {middle}, {dense}");
}

/// Few particles at one point collide at speeds above those at the beginning of the step.
#[test]
fn resumed_run_of_fast_collisions_equals_an_uninterrupted_one() {
    let Some(device) = device() else { return };
    let model = Model {
        time_step: 0.000885,
        species: vec![Species { radius: 0.03, ..species("A", 7.0, [0.0; 3]) }],
        contact: Contact::Separate,
        boundary: Boundary::periodic([-4.0; 3], [4.0; 3]),
        transmitters: vec![Transmitter {
            schedule: Schedule::Steady { from: 0.0, until: 1.0, rates: vec![(0, 32_000.0)] },
            ..burst(Shape::Point, &[])
        }],
        ..Model::default()
    };
    for seed in [1, 2] {
        let mut whole = gpu(&device, &model, seed);
        whole.run(10).expect("steps");
        for steps in [2, 5, 8] {
            let mut first = gpu(&device, &model, seed);
            first.run(steps).expect("steps");
            let state = first.state().expect("a state");
            let options = GpuOptions::default();
            let resumed = GpuSimulation::resume(model.clone(), seed, device.clone(), options, &state);
            let mut resumed = resumed.expect("a state");
            resumed.run(10 - steps).expect("steps");
            assert_same(&resumed.state().expect("a state"), &whole.state().expect("a state"));
        }
    }
}
