use lazygrid_sim::{Model, Shape};

use crate::Row;
use crate::setup::{burst, run_for, species};

pub(crate) fn displacement() -> Vec<Row> {
    let (n, time_step, count) = (100_000, 0.01, 25);
    let mut drifting = species("drifting", 0.0, 2.0);
    drifting.drift = [3.0, -1.0, 0.5];
    let model = Model {
        time_step,
        species: vec![species("still", 0.0, 0.5), drifting],
        transmitters: vec![burst(Shape::Point, &[(0, n), (1, n)])],
        ..Model::default()
    };
    let simulation = run_for(&model, 1, count);
    let (time, particles) = (simulation.time(), &simulation.state().particles);
    let mut rows = Vec::new();
    for (index, species) in model.species.iter().enumerate() {
        let squares: Vec<f64> = (0..particles.len())
            .filter(|&at| particles.species[at] as usize == index)
            .map(|at| {
                let p = particles.position_of(at).map(f64::from);
                (0..3).map(|k| (p[k] - species.drift[k] * time).powi(2)).sum()
            })
            .collect();
        let unit = species.diffusion * time;
        let (n, name) = (f64::from(n).sqrt(), &species.name);
        let second = squares.iter().sum::<f64>() / squares.len() as f64;
        let fourth = squares.iter().map(|s| s * s).sum::<f64>() / squares.len() as f64;
        rows.push(Row::new(format!("6Dt, {name}"), 6.0 * unit, second, 4.0 * 24_f64.sqrt() * unit / n));
        let error = 11_520_f64.sqrt() * unit * unit / n;
        rows.push(Row::new(format!("60D²t², {name}"), 60.0 * unit * unit, fourth, 4.0 * error));
    }
    rows
}
