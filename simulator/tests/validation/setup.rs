use std::cell::OnceCell;
use std::path::Path;

use lazygrid::{Algorithm, Backend};
use lazygrid_sim::scenario::Scenario;
use lazygrid_sim::{
    AnySimulation, Arrival, Model, Particles, Receiver, ReceiverKind, RunView, Shape, Simulation, Species,
    State, Transmitter,
};

pub(crate) fn species(name: &str, radius: f32, diffusion: f64) -> Species {
    Species { name: name.to_owned(), radius, diffusion, mass: 1.0, ..Species::default() }
}

/// Tolerances follow the number of samples.
pub(crate) fn is_long() -> bool {
    std::env::var_os("LAZYGRID_TEST_FULL").is_some()
}

pub(crate) fn burst(shape: Shape, release: &[(u32, u32)]) -> Transmitter {
    Transmitter { name: "tx".to_owned(), shape, release: release.to_vec(), ..Transmitter::default() }
}

pub(crate) fn receiver(radius: f64, kind: ReceiverKind) -> Receiver {
    let name = "rx".to_owned();
    Receiver { name, radius: radius as f32, kind, sees: vec![true], ..Receiver::default() }
}

pub(crate) fn scenario(text: String) -> Model {
    Scenario::parse(Path::new("validation.toml"), text).expect("a scenario").model
}

pub(crate) fn backend() -> Backend {
    match std::env::var("LAZYGRID_TEST_BACKEND") {
        Ok(name) => name.parse().expect("a backend"),
        Err(_) => Backend::Cpu,
    }
}

pub(crate) struct BackendRun {
    run: AnySimulation,
    state: OnceCell<State>,
}

impl BackendRun {
    fn new(model: &Model, seed: u64, state: Option<State>) -> Self {
        let run = AnySimulation::begin(model, seed, backend(), Algorithm::Auto, state);
        Self { run: run.unwrap_or_else(|error| panic!("{error}")), state: OnceCell::new() }
    }

    pub(crate) fn state(&self) -> &State {
        match &self.run {
            AnySimulation::Cpu(run) => run.state(),
            #[cfg(feature = "gpu")]
            run => self.state.get_or_init(|| run.state().expect("a state").into_owned()),
        }
    }

    pub(crate) fn positions(&self) -> impl Iterator<Item = [f64; 3]> {
        let particles = &self.state().particles;
        (0..particles.len()).map(|at| particles.position_of(at).map(f64::from))
    }

    pub(crate) fn squares(&self) -> impl Iterator<Item = f64> {
        self.positions().map(|[x, y, z]| x * x + y * y + z * z)
    }

    pub(crate) fn received(&self) -> Vec<Vec<u64>> {
        self.run.received()
    }

    pub(crate) fn arrivals(&self) -> &[Arrival] {
        self.run.arrivals()
    }

    pub(crate) fn time(&self) -> f64 {
        f64::from(self.run.step_count()) * self.run.model().time_step
    }

    pub(crate) fn insert(&mut self, particles: &Particles) {
        let (model, seed) = (self.run.model().clone(), self.run.seed());
        let state = self.state().clone();
        let mut there =
            Simulation::resume(model.clone(), seed, Algorithm::Auto, state).expect("a valid state");
        there.insert(particles).expect("known species");
        *self = Self::new(&model, seed, Some(there.state().clone()));
    }
}

pub(crate) fn begin(model: &Model, seed: u64) -> BackendRun {
    BackendRun::new(model, seed, None)
}

pub(crate) fn steps(simulation: &mut BackendRun, count: u32) {
    let end = simulation.run.step_count() + count;
    while simulation.run.step_count() < end {
        simulation.run.advance(end - simulation.run.step_count()).expect("a step");
    }
    simulation.state.take();
}

pub(crate) fn run_for(model: &Model, seed: u64, count: u32) -> BackendRun {
    let mut simulation = begin(model, seed);
    steps(&mut simulation, count);
    simulation
}

pub(crate) fn steps_until(simulation: &mut BackendRun, step: u32) {
    steps(simulation, step - simulation.state().step);
}

pub(crate) fn mean(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.into_iter().collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

pub(crate) fn fraction_error(p: f64, n: f64) -> f64 {
    (p * (1.0 - p) / n).sqrt()
}

/// Probability that a normal variable of variance `v` per axis is in a ball of radius `r`, `d` from its mean.
pub(crate) fn in_ball(r: f64, d: f64, v: f64) -> f64 {
    let (s, erf) = ((2.0 * v).sqrt(), libm::erf);
    let bell = |x: f64| (-(x * x) / (2.0 * v)).exp();
    let tails = (v / (2.0 * std::f64::consts::PI)).sqrt() / d * (bell(r + d) - bell(r - d));
    0.5 * (erf((r - d) / s) + erf((r + d) / s)) + tails
}
