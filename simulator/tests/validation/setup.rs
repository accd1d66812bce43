use lazygrid::Algorithm;
use lazygrid_sim::{Model, Shape, Simulation, Species, Transmitter};

pub(crate) fn species(name: &str, radius: f32, diffusion: f64) -> Species {
    Species { name: name.to_owned(), radius, diffusion, mass: 1.0, ..Species::default() }
}

/// Returns `true` if `LAZYGRID_TEST_FULL` asks for more samples; tolerances follow their number.
pub(crate) fn is_long() -> bool {
    std::env::var_os("LAZYGRID_TEST_FULL").is_some()
}

pub(crate) fn burst(shape: Shape, release: &[(u32, u32)]) -> Transmitter {
    Transmitter { name: "tx".to_owned(), shape, release: release.to_vec(), ..Transmitter::default() }
}

pub(crate) fn begin(model: &Model, seed: u64) -> Simulation {
    Simulation::new(model.clone(), seed, Algorithm::Auto).expect("a valid model")
}

pub(crate) fn steps(simulation: &mut Simulation, count: u32) {
    (0..count).for_each(|_| simulation.step().expect("a step"));
}

pub(crate) fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

pub(crate) fn share_error(p: f64, n: f64) -> f64 {
    (p * (1.0 - p) / n).sqrt()
}

/// Probability that a normal variable of variance `v` per axis is in a ball of radius `r` whose center is `d` from the
/// mean.
pub(crate) fn in_ball(r: f64, d: f64, v: f64) -> f64 {
    let (s, erf) = ((2.0 * v).sqrt(), libm::erf);
    let bell = |x: f64| (-(x * x) / (2.0 * v)).exp();
    let tails = (v / (2.0 * std::f64::consts::PI)).sqrt() / d * (bell(r + d) - bell(r - d));
    0.5 * (erf((r - d) / s) + erf((r + d) / s)) + tails
}
