use lazygrid::Algorithm;

use super::*;
use crate::motion::collisions::tests::{remove_table, with_points};
use crate::{Axis, Boundary, Contact, Decay, Error, Reaction, Shape, Species, Transmitter};

#[test]
fn collisions_without_the_table_are_the_same() {
    let end = |model: &Model, has_table: bool| -> State {
        let mut simulation = Simulation::new(model.clone(), 3, Algorithm::Auto).expect("a model");
        if !has_table {
            remove_table(simulation.collisions.as_mut().expect("collisions"), model);
        }
        (0..4).for_each(|_| simulation.step().expect("a step"));
        simulation.state().clone()
    };
    for contact in [Contact::Separate, Contact::Elastic] {
        let mut model = with_points(contact);
        model.time_step = 0.02;
        let burst = |center, shape, release: &[(u32, u32)]| Transmitter {
            center,
            shape,
            release: release.to_vec(),
            ..Transmitter::default()
        };
        model.transmitters = vec![
            burst([2.75; 3], Shape::Lattice([5.5; 3], [5; 3]), &[(0, 60), (1, 65)]),
            burst([1.1; 3], Shape::Point, &[(0, 40)]),
            burst([2.2; 3], Shape::Point, &[(2, 300)]),
        ];
        let with = end(&model, true);
        assert!(with.totals.contacts > 50 && with.totals.reacted[0] > 3, "{:?}", with.totals);
        assert!(with == end(&model, false), "{contact:?}");
    }
}

fn three_particles(species: Species, contact: Contact) -> Simulation {
    let burst = Transmitter { release: vec![(0, 3)], ..Transmitter::default() };
    let boundary = match contact {
        Contact::Ignore => Boundary::default(),
        _ => Boundary::periodic([-1.0; 3], [1.0; 3]),
    };
    let model = Model {
        time_step: 1.0,
        species: vec![species],
        transmitters: vec![burst],
        contact,
        boundary,
        ..Model::default()
    };
    Simulation::new(model, 1, Algorithm::Auto).expect("a model")
}

#[test]
fn state_of_another_model_is_refused() {
    let model = three_particles(Species::default(), Contact::Ignore).model;
    let state = State::new(&model, 1).expect("a state");
    let resume = |model: &Model, state: &State| {
        Simulation::resume(model.clone(), 1, Algorithm::Auto, state.clone()).map(|_| ())
    };
    assert!(resume(&model, &state).is_ok());
    let refused = |model: &Model, state: &State| {
        let error = resume(model, state).expect_err("another model").to_string();
        assert!(error.contains("of another model"), "{error}");
    };
    refused(&Model { decays: vec![Decay::default()], ..model.clone() }, &state);
    let reaction = Reaction { products: [None; 2], ..Reaction::default() };
    refused(&Model { reactions: vec![reaction], ..model.clone() }, &state);
    let moving = Species { thermal_speed: 1.0, ..Species::default() };
    refused(&Model { species: vec![moving], ..model.clone() }, &state);
    let mut torn = state.clone();
    torn.particles.position[1].pop();
    refused(&model, &torn);
}

#[test]
fn positions_beyond_the_range_of_numbers_are_an_error() {
    let drift = [2e38, 0.0, 0.0];
    let mut simulation = three_particles(Species { drift, ..Species::default() }, Contact::Ignore);
    simulation.step().expect("positions up to 2e38");
    let error = simulation.step().expect_err("an error");
    assert!(matches!(error, Error::NotFinite { step: 1, particles: 3 }), "{error}");
}

#[test]
fn collisions_on_paths_of_too_many_searches_are_refused() {
    let sphere = |thermal_speed| Species { radius: 0.1, thermal_speed, ..Species::default() };
    three_particles(sphere(100.0), Contact::Elastic).step().expect("a step");
    let error = three_particles(sphere(1e7), Contact::Elastic).step().expect_err("an error").to_string();
    let expected = "collisions are followed over ";
    assert!(error.contains(expected) && error.contains("100000 times the distance"), "{error}");
}

#[test]
fn small_spheres_on_a_line_collide_in_few_searches() {
    let sphere = Species { radius: 1e-4, thermal_speed: 1.0, ..Species::default() };
    let burst =
        Transmitter { shape: Shape::Box([100.0, 1.0, 1.0]), release: vec![(0, 9)], ..Transmitter::default() };
    let walls = Axis::Reflecting { low: -50.0, high: 50.0 };
    let model = Model {
        time_step: 200.0,
        species: vec![sphere],
        transmitters: vec![burst],
        contact: Contact::Elastic,
        boundary: Boundary { axes: [walls, Axis::Frozen, Axis::Frozen], vessel: None },
        ..Model::default()
    };
    let mut simulation = Simulation::new(model, 1, Algorithm::Auto).expect("a model");
    let order = |simulation: &Simulation| {
        let particles = &simulation.state().particles;
        let mut rows: Vec<_> = (0..9).map(|at| (particles.position[0][at], particles.id[at])).collect();
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        rows.into_iter().map(|(_, id)| id).collect::<Vec<_>>()
    };
    let before = order(&simulation);
    simulation.step().expect("a step");
    assert!(simulation.state().totals.contacts > 9, "{:?}", simulation.state().totals);
    assert_eq!(order(&simulation), before);
}
