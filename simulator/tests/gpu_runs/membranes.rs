use lazygrid_sim::gpu::{GpuOptions, GpuSimulation};
use lazygrid_sim::model::receiver::WallFace;
use lazygrid_sim::{
    Axis, Boundary, Membrane, MembraneSurface, Model, Receiver, ReceiverKind, Shape, State, Vessel,
};

use super::device;
use super::models::{assert_close, brownian, by_id, cpu, gpu, receiver};
use super::surfaces::{compare, surfaces};

fn membrane(surface: MembraneSurface, permeability: f64, sees: [bool; 2]) -> Membrane {
    Membrane { name: "skin".into(), surface, permeability, sees: sees.to_vec() }
}

fn plane(axis: usize, position: f32, permeability: f64, sees: [bool; 2]) -> Membrane {
    membrane(MembraneSurface::Plane { axis, position }, permeability, sees)
}

fn sphere(center: [f32; 3], radius: f32, permeability: f64, sees: [bool; 2]) -> Membrane {
    membrane(MembraneSurface::Sphere { center, radius }, permeability, sees)
}

fn among(membranes: Vec<Membrane>, time_step: f64) -> Model {
    let mut model = brownian(true);
    model.species[1].drift = [0.0; 3];
    model.species[0].radius = 0.0625;
    (model.membranes, model.time_step) = (membranes, time_step);
    model
}

fn planes(time_step: f64) -> Model {
    let membranes = vec![
        plane(0, 0.0, 2.0, [true; 2]),
        plane(0, 0.75, 20.0, [true, false]),
        plane(0, -1.0, 0.0, [false, true]),
        plane(1, 0.25, 1.0, [true; 2]),
    ];
    let mut model = among(membranes, time_step);
    model.receivers = vec![
        receiver("near", [0.375, 1.0, 0.0], 0.25, ReceiverKind::Absorbing),
        receiver("far", [-0.5, -0.75, 0.5], 0.375, ReceiverKind::Endpoint),
        receiver("ghost", [1.25, 0.0, 1.25], 0.625, ReceiverKind::Transparent),
    ];
    model
}

#[test]
fn planes_hold_back_as_on_the_cpu() {
    let periodic = Boundary::periodic([-2.0; 3], [2.0; 3]);
    let boundaries = [brownian(false).boundary, periodic, Boundary::default()];
    for (seed, (boundary, time_step)) in
        (71..).zip(boundaries.into_iter().flat_map(|boundary| [(boundary, 0.005), (boundary, 0.1)]))
    {
        let model = Model { boundary, ..planes(time_step) };
        let state = compare(&model, seed, 8);
        if device().is_some() {
            assert!(state.totals.arrived[0].iter().all(|&n| n > 0), "{:?}", state.totals);
            let open = Model { membranes: Vec::new(), ..model };
            assert_ne!(compare(&open, seed, 8).particles, state.particles);
        }
    }
}

#[test]
fn walls_behind_planes_absorb_as_on_the_cpu() {
    let mut model = planes(0.05);
    for face in [WallFace::Low(0), WallFace::High(0), WallFace::High(1)] {
        model.receivers.push(receiver("wall", [0.0; 3], 0.0, ReceiverKind::Wall(face)));
    }
    let state = compare(&model, 77, 8);
    assert!(device().is_none() || state.totals.arrived[3..].iter().all(|row| row[0] > 0));
    let mut mixed = planes(0.005);
    mixed.membranes.iter_mut().for_each(|membrane| membrane.sees[1] = false);
    let sees = vec![false, true];
    mixed.receivers.push(Receiver { sees, ..receiver("mirror", [0.0; 3], 0.5, ReceiverKind::Reflecting) });
    compare(&mixed, 78, 8);
}

#[test]
fn planes_across_a_cylinder_and_a_disk_match_the_cpu() {
    let mut model = among(vec![plane(2, 0.25, 2.0, [true; 2])], 0.02);
    let vessel = Some(Vessel { along: Some(2), center: [0.0; 3], radius: 2.5 });
    model.boundary = Boundary { axes: [Axis::Open; 3], vessel };
    compare(&model, 79, 8);
    let mut flat =
        among(vec![plane(0, 0.25, 2.0, [true; 2]), sphere([-0.5, 0.5, 0.0], 0.5, 2.0, [true; 2])], 0.02);
    flat.boundary.axes[2] = Axis::Frozen;
    for transmitter in &mut flat.transmitters {
        transmitter.shape = Shape::Shell(0.0, 1.5);
    }
    compare(&flat, 80, 8);
}

fn cells(time_step: f64) -> Model {
    let membranes = vec![
        sphere([0.5, 0.25, 0.0], 0.75, 5.0, [true; 2]),
        sphere([0.5, 0.25, 0.0], 0.375, 0.0, [true, false]),
        sphere([-0.5, -0.5, 0.5], 1.0, 20.0, [true; 2]),
        plane(1, 1.25, 2.0, [true, false]),
    ];
    let mut model = among(membranes, time_step);
    model.receivers = vec![
        receiver("inside", [0.5, 0.8125, 0.0], 0.17, ReceiverKind::Absorbing),
        receiver("outside", [1.5, -1.0, 0.0], 0.375, ReceiverKind::Endpoint),
    ];
    model
}

/// Long steps begin with the state of the CPU, since reflections off spheres amplify rounding.
#[test]
fn spheres_hold_back_as_on_the_cpu() {
    let Some(device) = device() else { return };
    let periodic = Boundary::periodic([-2.0; 3], [2.0; 3]);
    for (seed, boundary) in (91..).zip([brownian(false).boundary, periodic, Boundary::default()]) {
        let model = Model { boundary, ..cells(0.005) };
        let state = compare(&model, seed, 8);
        assert!(state.totals.arrived.iter().all(|row| row.iter().sum::<u64>() > 0), "{:?}", state.totals);
        let open = Model { membranes: Vec::new(), ..model };
        assert_ne!(compare(&open, seed, 8).particles, state.particles);
        let model = Model { boundary, ..cells(0.1) };
        let mut cpu_run = cpu(&model, seed);
        for _ in 0..4 {
            let options = GpuOptions::default();
            let gpu_run =
                GpuSimulation::resume(model.clone(), seed, device.clone(), options, cpu_run.state());
            let mut gpu_run = gpu_run.expect("a state");
            gpu_run.run(1).expect("a step");
            cpu_run.step().expect("a step");
            assert_close(&gpu_run.state().expect("a state"), cpu_run.state(), 1e-5);
        }
    }
}

fn surfaces_among_membranes() -> Model {
    let mut model = surfaces();
    model.receivers.retain(|receiver| !["ghost", "endpoint"].contains(&receiver.name.as_str()));
    model.receivers[0].radius = 0.5;
    model.receivers[4].radius = 0.25;
    let (around, other) = (model.receivers[4].center, model.receivers[5].center);
    model.species[1].drift = [0.0; 3];
    model.time_step = 0.0005;
    model.membranes = vec![
        plane(2, -0.9, 20.0, [true; 2]),
        sphere(around, 0.45, 50.0, [true; 2]),
        sphere(other, 0.6, 5.0, [true, false]),
    ];
    model
}

#[test]
fn surfaces_among_membranes_reflect_as_on_the_cpu() {
    let Some(_) = device() else { return };
    for (seed, boundary) in (95..).zip([brownian(false).boundary, Boundary::periodic([-2.0; 3], [2.0; 3])]) {
        let model = Model { boundary, ..surfaces_among_membranes() };
        let state = compare(&model, seed, 12);
        for receiver in [3, 4] {
            assert!(state.bound.iter().any(|held| held.receiver == receiver), "{receiver}");
        }
        let open = Model { membranes: Vec::new(), ..model };
        assert_ne!(compare(&open, seed, 12).particles, state.particles);
    }
}

#[test]
fn moving_receivers_among_membranes_match_the_cpu() {
    let Some(_) = device() else { return };
    for (seed, boundary) in (101..).zip([brownian(false).boundary, Boundary::periodic([-2.0; 3], [2.0; 3])]) {
        for mut model in [planes(0.005), cells(0.005), surfaces_among_membranes()] {
            model.boundary = boundary;
            for receiver in &mut model.receivers {
                receiver.velocity = [9.0 * f64::from(receiver.radius), 0.5, -0.5];
                receiver.diffusion = 0.05;
            }
            let state = compare(&model, seed, 12);
            let counts = state.totals.arrived.iter().filter(|row| row.iter().any(|&n| n > 0)).count();
            assert!(counts > 1, "{:?}", state.totals);
            let open = Model { membranes: Vec::new(), ..model };
            assert_ne!(compare(&open, seed, 12).centers, state.centers);
        }
    }
}

fn ids(state: &State, is_there: impl Fn([f32; 3]) -> bool) -> Vec<u32> {
    by_id(state)
        .into_iter()
        .filter(|particle| is_there(particle.position))
        .map(|particle| particle.id)
        .collect()
}

#[test]
fn closed_membranes_let_none_through() {
    let Some(device) = device() else { return };
    let (center, radius) = ([0.5, -0.25, 0.125], 0.75);
    let is_inside = |p: [f32; 3]| {
        let d: [f64; 3] = std::array::from_fn(|k| f64::from(p[k]) - f64::from(center[k]));
        d.map(|c| c * c).iter().sum::<f64>().sqrt() < f64::from(radius)
    };
    let run = |model: &Model| {
        let mut run = gpu(&device, model, 87);
        run.run(1).expect("a step");
        let before = run.state().expect("a state");
        run.run(300).expect("steps");
        [before, run.state().expect("a state")]
    };
    let periodic = Boundary::periodic([-2.0; 3], [2.0; 3]);
    for boundary in [brownian(false).boundary, periodic] {
        // The shortest steps are those of particles a few thousand rounding errors from the surface.
        for time_step in [1e-10, 1e-4, 0.02] {
            let closed = vec![plane(0, 0.0, 0.0, [true; 2]), plane(1, 1.0, 0.0, [true; 2])];
            let mut model = Model { boundary, reactions: Vec::new(), ..among(closed, time_step) };
            // The end of a periodic box connects both sides of a plane.
            if boundary != periodic {
                let [before, after] = run(&model);
                let sides = |state| [0, 1].map(|axis| ids(state, |p| p[axis] >= axis as f32));
                assert_eq!(sides(&before), sides(&after), "{time_step}");
            }
            model.membranes = vec![sphere(center, radius, 0.0, [true; 2])];
            if time_step == 1e-10 {
                for transmitter in &mut model.transmitters {
                    (transmitter.center, transmitter.shape) = (center, Shape::Shell(0.7499, 0.7501));
                }
            }
            let [before, after] = run(&model);
            assert_eq!(ids(&before, is_inside), ids(&after, is_inside), "{boundary:?} {time_step}");
            assert!(ids(&after, is_inside).len() > 20);
        }
    }
}
