use super::*;
use crate::gpu::tests::device;
use crate::model::boundary::Axis;
use crate::motion::collisions::tests::model;
use crate::{Contact, Decay, Schedule, Shape, Species, Transmitter};

fn burst(radius: f32) -> Model {
    let mut model = model(Contact::Separate, Axis::Periodic { low: 0.0, high: 5.5 });
    model.time_step = 0.02;
    model.species[1].radius = radius;
    let transmitter = |center, shape, release| Transmitter {
        center,
        shape,
        release: vec![release],
        ..Transmitter::default()
    };
    model.transmitters = vec![
        transmitter([2.75; 3], Shape::Lattice([5.5; 3], [5; 3]), (0, 125)),
        transmitter([2.2; 3], Shape::Point, (1, 600)),
    ];
    model
}

#[test]
fn only_the_next_release_is_prepared_if_particles_dissociate() {
    let Some(gpu) = device() else { return };
    let rates = vec![(0, 1e4)];
    let schedule = Schedule::Steady { from: 0.0, until: 1.0, rates };
    for (products, expected) in [([Some(1), None], 50), ([Some(1), Some(1)], 1)] {
        let model = Model {
            time_step: 0.01,
            species: vec![Species::default(); 2],
            decays: vec![Decay { products, rate: 1.0, ..Decay::default() }],
            transmitters: vec![Transmitter { schedule: schedule.clone(), ..Transmitter::default() }],
            ..Model::default()
        };
        let simulation = GpuSimulation::new(model, 3, gpu.clone(), GpuOptions::default()).expect("a model");
        assert_eq!(simulation.bursts(50).expect("releases").len(), expected, "{products:?}");
    }
}

/// A radius of 10⁻³⁰ µm collides as a point, and shows the candidates without a table of species.
#[test]
fn points_at_one_position_are_no_candidates_of_each_other() {
    let Some(gpu) = device() else { return };
    let capacity = 1 << 13;
    let run = |radius: f32| {
        let options = GpuOptions { pair_capacity: capacity, ..GpuOptions::default() };
        let mut simulation = GpuSimulation::new(burst(radius), 3, gpu.clone(), options).expect("a model");
        simulation.run(3).expect("steps");
        let particles = simulation.state().expect("a state").particles;
        (simulation.steps.sizes.near, (simulation.totals.contacts, particles.id, particles.position))
    };
    let [(of_points, points), (of_spheres, spheres)] = [0.0, 1e-30].map(run);
    assert!(of_points == capacity && of_spheres >= 600 * 599 / 2, "{of_points} and {of_spheres}");
    assert!(points.0 > 100 && points == spheres, "{} and {} collisions", points.0, spheres.0);
}
