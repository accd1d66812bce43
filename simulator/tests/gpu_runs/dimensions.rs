use lazygrid_sim::{
    Adsorption, Axis, Boundary, Contact, Decay, Model, ReceiverKind, Shape, Species, Unbinding, Vessel,
};

use super::contact::crowd;
use super::device;
use super::models::{Runs, brownian, receiver, species};
use super::surfaces::{compare, surfaces};

fn frozen(mut model: Model, dimensions: usize) -> Model {
    model.boundary.axes[dimensions..].fill(Axis::Frozen);
    for species in &mut model.species {
        species.drift[dimensions..].fill(0.0);
    }
    for transmitter in &mut model.transmitters {
        transmitter.center[dimensions..].fill(0.0);
        transmitter.shape = Shape::Shell(0.0, 1.75);
    }
    for receiver in &mut model.receivers {
        receiver.center[dimensions..].fill(0.0);
    }
    model.receivers.retain(|receiver| !matches!(receiver.kind, ReceiverKind::Receptors(_)));
    model
}

fn assert_flat(model: &Model, seed: u64, dimensions: usize) {
    let state = compare(model, seed, 8);
    if device().is_some() {
        assert!(state.particles.position[dimensions..].iter().flatten().all(|&x| x == 0.0));
        assert!(
            state.totals.reacted.iter().chain(&state.totals.decayed).all(|&n| n > 0),
            "{:?}",
            state.totals
        );
        let silent = |at: &usize| {
            let counts = state.totals.arrived[*at].iter().sum::<u64>() == 0;
            counts && model.receivers[*at].kind.absorbs()
        };
        assert_eq!((0..model.receivers.len()).find(silent), None, "{:?}", state.totals.arrived);
    }
}

#[test]
fn planes_hold_what_they_hold_on_the_cpu() {
    let mut plane = frozen(surfaces(), 2);
    plane.species[0] = Species { speed: 2.0, tumble_rate: 40.0, ..plane.species[0].clone() };
    plane.species.push(species("C", 0.5, [0.0; 3]));
    plane.receivers.iter_mut().for_each(|receiver| receiver.sees.push(true));
    plane.reactions[0].products = [Some(2), None];
    plane.decays = vec![Decay {
        reactant: 2,
        products: [Some(0), Some(1)],
        unbinding: Unbinding::Within(0.5),
        rate: 60.0,
        ..Decay::default()
    }];
    assert_flat(&plane, 31, 2);
    plane.receivers.clear();
    plane.boundary.axes[..2].fill(Axis::Open);
    plane.boundary.vessel = Some(Vessel { along: Some(2), center: [0.0; 3], radius: 2.0 });
    assert_flat(&plane, 32, 2);
}

#[test]
fn segments_hold_what_they_hold_on_the_cpu() {
    let mut line = frozen(brownian(true), 1);
    line.receivers = vec![
        receiver("rate", [0.875, 0.0, 0.0], 1e-3, ReceiverKind::Partial(Adsorption::Reactivity(30.0))),
        receiver("point", [-0.875, 0.0, 0.0], 1e-3, ReceiverKind::Absorbing),
    ];
    line.time_step = 0.005;
    line.reactions[0].binding_radius = 5e-4;
    assert_flat(&line, 33, 1);
}

#[test]
fn segment_receives_no_particle_from_half_a_period_away() {
    let Some(device) = device() else { return };
    let mut line = frozen(brownian(false), 1);
    line.boundary.axes[0] = Axis::Periodic { low: 0.0, high: 10.0 };
    line.transmitters.iter_mut().for_each(|transmitter| transmitter.center[0] = 7.0);
    line.receivers = vec![receiver("point", [2.0, 0.0, 0.0], 0.5, ReceiverKind::Absorbing)];
    let mut runs = Runs::new(&device, &line, 34);
    runs.steps(20);
    runs.assert_close(1e-5);
    assert_eq!(runs.gpu.received(), [[0, 0]]);
}

#[test]
fn disks_collide_as_on_the_cpu() {
    for contact in [Contact::Separate, Contact::Elastic] {
        let mut disks = frozen(crowd(contact, 0.25, 0.15, 6), 2);
        disks.boundary = Boundary { axes: [Axis::Open, Axis::Open, Axis::Frozen], vessel: None };
        disks.transmitters[0].shape = Shape::Lattice([14.7, 14.7, 1.0], [14, 14, 1]);
        disks.transmitters[0].release = vec![(0, 142), (1, 54)];
        let state = compare(&disks, 34, 3);
        if device().is_some() {
            assert!(state.totals.contacts > 0);
        }
    }
}
