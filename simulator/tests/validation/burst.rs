use lazygrid_sim::{Contact, Model, Reaction, Receiver, ReceiverKind, Shape};
use rayon::prelude::*;

use crate::Row;
use crate::setup::{begin, burst, in_ball, mean, receiver, run_for, species, steps};

pub(crate) fn pairs_of_a_point_burst() -> Vec<Row> {
    let (n, sigma, v) = (20_000_u32, 0.1_f64, 4.0_f64);
    let model = Model {
        time_step: 1.0,
        species: vec![species("A", 0.05, 1.0)],
        transmitters: vec![burst(Shape::Point, &[(0, n)])],
        contact: Contact::Count,
        ..Model::default()
    };
    let count = |seed| {
        let simulation = run_for(&model, seed, 1);
        simulation.state().totals.pairs as f64
    };
    let counts: Vec<f64> = (0..20).into_par_iter().map(count).collect();
    let x = sigma / v.sqrt();
    let hit = libm::erf(x / 2_f64.sqrt()) - (2.0 / std::f64::consts::PI).sqrt() * x * (-x * x / 2.0).exp();
    let expected = f64::from(n) * f64::from(n - 1) / 2.0 * hit;
    vec![
        Row::new("the closed form itself", 6643.7, expected, 0.05),
        Row::mean("pairs, mean of 20 seeds", expected, counts),
    ]
}

pub(crate) fn acid_base() -> Vec<Row> {
    let (acid, base, sigma, step_per_sigma, time) = (4000, 2500, 0.1_f64, 0.5, 0.5);
    let time_step = (step_per_sigma * sigma).powi(2) / 2.0;
    let reaction = Reaction {
        name: "acid + base -> 0".to_owned(),
        reactants: [0, 1],
        binding_radius: sigma as f32,
        ..Reaction::default()
    };
    let (center, sees) = ([1.5, 0.0, 0.0], vec![true; 2]);
    let model = Model {
        time_step,
        species: vec![species("acid", 0.0, 1.0), species("base", 0.0, 1.0)],
        reactions: vec![reaction],
        transmitters: vec![burst(Shape::Gaussian(0.5), &[(0, acid), (1, base)])],
        receivers: vec![Receiver { center, sees, ..receiver(1.0, ReceiverKind::Transparent) }],
        ..Model::default()
    };
    let count = (time / time_step).round() as u32;
    let replica = |seed: u64| {
        let mut simulation = begin(&model, seed);
        let mut wrong = 0;
        for _ in 0..count {
            steps(&mut simulation, 1);
            let (totals, ids) = (&simulation.state().totals, simulation.state().particles.id.len() as u64);
            let reacted = totals.reacted[0];
            let conserved = [totals.present[0] + reacted, totals.present[1] + reacted];
            let left = u64::from(acid + base) - 2 * reacted;
            wrong += u64::from(conserved != [u64::from(acid), u64::from(base)] || ids != left);
        }
        let inside = simulation.received().swap_remove(0);
        (inside[0] as f64 - inside[1] as f64, wrong, simulation.state().totals.reacted[0])
    };
    let replicas: Vec<_> = (0..60).into_par_iter().map(replica).collect();
    let (measured, error) = mean(replicas.iter().map(|r| r.0));
    let expected = f64::from(acid - base) * in_ball(1.0, 1.5, 0.25 + 2.0 * time);
    let fewest = replicas.iter().map(|r| r.2).min().unwrap_or(0);
    vec![
        Row::new("the closed form itself", 105.06, expected, 0.005),
        Row::new(
            "acid − base at the receiver, 60 replicas",
            expected,
            measured,
            4.0 * error + 0.01 * expected,
        ),
        Row::exact("steps in which a molecule is missing", 0, replicas.iter().map(|r| r.1).sum()),
        Row { must_differ: true, ..Row::exact("reactions, fewest of a replica", 0, fewest) },
    ]
}
