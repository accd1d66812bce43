use lazygrid::Algorithm;

use super::*;
use crate::model::receiver::{WallFace, signed_distance};
use crate::model::transmitter::Shape;
use crate::model::vessel::Vessel;
use crate::model::{Decay, Flow, Species};
use crate::release::origins::Origin;
use crate::{Adsorption, Boundary, Receiver, ReceiverKind, ReceptorType, Simulation, State};

fn steady(rates: Vec<(u32, f64)>, [from, until]: [f64; 2]) -> Transmitter {
    Transmitter { schedule: Schedule::Steady { from, until, rates }, ..Transmitter::default() }
}

fn decay(reactant: u32, product: u32, rate: f64) -> Decay {
    Decay { reactant, products: [Some(product), None], rate, ..Decay::default() }
}

fn release(model: &Model, step: u32, next_id: u32) -> Result<ReleasedParticles, Error> {
    let events = &PartialEvents::new(model);
    let at = ReleaseStep { events, key: Key::new(3), step, next_id, receiver_moves: &[] };
    model.release(at, RankSlice::WHOLE)
}

fn released_in_a_step(model: &Model) -> impl Iterator<Item = Particle> {
    let released = release(model, 1, 0).expect("a release");
    (0..released.particles.len()).map(move |at| released.particles.get(at))
}

#[test]
fn products_since_the_release_have_the_speeds_of_their_species() {
    let species = |speed| Species { speed, ..Species::default() };
    let model = Model {
        time_step: 0.1,
        species: vec![species(20.0), species(0.0), species(5.0)],
        decays: vec![decay(0, 1, 50.0), decay(1, 2, 50.0)],
        transmitters: vec![steady(vec![(0, 1e4), (1, 1e4)], [0.0, 1.0])],
        ..Model::default()
    };
    let mut counts = [0; 3];
    for particle in released_in_a_step(&model) {
        let speed = particle.velocity.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt();
        assert!((speed - model.species[particle.species as usize].speed).abs() < 1e-4, "{particle:?}");
        counts[particle.species as usize] += 1;
    }
    assert!(counts.iter().all(|&count| count > 100), "{counts:?}");
}

#[test]
fn products_since_the_release_have_the_thermal_speeds_of_their_species() {
    let species = |thermal_speed| Species { thermal_speed, ..Species::default() };
    let model = Model {
        time_step: 0.1,
        species: [100.0, 0.0, 5.0, 10.0, 0.0, 3.0].map(species).to_vec(),
        decays: vec![decay(0, 1, 1e9), decay(2, 3, 1e9), decay(4, 5, 1e9)],
        transmitters: vec![steady(vec![(0, 1e5), (2, 1e5), (4, 1e5)], [0.0, 1.0])],
        ..Model::default()
    };
    let mut sums = [(0.0, 0); 6];
    for particle in released_in_a_step(&model) {
        let (sum, count) = &mut sums[particle.species as usize];
        *sum += particle.velocity.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>();
        *count += 3;
    }
    for (product, speed) in [(1, 0.0), (3, 10.0), (5, 3.0)] {
        let (sum, count) = sums[product];
        let measured = (sum / f64::from(count)).sqrt();
        let error = speed / (2.0 * f64::from(count)).sqrt();
        assert!(count > 20_000 && (measured - speed).abs() <= 4.0 * error, "{measured}, not {speed}");
    }
}

#[test]
fn steady_release_beyond_all_ids_is_refused() {
    for numbers in [CountDistribution::Fixed, CountDistribution::Poisson] {
        for rate in [1e11, 1e21, 1e300] {
            let model = Model {
                time_step: 0.1,
                species: vec![Species::default()],
                transmitters: vec![Transmitter { numbers, ..steady(vec![(0, rate)], [0.0, 1.0]) }],
                ..Model::default()
            };
            let refused = release(&model, 1, 0).map(|released| released.next_id);
            assert!(matches!(refused, Err(Error::OutOfIds { .. })), "{numbers:?}, {rate}: {refused:?}");
        }
    }
}

#[test]
fn steady_release_fills_all_sites_of_a_lattice() {
    let ends = [0.0, 1.0];
    for (numbers, rates) in [
        (CountDistribution::Fixed, vec![(0, 30.0), (0, 10.0)]),
        (CountDistribution::Poisson, vec![(0, 4000.0)]),
    ] {
        let shape = Shape::Lattice([4.0, 1.0, 1.0], [4, 1, 1]);
        let model = Model {
            time_step: 0.05,
            species: vec![Species::default()],
            transmitters: vec![Transmitter { shape, numbers, ..steady(rates, ends) }],
            ..Model::default()
        };
        let (mut counts, mut next_id) = ([0; 4], 0);
        for step in 0..=20 {
            let released = release(&model, step, next_id).expect("a release");
            next_id = released.next_id;
            let positions = (0..released.particles.len()).map(|at| released.particles.get(at).position[0]);
            positions.for_each(|x| counts[(x + 1.5) as usize] += 1);
        }
        let all = counts.iter().sum::<usize>();
        let spread = if numbers == CountDistribution::Fixed { 0.0 } else { 4.0 * (all as f64 / 4.0).sqrt() };
        let is_even = |&count: &usize| (count as f64 - all as f64 / 4.0).abs() <= spread;
        assert!(all >= 40 && counts.iter().all(is_even), "{counts:?}");
    }
}

#[test]
fn each_of_two_bursts_in_a_step_begins_at_the_first_site() {
    let shape = Shape::Lattice([4.0, 1.0, 1.0], [4, 1, 1]);
    let schedule = Schedule::Times(vec![0.05, 0.1]);
    let model = Model {
        time_step: 0.1,
        species: vec![Species::default()],
        transmitters: vec![Transmitter {
            shape,
            schedule,
            release: vec![(0, 2), (0, 1)],
            ..Transmitter::default()
        }],
        ..Model::default()
    };
    let positions: Vec<f32> = released_in_a_step(&model).map(|particle| particle.position[0]).collect();
    assert_eq!(positions, [-1.5, -0.5, 0.5, -1.5, -0.5, 0.5]);
}

#[test]
fn origins_are_restored_if_all_ids_are_of_scheduled_releases() {
    let burst = |times: &[f64]| Transmitter {
        schedule: Schedule::Times(times.to_vec()),
        release: vec![(0, 3), (0, 2)],
        ..Transmitter::default()
    };
    let mut model = Model {
        time_step: 0.1,
        species: vec![Species::default()],
        transmitters: vec![burst(&[0.0, 0.2]), steady(vec![(0, 50.0)], [0.0, 1.0]), burst(&[0.1])],
        logs_arrivals: true,
        ..Model::default()
    };
    let expected = ran(&model, 4).state().clone();
    model.logs_arrivals = false;
    let silent = ran(&model, 4).state().clone();
    assert_ne!(silent, expected);
    model.logs_arrivals = true;
    let resumed =
        |state: &State| Simulation::resume(model.clone(), 3, Algorithm::Auto, state.clone()).unwrap();
    assert_eq!(resumed(&silent).state(), &expected);
    let more = State { next_id: silent.next_id + 1, ..silent };
    assert_eq!(resumed(&more).state().origins.origin_of(0), None);
}

#[test]
fn emitted_particles_continue_from_site_to_site() {
    let shape = Shape::Lattice([4.0, 1.0, 1.0], [4, 1, 1]);
    let transmitter = Transmitter { shape, ..Transmitter::default() };
    let species = vec![Species::default()];
    let model = Model { time_step: 0.1, species, ..Model::default() };
    let burst = |id| {
        let one = Emission { transmitter: 0, species: 0, count: 1 };
        model.burst(&Batch::from_ids(&transmitter, one, id, &[]), Key::new(3)).unwrap()
    };
    let position = |id| burst(id).particles.get(0).position[0];
    assert_eq!([4, 5, 6, 7, 8].map(position), [-1.5, -0.5, 0.5, 1.5, -1.5]);
}

#[test]
fn fixed_steady_release_counts_every_particle_once() {
    for (rate, time_step, [from, until], steps) in [
        (1e7, 1e-4, [0.0, 1e9], 100_000_u32),
        (3e7, 1e-5, [0.0, 0.9], 100_000),
        (1e6 / 3.0, 0.1, [0.3, 777.7], 10_000),
        (7.0, 0.1, [0.0, 1e9], 10_000),
    ] {
        let model = Model {
            time_step,
            transmitters: vec![steady(vec![(0, rate)], [from, until])],
            ..Model::default()
        };
        let released_in_step = |step: u32| -> u64 {
            model.releases(step, Key::new(1)).map(|(_, _, count)| u64::from(count)).sum()
        };
        let released: u64 = (0..=steps).map(released_in_step).sum();
        let expected = rate * (until.min(f64::from(steps) * time_step) - from);
        assert_eq!(released, (expected + 1e-6).floor() as u64, "{rate} per s in steps of {time_step} s");
    }
}

fn beside_a_sphere(kind: ReceiverKind, time_step: f64) -> Model {
    let species = Species { name: "A".into(), diffusion: 1.0, ..Species::default() };
    let receiver = Receiver { name: "rx".into(), radius: 1.0, kind, sees: vec![true], ..Receiver::default() };
    let transmitter = Transmitter { center: [1.05, 0.0, 0.0], ..steady(vec![(0, 1e5)], [0.0, 1.0]) };
    Model {
        time_step,
        species: vec![species],
        transmitters: vec![transmitter],
        receivers: vec![receiver],
        logs_arrivals: true,
        ..Model::default()
    }
}

fn ran(model: &Model, steps: u32) -> Simulation {
    let mut simulation = Simulation::new(model.clone(), 3, Algorithm::Auto).expect("a run");
    (0..steps).for_each(|_| simulation.step().expect("a step"));
    simulation
}

#[test]
fn steady_release_stays_outside_of_reflecting_surfaces() {
    let receptors = ReceiverKind::Receptors(vec![ReceptorType::new(5, 1e3, 1.0, [0])]);
    let partial = ReceiverKind::Partial(Adsorption::Reactivity(1.0));
    for kind in [ReceiverKind::Reflecting, partial, receptors] {
        for velocity in [[0.0; 3], [2.0, 1.0, 0.0]] {
            let mut model = beside_a_sphere(kind.clone(), 0.01);
            model.receivers[0].velocity = velocity;
            let simulation = ran(&model, 1);
            let state = simulation.state();
            let is_inside = |&at: &usize| {
                let position = state.particles.position_of(at);
                signed_distance(1.0, state.centers[0], &model.boundary, position) < 0.0
            };
            let inside = (0..state.particles.len()).filter(is_inside).count();
            assert!(state.particles.len() > 500, "{kind:?}: {} particles", state.particles.len());
            assert_eq!(inside, 0, "{kind:?}, {velocity:?}");
        }
    }
}

#[test]
fn steady_release_around_a_diffusing_receiver_stays_outside() {
    let mut model = beside_a_sphere(ReceiverKind::Reflecting, 0.01);
    model.receivers[0].diffusion = 1.0;
    let transmitter = &mut model.transmitters[0];
    transmitter.carrier = Some(0);
    transmitter.shape = Shape::Shell(1.0005, 1.001);
    let simulation = ran(&model, 4);
    let state = simulation.state();
    assert!(state.particles.len() > 3000, "{} particles", state.particles.len());
    let positions = (0..state.particles.len()).map(|at| state.particles.position_of(at));
    let inside =
        positions.filter(|&at| signed_distance(1.0, state.centers[0], &model.boundary, at) < 0.0).count();
    assert_eq!(inside, 0);
}

#[test]
fn steady_release_arrives_alike_at_any_time_step() {
    let partial = ReceiverKind::Partial(Adsorption::Reactivity(20.0));
    let plane = ReceiverKind::Wall(WallFace::Low(0));
    for kind in [ReceiverKind::Absorbing, partial, plane] {
        let count = |time_step: f64, steps| {
            let mut model = beside_a_sphere(kind.clone(), time_step);
            if let ReceiverKind::Wall(_) = kind {
                model.boundary = Boundary::reflecting([1.0, -9.0, -9.0], [9.0; 3]);
            }
            let simulation = ran(&model, steps);
            let totals = &simulation.state().totals;
            assert_eq!(totals.released[0], totals.present[0] + totals.arrived[0][0], "{kind:?}");
            (totals.arrived[0][0] as f64, totals.released[0] as f64)
        };
        let [(long, n), (short, _)] = [count(0.02, 1), count(0.0005, 40)];
        let error = ((long * (1.0 - long / n)).max(1.0) + short * (1.0 - short / n)).sqrt();
        assert!(short > 0.1 * n && (long - short).abs() < 4.0 * error, "{kind:?}: {long} and {short} of {n}");
    }
}

#[test]
fn arrivals_since_the_release_are_logged_with_their_origin() {
    let simulation = ran(&beside_a_sphere(ReceiverKind::Absorbing, 0.01), 1);
    let origin = Some(Origin { transmitter: 0, step: 1 });
    let arrivals = simulation.arrivals();
    assert_eq!(arrivals.len() as u64, simulation.state().totals.arrived[0][0]);
    assert!(arrivals.len() > 100 && arrivals.is_sorted_by_key(|arrival| arrival.id));
    assert!(arrivals.iter().all(|arrival| arrival.step == 1 && arrival.origin == origin));
    assert!(arrivals.iter().all(|arrival| !simulation.state().particles.id.contains(&arrival.id)));
}

/// In the long step 2DΔt = (vΔt)².
#[test]
fn steady_release_at_a_wall_with_drift_spreads_alike_at_any_time_step() {
    let heights = |time_step: f64, steps| {
        let species =
            Species { name: "A".into(), diffusion: 1.0, drift: [-10.0, 0.0, 0.0], ..Species::default() };
        let transmitter = Transmitter { center: [0.05, 0.0, 0.0], ..steady(vec![(0, 1e6)], [0.0, 1.0]) };
        let model = Model {
            time_step,
            species: vec![species],
            transmitters: vec![transmitter],
            boundary: Boundary::reflecting([0.0, -9.0, -9.0], [9.0; 3]),
            ..Model::default()
        };
        let simulation = ran(&model, steps);
        let heights = simulation.state().particles.position[0].iter().map(|&x| f64::from(x));
        let n = heights.len() as f64;
        let mean = heights.clone().sum::<f64>() / n;
        (mean, heights.map(|x| (x - mean).powi(2)).sum::<f64>() / n / n)
    };
    let [(long, long_variance), (short, short_variance)] = [heights(0.02, 1), heights(0.0005, 40)];
    let error = (long_variance + short_variance).sqrt();
    assert!((long - short).abs() < 4.0 * error && error < 0.02 * short, "{long} and {short} ± {error}");
}

#[test]
fn steady_release_in_a_pulse_of_flow_goes_as_far_at_any_time_step() {
    let ends = |time_step: f64, steps| {
        let vessel = Vessel { along: Some(0), center: [0.0; 3], radius: 1.0 };
        let transmitter = Transmitter { center: [0.0, 0.5, 0.0], ..steady(vec![(0, 1e4)], [0.0, 1.0]) };
        let model = Model {
            time_step,
            species: vec![Species { name: "A".into(), ..Species::default() }],
            transmitters: vec![transmitter],
            boundary: Boundary { vessel: Some(vessel), ..Boundary::default() },
            flow: Some(Flow::Poiseuille { mean: 50.0 }),
            flow_pulse: Some([0.0031, 0.0155]),
            ..Model::default()
        };
        let simulation = ran(&model, steps);
        let particles = &simulation.state().particles;
        let mut ends: Vec<_> =
            particles.id.iter().copied().zip(particles.position[0].iter().copied()).collect();
        ends.sort_unstable_by_key(|&(id, _)| id);
        ends
    };
    let (long, short) = (ends(0.02, 1), ends(0.0005, 40));
    assert!(long.len() == 200 && short.len() == 200);
    for (&(id, long), (_, short)) in long.iter().zip(short) {
        // The velocity at half the radius is 1.5 times the mean.
        let released = f64::from(id + 1) * 1e-4;
        let expected = 75.0 * (0.0155 - released.max(0.0031)).max(0.0) as f32;
        assert!(
            (long - expected).abs() < 1e-4 && (short - expected).abs() < 1e-4,
            "{id}: {long}, {short}, {expected}"
        );
    }
}

/// The mean distance from the center of a uniform ball is 3/4 of its radius, from the axis of a cylinder 2/3.
#[test]
fn shapes_larger_than_a_vessel_fill_it() {
    let all = |along: Option<usize>, shape: Shape| -> Vec<f64> {
        let vessel = Vessel { along, center: [1.0, 0.0, 0.0], radius: 1.0 };
        let model = Model {
            time_step: 0.1,
            species: vec![Species::default()],
            transmitters: vec![Transmitter {
                center: [1.0, 0.0, 0.0],
                shape,
                schedule: Schedule::Times(vec![0.1]),
                release: vec![(0, 20_000)],
                ..Transmitter::default()
            }],
            boundary: Boundary { vessel: Some(vessel), ..Boundary::default() },
            ..Model::default()
        };
        released_in_a_step(&model).map(|particle| vessel.distance(particle.position)).collect()
    };
    let assert_mean = |along, shape, mean: f64, variance: f64| {
        let found = all(along, shape);
        assert!(found.iter().all(|&r| r <= 1.0));
        let n = found.len() as f64;
        let error = (found.iter().sum::<f64>() / n - mean) / (variance / n).sqrt();
        assert!(n == 20_000.0 && error.abs() < 5.0, "{shape:?}: {error} standard errors");
    };
    for shape in [Shape::Box([2.0; 3]), Shape::Box([9.0; 3]), Shape::Gaussian(1e4)] {
        assert_mean(None, shape, 0.75, 3.0 / 5.0 - 9.0 / 16.0);
        assert_mean(Some(1), shape, 2.0 / 3.0, 1.0 / 2.0 - 4.0 / 9.0);
    }
    let center = all(None, Shape::Gaussian(1.0)).into_iter().filter(|&r| r < 0.01).count();
    assert!(center < 10, "{center} at the center");
}
