use std::sync::Arc;

use lazygrid_sim::{
    Attractant, AttractantProfile, Axis, Boundary, Chemotaxis, Contact, Flow, FlowField, Model, ReceiverKind,
    Schedule, Shape, Species, Vessel,
};

use super::contact::crowd;
use super::device;
use super::models::{Runs, assert_close, brownian, cpu, gpu, receiver, steps};
use super::receptors::competing;
use super::surfaces::{compare, surfaces};

fn following(profile: AttractantProfile, sensitivity: f64, half_saturation: Option<f64>) -> Model {
    let mut model = brownian(true);
    model.time_step = 0.004;
    model.attractants = vec![Attractant { name: "food".into(), center: [0.5, -0.25, 0.0], profile }];
    let swimmer = Species { speed: 20.0, tumble_rate: 40.0, ..model.species[0].clone() };
    let chemotaxis = Some(Chemotaxis { attractant: 0, sensitivity, half_saturation });
    model.species = vec![
        Species { chemotaxis, ..swimmer.clone() },
        Species { name: "B".into(), diffusion: 0.0, ..swimmer },
    ];
    model
}

#[test]
fn swimmers_follow_attractants_as_on_the_cpu() {
    let Some(device) = device() else { return };
    // One molecule per µm³ is 1e18 per m³, whose square exceeds single precision.
    let linear = AttractantProfile::Linear { level: 2e18, gradient: [1e18, 0.0, -2e18] };
    let gaussian = AttractantProfile::Gaussian { peak: 3.0, width: 1.5 };
    let source = AttractantProfile::Source { peak: 5e21, radius: 0.5 };
    let periodic = Boundary::periodic([-2.0; 3], [2.0; 3]);
    for (k, (profile, sensitivity, half_saturation, boundary)) in [
        (linear, 0.08e-18, None, brownian(false).boundary),
        (linear, 0.4, Some(4e18), Boundary::default()),
        (gaussian, -0.08, None, periodic),
        (gaussian, 0.3, Some(1.0), periodic),
        (source, 0.02e-21, None, periodic),
        (source, 0.5, Some(2e21), brownian(false).boundary),
    ]
    .into_iter()
    .enumerate()
    {
        let model = Model { boundary, ..following(profile, sensitivity, half_saturation) };
        let state = compare(&model, 41, 8);
        let mut other = model.clone();
        other.species[0].chemotaxis = None;
        let mut indifferent = cpu(&other, 41);
        steps(&mut indifferent, 8);
        assert_ne!(indifferent.state().particles, state.particles, "model {k}");
        let mut at_once = gpu(&device, &model, 41);
        at_once.run(8).expect("steps");
        assert_close(&at_once.state().expect("a state"), &state, 2e-4);
    }
}

#[test]
fn combined_features_match_the_cpu() {
    let mut model = competing();
    let cells =
        model.receivers.iter_mut().filter(|receiver| matches!(receiver.kind, ReceiverKind::Receptors(_)));
    for (k, cell) in (0_u8..).zip(cells) {
        cell.velocity = [0.5, -0.25 * f64::from(k), 0.0];
        cell.diffusion = 0.25;
        cell.surface_diffusion = 5.0;
    }
    model.transmitters[0].carrier = Some(model.receivers.len() as u32 - 1);
    model.transmitters[0].schedule = Schedule::Times(vec![0.0, 0.015]);
    model.transmitters[0].release[0].1 = 500;
    let profile = AttractantProfile::Gaussian { peak: 3.0, width: 1.5 };
    model.attractants = vec![Attractant { name: "food".into(), center: [0.5, -0.25, 0.0], profile }];
    model.flow = field([5, 4, 6], 1.0);
    let chemotaxis = Some(Chemotaxis { attractant: 0, sensitivity: 0.3, half_saturation: Some(1.0) });
    model.species[0] = Species { speed: 2.0, tumble_rate: 40.0, chemotaxis, ..model.species[0].clone() };
    for (seed, boundary) in [(66, model.boundary), (67, Boundary::periodic([-2.0; 3], [2.0; 3]))] {
        let model = Model { boundary, ..model.clone() };
        let state = compare(&model, seed, 8);
        let counts = &state.totals;
        assert!(
            device().is_none() || counts.occupied.iter().chain(&counts.reacted).all(|&n| n > 0),
            "{counts:?}"
        );
    }
}

fn field(points: [usize; 3], fastest: f32) -> Option<Flow> {
    let count = 3 * points.iter().product::<usize>() as u32;
    let velocities =
        (0..count).map(|k| fastest * (k.wrapping_mul(0x9e37_79b9) as f32 / 2_147_483_648.0 - 1.0));
    let field = FlowField::new([[-1.5, -1.75, -1.0], [0.625, 0.875, 0.5]], points, velocities.collect());
    Some(Flow::Field(Arc::new(field.expect("a field"))))
}

#[test]
fn flow_fields_carry_as_on_the_cpu() {
    let plane = Boundary { axes: [Axis::Open, Axis::Open, Axis::Frozen], vessel: None };
    let vessel = Vessel { along: Some(0), center: [0.0; 3], radius: 3.5 };
    let boundaries = [
        (brownian(false).boundary, [5, 4, 6]),
        (Boundary::periodic([-2.0; 3], [2.0; 3]), [4, 5, 1]),
        (Boundary::default(), [1, 1, 7]),
        (Boundary { axes: [Axis::Open; 3], vessel: Some(vessel) }, [6, 3, 3]),
        (plane, [3, 3, 1]),
    ];
    for (seed, (boundary, points)) in (51..).zip(boundaries) {
        let mut model = Model { flow: field(points, 40.0), time_step: 0.004, boundary, ..brownian(true) };
        if boundary == plane {
            for transmitter in &mut model.transmitters {
                transmitter.shape = Shape::Shell(0.0, 2.0);
            }
            let Some(Flow::Field(grid)) = field(points, 40.0) else { return };
            let flat =
                |k: usize| if k % 3 == 2 { 0.0 } else { grid.at([k as f32 / 8.0, 0.0, 0.0])[k % 3] as f32 };
            let flat = FlowField::new([[-1.5, -1.75, 0.0], [0.625; 3]], points, (0..27).map(flat).collect());
            model.flow = Some(Flow::Field(Arc::new(flat.expect("a field"))));
        }
        compare(&model, seed, 8);
        model.species[0].speed = 20.0;
        model.species[1].diffusion = 0.0;
        compare(&model, seed, 4);
    }
    let mut among = Model { flow: field([5, 4, 6], 2.0), ..surfaces() };
    compare(&among, 56, 8);
    among.receivers.retain(|receiver| !receiver.kind.reflects());
    let state = compare(&among, 57, 8);
    if device().is_some() {
        assert!(state.totals.arrived[0].iter().all(|&n| n > 0), "{:?}", state.totals.arrived);
    }
    among.species[0].diffusion = 0.0;
    among.receivers = vec![receiver("absorber", [0.5, 0.25, 0.0], 0.5, ReceiverKind::Absorbing)];
    compare(&among, 58, 8);
}

#[test]
fn pulses_of_flow_fields_match_the_cpu() {
    let Some(device) = device() else { return };
    let mut model = Model { flow: field([4, 4, 4], 30.0), time_step: 0.004, ..brownian(true) };
    model.flow_pulse = Some([2.25, 5.75].map(|steps| steps * model.time_step));
    let mut runs = Runs::new(&device, &model, 59);
    for steps in [5, 4] {
        runs.steps(steps);
        runs.assert_close(2e-4);
    }
}

#[test]
fn colliding_particles_are_carried_as_on_the_cpu() {
    for contact in [Contact::Separate, Contact::Elastic] {
        let mut model = crowd(contact, 0.25, 0.15, 6);
        model.flow = field([3, 3, 3], 0.05 / model.time_step as f32);
        model.transmitters[0].shape = Shape::Lattice([6.6; 3], [6; 3]);
        let state = compare(&model, 60, 2);
        if device().is_some() {
            assert!(state.totals.contacts > 10, "{}", state.totals.contacts);
        }
    }
}
