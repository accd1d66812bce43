use lazygrid_sim::{
    Adsorption, Axis, Boundary, Flow, Model, Receiver, ReceiverKind, ReceptorType, Shape, Species, Vessel,
};

use super::device;
use super::models::{brownian, burst, decay, receiver, species};
use super::surfaces::compare;

fn past(diffusion: f64, boundary: Boundary) -> Model {
    let absorbing = |name, center| receiver(name, center, 0.25, ReceiverKind::Absorbing);
    let mut receivers = vec![
        absorbing("first", [1.0, 0.0, 0.0]),
        absorbing("second", [-0.5, 0.75, 0.25]),
        absorbing("third", [-0.25, -1.0, -0.75]),
    ];
    receivers[1].velocity = [-100.0, 50.0, 0.0];
    receivers[2].diffusion = if diffusion > 0.0 { 2.0 } else { 0.0 };
    let kind = |name, drift| species(name, diffusion, drift);
    Model {
        species: vec![kind("A", [2000.0, 300.0, 100.0]), kind("B", [-700.0, 900.0, 1500.0])],
        receivers,
        boundary,
        ..brownian(false)
    }
}

fn boundaries() -> [Boundary; 4] {
    let vessel = |along| Some(Vessel { along, center: [0.0; 3], radius: 3.5 });
    let period = Axis::Periodic { low: -2.0, high: 2.0 };
    [
        brownian(false).boundary,
        Boundary::periodic([-2.0; 3], [2.0; 3]),
        Boundary { axes: [period, Axis::Open, Axis::Open], vessel: vessel(Some(0)) },
        Boundary { axes: [Axis::Open; 3], vessel: vessel(None) },
    ]
}

#[track_caller]
fn assert_arrivals(model: &Model, seed: u64) {
    let state = compare(model, seed, 4);
    let arrived = &state.totals.arrived;
    assert!(device().is_none() || arrived.iter().flatten().all(|&n| n > 0), "{arrived:?}");
}

#[test]
fn drifting_particles_hit_receivers_as_on_the_cpu() {
    for (seed, boundary) in (71..).zip(boundaries()) {
        assert_arrivals(&past(2.0, boundary), seed);
    }
}

#[test]
fn lines_hit_receivers_as_on_the_cpu() {
    for (seed, boundary) in (75..).zip(boundaries()) {
        assert_arrivals(&past(0.0, boundary), seed);
    }
}

#[test]
fn decaying_swimmers_hit_receivers_as_on_the_cpu() {
    let mut model = past(2.0, brownian(false).boundary);
    for swimmer in &mut model.species {
        *swimmer = Species { speed: 2000.0, tumble_rate: 100.0, drift: [0.0; 3], ..swimmer.clone() };
    }
    model.decays = vec![decay(0, Some(1), 300.0)];
    assert_arrivals(&model, 80);
}

#[test]
fn poiseuille_flow_past_receivers_matches_the_cpu() {
    let [_, _, cylinder, _] = boundaries();
    let mut model = past(2.0, cylinder);
    model.species.iter_mut().for_each(|kind| kind.drift = [0.0; 3]);
    model.flow = Some(Flow::Poiseuille { mean: 1500.0 });
    assert_arrivals(&model, 81);
}

#[test]
fn drifting_particles_adsorb_as_on_the_cpu() {
    let mut model = past(2.0, brownian(false).boundary);
    let kinds = [
        ReceiverKind::Partial(Adsorption::PerStep(0.5)),
        ReceiverKind::Receptors(vec![ReceptorType::new(100, 400.0, 60.0, [0, 1])]),
        ReceiverKind::Reflecting,
    ];
    let centers = [[0.75, -0.75, 0.5], [0.0, 0.0, 1.0], [-1.25, 0.0, 0.0]];
    for (kind, center) in kinds.into_iter().zip(centers) {
        let radius = 0.375;
        model.receivers.push(Receiver { radius, ..receiver("surface", center, radius, kind) });
    }
    let state = compare(&model, 82, 3);
    let arrived = &state.totals.arrived;
    assert!(device().is_none() || arrived[..5].iter().flatten().all(|&n| n > 0), "{arrived:?}");
}

fn lines_to_a_wall(center: f32, radius: f32, velocity: f64) -> Model {
    let mut receiver = receiver("target", [center, 0.0, 0.0], radius, ReceiverKind::Absorbing);
    receiver.velocity[0] = velocity;
    let mut model = Model {
        species: vec![species("A", 0.0, [-3200.0, 0.0, 0.0]), species("B", 0.0, [0.0; 3])],
        receivers: vec![receiver],
        boundary: Boundary::reflecting([-2.0; 3], [6.0, 2.0, 2.0]),
        ..brownian(false)
    };
    model.species[0].radius = 1.0;
    model.transmitters = vec![burst(Shape::Box([0.9, 0.04, 0.04]), &[(0, 1000)])];
    model.transmitters[0].center[0] = -0.5;
    model
}

#[test]
fn lines_of_large_spheres_hit_a_receiver_after_the_wall_as_on_the_cpu() {
    for (seed, center, velocity) in [(91, 2.0, 0.0), (92, 1.5, -3200.0)] {
        let state = compare(&lines_to_a_wall(center, 0.05, velocity), seed, 1);
        assert!(device().is_none() || state.totals.arrived[0][0] > 50, "{:?}", state.totals.arrived);
    }
}
