//! Runs on the GPU against the CPU, which draws the same numbers, and closed forms. Skipped without an adapter, unless
//! `LAZYGRID_REQUIRE_GPU` is set.

#[path = "../../../tests/src/adapter.rs"]
mod adapter;
mod contact;
mod degrading;
mod dimensions;
mod features;
mod limits;
mod membranes;
mod models;
mod past_receivers;
mod receptors;
mod surfaces;
mod transport;
mod vessels;

use adapter::or_skip;
use lazygrid::Algorithm;
use lazygrid::gpu::{GpuDevice, SoftwareAdapter};
use lazygrid_sim::gpu::{GpuOptions, GpuSimulation};
use lazygrid_sim::{
    Axis, Boundary, Contact, Error, Flow, Membrane, MembraneSurface, Model, Receiver, ReceiverKind,
    ReceptorType, Shape, Simulation, Transmitter, Vessel,
};
use models::{
    Runs, assert_same, brownian, burst, by_id, cpu, decay, dyadic, gpu, gpu_with, receiver, species, steps,
};

fn device() -> Option<GpuDevice> {
    or_skip(GpuDevice::shared(SoftwareAdapter::Allow))
}

#[test]
fn dyadic_runs_match_the_cpu() {
    let Some(device) = device() else { return };
    for seed in [1, 2] {
        let mut model = dyadic();
        if seed == 2 {
            model.boundary.axes[0] = Axis::Periodic { low: -4.0, high: 4.0 };
            model.boundary.axes[2] = Axis::Periodic { low: -4.0, high: 4.0 };
        }
        let mut runs = Runs::new(&device, &model, seed);
        let mut pairs = Vec::new();
        for steps in [1, 2, 9] {
            runs.gpu.run(steps).expect("steps");
            pairs.extend_from_slice(runs.gpu.pairs_by_step());
            let mut expected = Vec::new();
            for _ in 0..steps {
                runs.cpu.step().expect("a step");
                expected.push(runs.cpu.state().totals.pairs);
            }
            assert_eq!(runs.gpu.pairs_by_step(), expected);
            runs.assert_same();
        }
        let totals = runs.gpu.totals();
        for counts in [
            &totals.reacted,
            &totals.decayed,
            &totals.arrived[0],
            &totals.arrived[2],
            &runs.gpu.received()[1],
        ] {
            assert!(counts.iter().any(|&count| count > 0), "{totals:?}");
        }
        assert!(totals.reacted.iter().all(|&count| count > 0), "{totals:?}");
    }
}

#[test]
fn halted_runs_resume_with_the_same_results() {
    let Some(device) = device() else { return };
    let model = dyadic();
    let mut roomy = gpu(&device, &model, 3);
    roomy.run(10).expect("steps");
    for options in [
        GpuOptions { pair_capacity: 1, ..GpuOptions::default() },
        GpuOptions { rounds: 0, max_iterations: 64, ..GpuOptions::default() },
    ] {
        let mut tight = gpu_with(&device, &model, 3, options);
        tight.run(10).expect("steps");
        assert_eq!(tight.pairs_by_step(), roomy.pairs_by_step());
        assert_eq!(tight.state().expect("a state"), roomy.state().expect("a state"), "{options:?}");
    }
}

#[test]
fn steps_may_run_in_any_portions() {
    let Some(device) = device() else { return };
    let model = brownian(true);
    let mut at_once = gpu(&device, &model, 4);
    at_once.run(12).expect("steps");
    let mut one_by_one = gpu(&device, &model, 4);
    (0..12).for_each(|_| one_by_one.run(1).expect("a step"));
    assert_eq!(at_once.state().expect("a state"), one_by_one.state().expect("a state"));
    assert!(at_once.state().expect("a state").particles.id.is_sorted());
}

#[test]
fn either_backend_resumes_where_the_other_stopped() {
    let Some(device) = device() else { return };
    let model = dyadic();
    let mut whole = cpu(&model, 5);
    steps(&mut whole, 9);
    let mut first = cpu(&model, 5);
    steps(&mut first, 3);
    let options = GpuOptions::default();
    let mut second =
        GpuSimulation::resume(model.clone(), 5, device, options, first.state()).expect("a state");
    assert_eq!(second.received(), first.received());
    second.run(3).expect("steps");
    let state = second.state().expect("a state");
    let mut third = Simulation::resume(model, 5, Algorithm::Auto, state).expect("a state");
    steps(&mut third, 3);
    assert_same(third.state(), whole.state());
}

#[test]
fn moves_match_the_cpu_up_to_rounding() {
    let Some(device) = device() else { return };
    let model = brownian(false);
    let mut runs = Runs::new(&device, &model, 6);
    runs.steps(3);
    let gpu_state = runs.gpu.state().expect("a state");
    for (a, b) in by_id(&gpu_state).into_iter().zip(by_id(runs.cpu.state())) {
        assert_eq!((a.id, a.species), (b.id, b.species));
        assert!(a.position.into_iter().zip(b.position).all(|(a, b)| (a - b).abs() < 2e-6), "{a:?} {b:?}");
    }
}

#[test]
fn mean_square_displacement() {
    let Some(device) = device() else { return };
    let n = 50_000_u32;
    let species = vec![species("A", 2.0, [0.0; 3])];
    let burst = Transmitter { center: [1.0, 0.0, 0.0], ..burst(Shape::Point, &[(0, n)]) };
    let model = Model { time_step: 0.01, species, transmitters: vec![burst], ..Model::default() };
    let mut run = gpu(&device, &model, 7);
    run.run(20).expect("steps");
    let state = run.state().expect("a state");
    let variance = 2.0 * 2.0 * run.time();
    let squares = by_id(&state).into_iter().map(|p| {
        let [x, y, z] = p.position.map(f64::from);
        (x - 1.0).powi(2) + y * y + z * z
    });
    let (mean, fourth) =
        squares.fold((0.0, 0.0), |(m, f), s| (m + s / f64::from(n), f + s * s / f64::from(n)));
    let close = |found: f64, expected: f64, variance: f64| {
        (found - expected).abs() < 4.0 * (variance / f64::from(n)).sqrt()
    };
    assert!(close(mean, 3.0 * variance, 6.0 * variance.powi(2)), "{mean}");
    // Moments of a chi-square with three degrees: 15 for the square, 945 for its square.
    assert!(close(fourth, 15.0 * variance.powi(2), (945.0 - 225.0) * variance.powi(4)), "{fourth}");
}

#[test]
fn annihilation_has_the_statistics_of_the_cpu() {
    let Some(device) = device() else { return };
    let model = brownian(true);
    let seeds = 5;
    let counts = |side: u64| -> Vec<f64> {
        let one = |seed: u64| {
            if side == 0 {
                let mut run = cpu(&model, 100 + seed);
                steps(&mut run, 30);
                run.state().totals.reacted[0] as f64
            } else {
                let mut run = gpu(&device, &model, 200 + seed);
                run.run(30).expect("steps");
                assert_eq!(run.totals().present, [1000 - run.totals().reacted[0]; 2]);
                run.totals().reacted[0] as f64
            }
        };
        (0..seeds).map(one).collect()
    };
    let [here, there] = [counts(0), counts(1)];
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let spread = |x: &[f64]| x.iter().map(|v| (v - mean(x)).powi(2)).sum::<f64>() / (x.len() - 1) as f64;
    let error = ((spread(&here) + spread(&there)) / seeds as f64).sqrt();
    assert!(mean(&here) > 100.0, "{here:?}");
    assert!((mean(&here) - mean(&there)).abs() < 4.0 * error, "{here:?} {there:?}");
}

#[test]
fn absorbing_receiver() {
    let Some(device) = device() else { return };
    let n = 50_000_u32;
    let reached = |kind| {
        let model = Model {
            time_step: 0.01,
            species: vec![species("A", 100.0, [0.0; 3])],
            transmitters: vec![burst(Shape::Point, &[(0, n)])],
            receivers: vec![Receiver { sees: vec![true], ..receiver("r", [10.0, 0.0, 0.0], 5.0, kind) }],
            ..Model::default()
        };
        let mut run = gpu(&device, &model, 8);
        run.run(50).expect("steps");
        assert_eq!(run.totals().present[0] + run.totals().arrived[0][0], u64::from(n));
        run.totals().arrived[0][0] as f64 / f64::from(n)
    };
    let expected = 0.308_54_f64;
    let tolerance = 4.0 * (expected * (1.0 - expected) / f64::from(n)).sqrt() + 0.005 * expected;
    let [found, endpoints] = [reached(ReceiverKind::Absorbing), reached(ReceiverKind::Endpoint)];
    assert!((found - expected).abs() < tolerance, "{found}");
    assert!((endpoints - expected).abs() > tolerance, "endpoints alone give {endpoints}");
}

#[test]
fn many_receivers() {
    let Some(device) = device() else { return };
    let mut model = dyadic();
    let kinds = [ReceiverKind::Absorbing, ReceiverKind::Transparent, ReceiverKind::Endpoint];
    model.receivers.clear();
    for k in 0..512_u32 {
        let center = [k % 8, k / 8 % 8, k / 64].map(|c| c as f32 * 1.125 - 4.0);
        let sees = vec![true, !k.is_multiple_of(5), true, true];
        let kind = kinds[k as usize % 3].clone();
        model.receivers.push(Receiver { sees, ..receiver(&k.to_string(), center, 0.28, kind) });
    }
    let mut runs = Runs::new(&device, &model, 9);
    runs.steps(9);
    let arrived = runs.cpu.state().totals.arrived.iter().filter(|row| row.iter().sum::<u64>() > 0).count();
    assert!(arrived > 100, "{arrived}");
    runs.assert_same();
}

#[test]
fn overlaps_are_counted_without_capacity_for_them() {
    let Some(device) = device() else { return };
    let mut model = dyadic();
    model.reactions.clear();
    model.contact = Contact::Count;
    model.species.iter_mut().for_each(|species| species.radius = 0.5);
    let mut runs = Runs::new(&device, &model, 9);
    runs.steps(4);
    assert!(runs.cpu.state().totals.pairs > 1000);
    runs.assert_same();
}

#[test]
fn models_beyond_the_device_are_refused_by_name() {
    let Some(device) = device() else { return };
    let refused = |change: fn(&mut Model)| {
        let mut model = brownian(true);
        change(&mut model);
        match GpuSimulation::new(model, 1, device.clone(), GpuOptions::default()) {
            Err(Error::NotOnGpu { what }) => what,
            other => panic!("{other:?}"),
        }
    };
    let chain = refused(|m| m.decays = vec![decay(0, Some(1), 32_000.0), decay(1, None, 32_000.0)]);
    assert!(chain.contains("32.0 expected decays per step; set time-step to 5.00e-4 or less"), "{chain}");
    let membranes = refused(|m| {
        let cell = |k: u8| MembraneSurface::Sphere { center: [0.0; 3], radius: 1.0 + f32::from(k) / 128.0 };
        let skin = |k| Membrane { surface: cell(k), sees: vec![true, false], ..Membrane::default() };
        m.membranes = (0..101).map(skin).collect();
    });
    let says = "101 spherical and 0 plane membranes with images that hold back A, beyond 100 spheres or";
    assert!(membranes.contains(says), "{membranes}");
    let types = refused(|m| {
        let kind = ReceptorType::new(4, 1.0, 1.0, [0, 1]);
        m.receivers = row(2_500, &ReceiverKind::Receptors(vec![kind; 5]));
    });
    assert!(types.contains("30000 counts of a receiver and a species, beyond 25000"), "{types}");
    let message = refused(|m| m.receivers = row(40_000, &ReceiverKind::Absorbing));
    assert!(message.contains("80000 counts"), "{message}");
    let message = refused(|m| m.receivers = row(13_000, &ReceiverKind::Reflecting));
    assert!(message.contains("26000 counts of a receiver and a species, beyond 25000"), "{message}");
    assert!(past_receivers(&device, 140).is_none());
    let drifting = past_receivers(&device, 160).expect("a reason");
    assert!(drifting.contains("64160 loop iterations, beyond 59680; use fewer receivers, or"), "{drifting}");
}

fn row(count: usize, kind: &ReceiverKind) -> Vec<Receiver> {
    let at = |k: usize| [k as f32 / (1 << 16) as f32, 0.0, 0.0];
    (0..count).map(|k| receiver("rx", at(k), 0.25, kind.clone())).collect()
}

fn past_receivers(device: &GpuDevice, count: usize) -> Option<String> {
    let mut model = brownian(true);
    model.boundary = Boundary::default();
    model.species[1].drift = [9000.0, 0.0, 0.0];
    (model.flow, model.flow_pulse) = (Some(Flow::Plug([-9000.0, 0.0, 0.0])), Some([0.5, 1.0]));
    model.receivers = row(count, &ReceiverKind::Absorbing);
    match GpuSimulation::new(model, 1, device.clone(), GpuOptions::default()) {
        Err(Error::NotOnGpu { what }) => Some(what),
        other => other.map(|_| None).expect("a model"),
    }
}

/// In the second step, positions exceed the range of `f32`.
fn fast_drift(mut model: Model) -> Model {
    model.time_step = 1.0;
    model.boundary = Boundary::default();
    model.species[0].drift = [2e38, 0.0, 0.0];
    model
}

#[test]
fn particles_that_leave_the_range_of_numbers_are_an_error() {
    let Some(device) = device() else { return };
    let mut run = gpu(&device, &fast_drift(brownian(true)), 1);
    let error = run.run(5).expect_err("an error");
    assert!(matches!(error, Error::NotFinite { step: 1, particles: 1000 }), "{error}");
    assert_eq!(run.state().expect("a state").step, 1);
}

#[test]
fn path_beyond_the_range_of_numbers_is_an_error_in_every_boundary() {
    let Some(device) = device() else { return };
    let vessel = Vessel { along: None, center: [0.0; 3], radius: 8.0 };
    for boundary in [
        Boundary::periodic([-8.0; 3], [8.0; 3]),
        Boundary::reflecting([-8.0; 3], [8.0; 3]),
        Boundary { vessel: Some(vessel), ..Boundary::default() },
    ] {
        let mut model = fast_drift(brownian(true));
        model.species[0].drift = [1e39, 0.0, 0.0];
        model.boundary = boundary;
        let mut run = gpu(&device, &model, 1);
        let error = run.run(5).expect_err("an error");
        assert!(matches!(error, Error::NotFinite { step: 0, particles: 1000 }), "{boundary:?}: {error}");
    }
}

#[test]
fn state_beyond_the_range_of_numbers_is_an_error_without_pairs() {
    let Some(device) = device() else { return };
    let mut run = gpu(&device, &fast_drift(brownian(false)), 1);
    run.run(5).expect("steps without a detector");
    let error = run.state().expect_err("an error");
    assert!(matches!(error, Error::NotFinite { step: 4, particles: 1000 }), "{error}");
}

#[test]
fn a_lost_device_is_said_to_be_lost() {
    let Some(gpu_device) = or_skip(GpuDevice::open(SoftwareAdapter::Allow)) else { return };
    let mut run = gpu(&gpu_device, &brownian(true), 1);
    run.run(2).expect("steps");
    gpu_device.device.destroy();
    let errors = [run.run(2).expect_err("no device"), run.state().expect_err("no device")];
    let again =
        GpuSimulation::new(brownian(true), 1, gpu_device, GpuOptions::default()).expect_err("no device");
    for error in errors.into_iter().chain([again]) {
        assert!(error.to_string().contains("the device was lost"), "{error}");
    }
}
