use std::f64::consts::PI;

use lazygrid_sim::{Boundary, Model, Reaction, ReactionRate, Shape};
use rayon::prelude::*;

use crate::Row;
use crate::setup::{begin, burst, is_long, run_for, species, steps_until};

/// A fixed target among diffusing traps. With steps s, hits are those of a sphere of radius σ′ = σ − 0.5826·s: 4πDσ′T
/// + 8σ′²√(πDT) − (4/3)π(σ³ − σ′³) per concentration.
pub(crate) fn diffusion_limited() -> Vec<Row> {
    let (traps, ball, batches) = (if is_long() { 1_500_000_u32 } else { 400_000 }, 8.0_f64, 400);
    let mut rows = Vec::new();
    for xi in [0.1_f64, 0.2] {
        let time_step = xi * xi / 2.0;
        let reaction = Reaction {
            name: "target + trap -> target".to_owned(),
            reactants: [0, 1],
            products: [Some(0), None],
            binding_radius: 1.0,
            ..Reaction::default()
        };
        let model = Model {
            time_step,
            species: vec![species("target", 0.0, 0.0), species("trap", 0.0, 1.0)],
            reactions: vec![reaction],
            transmitters: vec![
                burst(Shape::Point, &[(0, 1)]),
                burst(Shape::Shell(1.0, ball as f32), &[(1, traps / batches)]),
            ],
            ..Model::default()
        };
        let hits = |seed: u32| {
            let simulation = run_for(&model, seed.into(), (1.0 / time_step).round() as u32);
            simulation.state().totals.reacted[0]
        };
        let hits: u64 = (0..batches).into_par_iter().map(hits).sum();
        let concentration = f64::from(traps) / (4.0 / 3.0 * PI * (ball.powi(3) - 1.0));
        let sigma = 1.0 - 0.5826 * xi;
        let expected =
            4.0 * PI * sigma + 8.0 * sigma * sigma * PI.sqrt() - 4.0 / 3.0 * PI * (1.0 - sigma.powi(3));
        let error = (hits as f64).sqrt() / concentration;
        let what = format!("hits per concentration, ξ = {xi}");
        rows.push(Row::new(what, expected, hits as f64 / concentration, 4.0 * error + 0.02 * expected));
    }
    rows
}

pub(crate) fn well_mixed() -> Vec<Row> {
    let (n, sigma, probability, time_step) = (4000_u32, 0.02_f64, 0.02, 1.0);
    let reaction = Reaction {
        name: "A + B -> 0".to_owned(),
        reactants: [0, 1],
        binding_radius: sigma as f32,
        chance: ReactionRate::PerStep(probability),
        ..Reaction::default()
    };
    let model = Model {
        time_step,
        species: vec![species("A", 0.0, 0.045), species("B", 0.0, 0.045)],
        reactions: vec![reaction],
        boundary: Boundary::periodic([-0.5; 3], [0.5; 3]),
        transmitters: vec![burst(Shape::Box([1.0; 3]), &[(0, n), (1, n)])],
        ..Model::default()
    };
    let times = [100, 400];
    let run = |seed| {
        let mut simulation = begin(&model, seed);
        times.map(|until| {
            steps_until(&mut simulation, until);
            simulation.state().totals.present[0] as f64
        })
    };
    let seeds = if is_long() { 20 } else { 10 };
    let runs: Vec<[f64; 2]> = (0..seeds).into_par_iter().map(run).collect();
    // The probability that two points of the periodic unit cube are within σ.
    let near = 4.0 / 3.0 * PI * sigma.powi(3);
    let k = near * probability / time_step;
    let row = |(index, time): (usize, u32)| {
        let expected = 1.0 / (1.0 / f64::from(n) + k * f64::from(time) * time_step);
        let what = format!("n after {time} steps, mean of {seeds} seeds");
        Row::mean(what, expected, runs.iter().map(|run| run[index]))
    };
    times.into_iter().enumerate().map(row).collect()
}
