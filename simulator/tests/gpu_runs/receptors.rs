use lazygrid::Algorithm;
use lazygrid_sim::gpu::{GpuOptions, GpuSimulation};
use lazygrid_sim::model::receptors::Ligand;
use lazygrid_sim::{Boundary, Model, ReceiverKind, ReceptorType, Simulation};

use super::device;
use super::models::{assert_close, brownian, cpu, gpu, receiver, steps};
use super::surfaces::{compare, surfaces};

pub(super) fn competing() -> Model {
    let ligand = |species, binding_rate, unbinding_rate| Ligand { species, binding_rate, unbinding_rate };
    let types = |few: u32| {
        vec![
            ReceptorType { count: few, ligands: vec![ligand(0, 60.0, 40.0), ligand(1, 20.0, 20.0)] },
            ReceptorType { count: 400, ligands: vec![ligand(1, 5.0, 50.0)] },
            ReceptorType { count: 300, ligands: vec![ligand(1, 5.0, 30.0), ligand(0, 8.0, 90.0)] },
        ]
    };
    let mut only_b = types(50);
    only_b.remove(2);
    only_b[0].ligands.remove(0);
    let mut model = surfaces();
    model.receivers.truncate(3);
    model.receivers.extend([
        receiver("few", [0.0, 1.25, 0.0], 0.5, ReceiverKind::Receptors(types(3))),
        receiver("many", [0.0, -1.25, 0.0], 0.5, ReceiverKind::Receptors(types(200))),
        receiver("of B", [0.0, 0.0, 1.375], 0.5, ReceiverKind::Receptors(only_b)),
    ]);
    model
}

#[test]
fn receptor_types_compete_as_on_the_cpu() {
    for (seed, periodic) in [(61, false), (62, true)] {
        let mut model = competing();
        if periodic {
            model.boundary = Boundary::periodic([-2.0; 3], [2.0; 3]);
        }
        let state = compare(&model, seed, 10);
        if device().is_some() {
            let occupied = &state.totals.occupied;
            assert!(occupied.iter().all(|&n| n > 0) && occupied[0] <= 3, "{occupied:?}");
        }
    }
}

#[test]
fn bound_particles_diffuse_as_on_the_cpu() {
    for (seed, surface_diffusion) in [(63, 1e-3), (64, 5.0), (65, 60.0), (66, 1e5)] {
        let mut model = surfaces();
        for receiver in &mut model.receivers[3..5] {
            receiver.surface_diffusion = surface_diffusion;
            receiver.velocity = [0.5, 0.0, -0.25];
        }
        let state = compare(&model, seed, 8);
        model.receivers[4].surface_diffusion = 0.0;
        let mut other = cpu(&model, seed);
        steps(&mut other, 8);
        assert!(device().is_none() || state.bound != other.state().bound);
    }
}

#[test]
fn either_side_continues_with_receptor_types() {
    let Some(device) = device() else { return };
    let mut model = competing();
    model.receivers[4].surface_diffusion = 0.5;
    let mut whole = cpu(&model, 67);
    steps(&mut whole, 9);
    let mut first = gpu(&device, &model, 67);
    first.run(3).expect("steps");
    let state = first.state().expect("a state");
    let mut second = Simulation::resume(model.clone(), 67, Algorithm::Auto, state).expect("a state");
    steps(&mut second, 3);
    let resumed = GpuSimulation::resume(model, 67, device, GpuOptions::default(), second.state());
    let mut third = resumed.expect("a state");
    third.run(3).expect("steps");
    assert_close(&third.state().expect("a state"), whole.state(), 2e-4);
}

/// A fraction q/(1 + q) of n receptors is occupied, with q = a·kb/(ku·V) and a free particles in the volume V.
#[test]
fn types_are_in_equilibrium() {
    let Some(device) = device() else { return };
    let mut model = brownian(false);
    (model.time_step, model.species[1].drift) = (0.01, [0.0; 3]);
    let kinds = [(300, 0.2, 2.0), (900, 0.1, 2.0)];
    let types = kinds.map(|(count, binding, unbinding)| ReceptorType::new(count, binding, unbinding, [0, 1]));
    model.receivers = vec![receiver("cell", [0.0; 3], 1.0, ReceiverKind::Receptors(types.to_vec()))];
    model.receivers[0].surface_diffusion = 0.5;
    let mut run = gpu(&device, &model, 68);
    run.run(100).expect("steps");
    let (mut bound, mut sum, mut count) = ([0.0; 2], [0.0; 3], 0.0);
    let samples = 40;
    for _ in 0..samples {
        run.run(10).expect("steps");
        (0..2).for_each(|k| bound[k] += run.totals().occupied[k] as f64 / f64::from(samples));
        for held in run.state().expect("a state").bound {
            (0..3).for_each(|k| sum[k] += f64::from(held.direction[k]));
            count += 1.0;
        }
    }
    let volume = 64.0 - 4.0 / 3.0 * std::f64::consts::PI;
    let free = 2000.0 - bound[0] - bound[1];
    for (k, (receptors, binding, unbinding)) in kinds.into_iter().enumerate() {
        let odds = free * binding / (unbinding * volume);
        let expected = f64::from(receptors) * odds / (1.0 + odds);
        // Occupancies vary as a binomial number, and samples are 0.1 s apart.
        let tolerance = 4.0 * (bound[k] * (1.0 - bound[k] / f64::from(receptors)) / 10.0).sqrt();
        assert!((bound[k] - expected).abs() < tolerance, "{k}: {} and not {expected}", bound[k]);
    }
    assert!(sum.iter().all(|s: &f64| (s / count).abs() < 0.1), "{sum:?} of {count}");
}
