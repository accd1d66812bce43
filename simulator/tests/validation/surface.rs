use std::collections::HashMap;

use crate::Row;
use crate::setup::{mean, run_for, scenario, steps};

const N: u32 = 20_000;
const RADIUS: f64 = 2.0;
const D: f64 = 0.5;

/// The mean Legendre polynomials of the cosine to the initial direction are exp(−2Dt/R²) and exp(−6Dt/R²).
pub(crate) fn surface_diffusion() -> Vec<Row> {
    let mut rows = Vec::new();
    for (seed, time_step, count) in [(1, 0.05, 40), (2, 0.5, 4), (3, 4.0, 1)] {
        let text = format!(
            "time-step = {time_step}\nsteps = 1\n[[species]]\nname = \"A\"\ndiffusion = 0.01\n[[transmitter]]\nname = \"tx\"\n\
             shape = {{ kind = \"ball\", inner-radius = {RADIUS}, radius = 2.1 }}\n\
             release = [{{ species = \"A\", count = {N} }}]\n[[receiver]]\nname = \"cell\"\ncenter = [0, 0, 0]\n\
             radius = {RADIUS}\nkind = \"receptors\"\ncount = {N}\nbinding-rate = 1000\nunbinding-rate = 1e-9\n\
             surface-diffusion = {D}\n"
        );
        let model = scenario(text);
        let mut simulation = run_for(&model, seed, (4.0 / time_step) as u32);
        let begun: HashMap<u32, [f32; 3]> =
            simulation.state().bound.iter().map(|bound| (bound.id, bound.direction)).collect();
        steps(&mut simulation, count);
        let cosine = |bound: &lazygrid_sim::motion::binding::Bound| {
            let before = begun.get(&bound.id)?;
            Some(before.iter().zip(bound.direction).map(|(a, b)| f64::from(a * b)).sum::<f64>())
        };
        let cosines: Vec<f64> = simulation.state().bound.iter().filter_map(cosine).collect();
        let decay = D * f64::from(count) * time_step / (RADIUS * RADIUS);
        let what = format!("mean cosine, {count} steps of {time_step} s, bound {}", cosines.len() > 10_000);
        rows.push(Row::mean(what, (-2.0 * decay).exp(), cosines.iter().copied()));
        let (found, error) = mean(cosines.iter().map(|w| 1.5 * w * w - 0.5));
        // The error of a step is of the third order in 2DΔt/R².
        let step = 2.0 * D * time_step / (RADIUS * RADIUS);
        if step < 0.5 {
            let tolerance = 4.0 * error + f64::from(count) * step.powi(3);
            rows.push(Row::new(
                format!("mean P₂, {count} steps of {time_step} s"),
                (-6.0 * decay).exp(),
                found,
                tolerance,
            ));
        }
    }
    rows
}
