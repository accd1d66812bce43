use std::f64::consts::PI;
use std::path::Path;

use lazygrid_sim::{
    Axis, Boundary, Contact, Decay, Model, Reaction, ReactionRate, Receiver, ReceiverKind, Schedule, Shape,
    Species, Transmitter, Unbinding, Vessel,
};

use crate::files;
use crate::steps::{alone, compare};

const RANKS: [u32; 4] = [1, 2, 3, 5];
const SIZES: [f32; 3] = [0.5, 0.35, 0.2];

fn crowd(contact: Contact, fraction: f64, per_side: u32) -> Model {
    let volume = SIZES.iter().map(|&radius| 4.0 / 3.0 * PI * f64::from(radius).powi(3)).sum::<f64>() / 3.0;
    let count = per_side.pow(3) / 3;
    let length = (f64::from(3 * count) * volume / fraction).cbrt() as f32;
    let species = |(k, radius): (usize, f32)| Species {
        name: format!("size {k}"),
        radius,
        diffusion: 0.5 / f64::from(radius),
        mass: f64::from(radius).powi(3),
        thermal_speed: if contact == Contact::Elastic { 1.0 + k as f64 } else { 0.0 },
        ..Species::default()
    };
    Model {
        time_step: 0.05,
        species: SIZES.into_iter().enumerate().map(species).collect(),
        contact,
        boundary: Boundary::periodic([0.0; 3], [length; 3]),
        transmitters: vec![burst(
            [length / 2.0; 3],
            Shape::Lattice([length; 3], [per_side; 3]),
            (0..3).map(|k| (k, count)).collect(),
        )],
        ..Model::default()
    }
}

fn burst(center: [f32; 3], shape: Shape, release: Vec<(u32, u32)>) -> Transmitter {
    Transmitter {
        name: "burst".into(),
        center,
        shape,
        schedule: Schedule::Times(vec![0.0]),
        release,
        ..Transmitter::default()
    }
}

fn contacts(model: &Model, seed: u64, steps: u32) -> u64 {
    alone(model, seed, steps).iter().map(|seen| seen.state.totals.contacts).sum()
}

#[test]
fn crowds_collide_as_in_one_process() {
    for contact in [Contact::Separate, Contact::Elastic] {
        for (fraction, least) in [(0.05, 100), (0.2, 1000), (0.4, 3000)] {
            let model = crowd(contact, fraction, 7);
            let found = contacts(&model, 3, 6);
            assert!(found > least, "{contact:?} at {fraction}: {found} collisions");
            compare(&model, 3, 6, &RANKS);
        }
    }
}

#[test]
fn giants_collide_as_in_one_process() {
    for contact in [Contact::Separate, Contact::Elastic] {
        let mut model = crowd(contact, 0.1, 9);
        model.species[0].radius = 3.0;
        model.transmitters[0].release[0].1 = 2;
        compare(&model, 3, 5, &RANKS);
    }
}

#[test]
fn walls_and_vessels_reflect_as_in_one_process() {
    for contact in [Contact::Separate, Contact::Elastic] {
        let mut model = crowd(contact, 0.3, 6);
        let [Axis::Periodic { low, high }, ..] = model.boundary.axes else { unreachable!() };
        model.boundary.axes = [Axis::Reflecting { low, high }, Axis::Open, Axis::Periodic { low, high }];
        compare(&model, 5, 5, &RANKS);
        let radius = 0.8 * high;
        model.boundary = Boundary {
            axes: [Axis::Open; 3],
            vessel: Some(Vessel { center: [high / 2.0; 3], radius, along: None }),
        };
        compare(&model, 5, 5, &[3]);
    }
}

fn reacting(contact: Contact) -> Model {
    let mut model = crowd(contact, 0.2, 6);
    let reaction = |name: &str, reactants, products| Reaction {
        name: name.into(),
        reactants,
        products,
        binding_radius: 1.0,
        unbinding_radius: 0.4,
        chance: ReactionRate::PerStep(0.2),
    };
    model.reactions = vec![
        reaction("0 + 1 -> 0", [0, 1], [Some(0), None]),
        reaction("2 + 2 -> 1 + 2", [2, 2], [Some(1), Some(2)]),
    ];
    model.decays = vec![Decay {
        name: "0 -> 1 + 2".into(),
        reactant: 0,
        products: [Some(1), Some(2)],
        unbinding: Unbinding::Apart(0.1),
        rate: 2.0,
    }];
    let Axis::Periodic { high, .. } = model.boundary.axes[0] else { unreachable!() };
    let mut point = burst([high / 2.0; 3], Shape::Point, vec![(0, 20), (1, 20), (2, 20)]);
    point.schedule = Schedule::Times(vec![0.0, 0.2]);
    let ball = burst([0.5; 3], Shape::Shell(0.0, 1.5), vec![(0, 30), (2, 60)]);
    model.transmitters.extend([point, ball]);
    model
}

#[test]
fn overlaps_and_reactions_match_one_process() {
    for contact in [Contact::Separate, Contact::Elastic] {
        let model = reacting(contact);
        let totals = &alone(&model, 7, 10).pop().unwrap().state.totals;
        assert!(totals.reacted.iter().all(|&reacted| reacted > 5), "{totals:?}");
        assert!(totals.decayed[0] > 5 && totals.contacts > 100, "{totals:?}");
        compare(&model, 7, 10, &RANKS);
    }
}

#[test]
fn bursts_of_points_and_reactants_match_one_process() {
    for contact in [Contact::Separate, Contact::Elastic] {
        let mut model = crowd(contact, 0.2, 6);
        let Axis::Periodic { high, .. } = model.boundary.axes[0] else { unreachable!() };
        model.species.push(Species { radius: 0.0, ..model.species[2].clone() });
        model.reactions = vec![Reaction {
            reactants: [1, 1],
            products: [Some(0), None],
            binding_radius: 0.3,
            chance: ReactionRate::PerStep(0.2),
            ..Reaction::default()
        }];
        model.transmitters.extend([
            burst([high / 2.0; 3], Shape::Point, vec![(3, 150)]),
            burst([high / 5.0; 3], Shape::Point, vec![(1, 60)]),
        ]);
        let totals = &alone(&model, 7, 5).pop().unwrap().state.totals;
        assert!(totals.contacts > 100 && totals.reacted[0] > 5, "{totals:?}");
        compare(&model, 7, 5, &RANKS);
    }
}

fn around_receivers() -> Model {
    let mut model = crowd(Contact::Separate, 0.25, 9);
    let Axis::Periodic { high, .. } = model.boundary.axes[0] else { unreachable!() };
    let center = [high / 2.0; 3];
    let release = model.transmitters[0].release.clone();
    model.transmitters = vec![burst(center, Shape::Shell(1.6, high / 2.0), release)];
    let receiver = |center, radius, velocity| Receiver {
        center,
        radius,
        velocity: [velocity, 0.0, 0.0],
        kind: ReceiverKind::Reflecting,
        sees: vec![true, true, false],
        ..Receiver::default()
    };
    model.receivers = vec![receiver(center, 1.5, 0.0), receiver([0.5; 3], 0.6, 10.0)];
    model.reactions = vec![Reaction {
        reactants: [0, 1],
        products: [Some(2), None],
        binding_radius: 0.5,
        chance: ReactionRate::PerStep(0.5),
        ..Reaction::default()
    }];
    model
}

#[test]
fn receivers_and_reactions_within_contact_match_one_process() {
    let model = around_receivers();
    let totals = &alone(&model, 7, 8).pop().unwrap().state.totals;
    assert!(totals.reacted[0] > 20 && totals.contacts > 100, "{totals:?}");
    let without = Model { receivers: Vec::new(), ..model.clone() };
    assert!(alone(&model, 7, 8).last() != alone(&without, 7, 8).last());
    compare(&model, 7, 8, &RANKS);
}

#[test]
fn momentum_crosses_all_ranks_within_a_step() {
    let species = |name: &str, thermal_speed| Species {
        name: name.into(),
        radius: 0.5,
        mass: 1.0,
        thermal_speed,
        ..Species::default()
    };
    let row = |x: f32, count: u32, species| {
        burst(
            [x, 0.0, 0.0],
            Shape::Lattice([1.01 * count as f32, 1.0, 1.0], [count, 1, 1]),
            vec![(species, count)],
        )
    };
    let n = 40;
    let model = Model {
        time_step: 0.5,
        species: vec![species("at rest", 0.0), species("thrown", 10.0)],
        contact: Contact::Elastic,
        boundary: Boundary { axes: [Axis::Open, Axis::Frozen, Axis::Frozen], vessel: None },
        transmitters: vec![row(0.0, n, 0), row(-21.5, 1, 1)],
        ..Model::default()
    };
    // The velocity of this seed is towards the row.

    let met = contacts(&model, 4, 1);
    assert!(met >= u64::from(n), "{met}");
    compare(&model, 4, 2, &RANKS);
}

#[test]
fn any_number_of_ranks_continues_a_run_with_collisions() {
    let run = |directory: &Path, contact, steps, resume| {
        let mut run = files::run(directory, steps, resume);
        run.scenario.model.contact = contact;
        for species in &mut run.scenario.model.species {
            species.radius += 0.1;
            species.thermal_speed = if contact == Contact::Elastic { 5.0 } else { 0.0 };
        }
        run
    };
    for contact in [Contact::Separate, Contact::Elastic] {
        let [alone, over] = [0, 1].map(|_| tempfile::tempdir().unwrap());
        files::go(&run(alone.path(), contact, 40, false), 0);
        for (k, (ranks, steps)) in [(3, 13), (0, 20), (2, 27), (5, 40)].into_iter().enumerate() {
            files::go(&run(over.path(), contact, steps, k > 0), ranks);
        }
        assert!(files::files(over.path()) == files::files(alone.path()), "{contact:?}");
        assert_eq!(files::state(over.path()), files::state(alone.path()));
        assert!(files::state(alone.path()).totals.contacts > 10);
    }
}
