use std::f64::consts::PI;

use lazygrid_sim::{Decay, Model, Shape, Species};
use rayon::prelude::*;

use crate::Row;
use crate::setup::{begin, burst, mean, run_for, scenario, species, steps_until};

pub(crate) fn run_and_tumble() -> Vec<Row> {
    let (n, speed, rate) = (40_000_u32, 20.0, 2.0);
    let swimmer = Species { speed, tumble_rate: rate, ..species("A", 0.0, 0.0) };
    let model = Model {
        time_step: 0.02,
        species: vec![swimmer],
        transmitters: vec![burst(Shape::Point, &[(0, n)])],
        ..Model::default()
    };
    let mut simulation = begin(&model, 2);
    let mut squares_after = |until: u32| {
        steps_until(&mut simulation, until);
        simulation.squares().collect::<Vec<f64>>()
    };
    let exact = |t: f64| 2.0 * (speed / rate).powi(2) * (rate * t - 1.0 + (-rate * t).exp());
    let mut rows = Vec::new();
    for steps in [10, 100, 1000] {
        let time = f64::from(steps) * 0.02;
        let (measured, error) = mean(squares_after(steps));
        rows.push(Row::new(format!("mean square way after {time} s"), exact(time), measured, 4.0 * error));
        if steps == 1000 {
            // The first lifetime is missing from 6Dt.
            let (d, by) = (speed * speed / rate / 3.0, 6.0 * (time - 1.0 / rate));
            rows.push(Row::new("D = v²τ/3", d, measured / by, 4.0 * error / by));
        }
    }
    rows.push(one_run_per_step());
    rows
}

/// The probability 1 − exp(−1) per step would give 8 % more than D = v²τ/3.
fn one_run_per_step() -> Row {
    let (n, speed, count) = (40_000_u32, 20.0, 200);
    let model = Model {
        time_step: 1.0,
        species: vec![Species { speed, tumble_rate: 1.0, ..species("A", 0.0, 0.0) }],
        transmitters: vec![burst(Shape::Point, &[(0, n)])],
        ..Model::default()
    };
    let simulation = run_for(&model, 4, count);
    let (measured, error) = mean(simulation.squares());
    // A run ends at each step with the probability 2/3, so the mean square displacement is v²Δt²(2n − 3/2).
    let by = 6.0 * f64::from(count) - 4.5;
    Row::new("D = v²τ/3, a tumble per step", speed * speed / 3.0, measured / by, 4.0 * error / by)
}

pub(crate) fn division() -> Vec<Row> {
    let (n, speed, diffusion, time_step, count) = (20_000, 4.0, 1.0, 0.01, 100);
    let parent_and_product = [
        (Species { speed, ..species("C", 0.0, 0.0) }, species("A", 0.0, diffusion)),
        (species("C", 0.0, 0.0), Species { speed, ..species("A", 0.0, 0.0) }),
    ];
    let row = |(parent, product): (Species, Species)| {
        let swims = product.speed > 0.0;
        // All but exp(-20) divide at the end of the first step.
        let decay = Decay { reactant: 0, products: [Some(1); 2], rate: 20.0 / time_step, ..Decay::default() };
        let model = Model {
            time_step,
            species: vec![parent, product],
            decays: vec![decay],
            transmitters: vec![burst(Shape::Point, &[(0, n)])],
            ..Model::default()
        };
        let simulation = run_for(&model, 3, count);
        let (measured, error) = mean(simulation.squares());
        let time = f64::from(count - 1) * time_step;
        if swims {
            let exact = (speed * time).powi(2);
            return Row::new("mean square way, swimmers of a resting one", exact, measured, 1e-4 * exact);
        }
        let exact = (speed * time_step).powi(2) + 6.0 * diffusion * time;
        Row::new("mean square way, offspring of swimmers", exact, measured, 4.0 * 2.0_f64.sqrt() * error)
    };
    parent_and_product.into_iter().map(row).collect()
}

/// Donors transfer at a rate γ to recipients in contact. These decrease as exp(−γ·n·(4/3)πρ³·t), with n donors per
/// volume.
pub(crate) fn conjugation() -> Vec<Row> {
    let (donors, recipients, side, contact, rate) = (800, 1000, 20.0_f64, 1.0_f64, 0.1);
    let swimmer = |name: &str| {
        format!("[[species]]\nname = \"{name}\"\nradius = {}\nspeed = 20\ntumble-rate = 1\n", contact / 2.0)
    };
    let text = format!(
        "time-step = 0.01\nsteps = 1\n[boundary]\nkind = \"periodic\"\nlow = [0, 0, 0]\nhigh = [20, 20, 20]\n{}{}{}\
         [[reaction]]\nequation = \"donor + recipient -> donor + reached\"\nrate-inside = {rate}\n\
         [[transmitter]]\nname = \"all\"\ncenter = [10, 10, 10]\n\
         shape = {{ kind = \"box\", size = [{side}, {side}, {side}] }}\nrelease = [\
         {{ species = \"donor\", count = {donors} }}, {{ species = \"recipient\", count = {recipients} }}]\n",
        swimmer("donor"),
        swimmer("recipient"),
        swimmer("reached")
    );
    let model = scenario(text);
    let times = [500, 1500];
    let run = |seed| {
        let mut simulation = begin(&model, seed);
        times.map(|until| {
            steps_until(&mut simulation, until);
            simulation.state().totals.present[1] as f64
        })
    };
    let runs: Vec<[f64; 2]> = (0..8).into_par_iter().map(run).collect();
    let per_time = rate * f64::from(donors) / side.powi(3) * 4.0 / 3.0 * PI * contact.powi(3);
    let row = |(index, until): (usize, u32)| {
        let time = f64::from(until) * 0.01;
        let expected = f64::from(recipients) * (-per_time * time).exp();
        Row::mean(format!("recipients left after {time} s"), expected, runs.iter().map(|run| run[index]))
    };
    times.into_iter().enumerate().map(row).collect()
}
