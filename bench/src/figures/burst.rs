//! Figure 5: a burst of carriers of ten sizes from one point, driven by the simulator.

use std::error::Error;

use lazygrid::{Algorithm, Sphere};
use lazygrid_sim::{Model, Simulation, Species, Transmitter};

use super::Engine;
use super::plan::Point;
use super::race::{Limits, Race};
use super::row::Row;

/// What is simulated, for the report.
pub(super) const DESCRIPTION: &str = "One transmitter releases carriers of ten radii, 10 to 100 nm in equal numbers, from \
    one point into unbounded water of 37 °C, where they diffuse as Stokes and Einstein say; a step is 10 ms. The \
    simulator moves them; from each moment on every engine finds the pairs of the same consecutive steps, the first of \
    which brings its structure up to date and does not count. Times are of the search alone, on all threads.";

/// Simulated seconds at which engines are timed.
const MOMENTS: [f64; 5] = [0.1, 0.3, 1.0, 3.0, 10.0];
/// Simulated seconds of a step.
const STEP: f64 = 0.01;
/// Diffusion coefficient in µm²/s of a sphere of 1 µm: k·T / 6πη with water's η = 0.69 mPa·s at 310 K.
const STOKES_EINSTEIN: f64 = 0.329;

/// The rows of every moment at which the engines are timed.
pub(super) fn rows(
    point: &Point,
    limits: Limits,
    seed: u64,
    left_out: impl Fn(Engine) -> Option<String>,
) -> Result<Vec<Row>, Box<dyn Error>> {
    let mut simulation = Simulation::new(model(point.n), seed, Algorithm::Auto)?;
    let mut race = Race::new(point, Limits { time: limits.time / MOMENTS.len() as u32, ..limits }, left_out);
    let mut rows = vec![];
    for moment in MOMENTS {
        // Half a step, as steps add up with rounding.
        while simulation.time() < moment - 0.5 * STEP {
            simulation.step()?;
        }
        let mut warm_up = true;
        while !race.is_over() {
            race.frame(&spheres(&simulation), warm_up)?;
            simulation.step()?;
            warm_up = false;
        }
        rows.extend(race.take_rows(Some(moment)));
    }
    Ok(rows)
}

/// `n` carriers, rounded down to a multiple of ten, that diffuse and do nothing else.
fn model(n: usize) -> Model {
    let sizes = 1..=10_u32;
    let species = |size: u32| {
        let radius = 0.01 * f64::from(size);
        Species {
            name: format!("carrier-{size}"),
            radius: radius as f32,
            diffusion: STOKES_EINSTEIN / radius,
            mass: 1.0,
            ..Species::default()
        }
    };
    let transmitter = Transmitter {
        name: "transmitter".to_owned(),
        center: [0.0; 3],
        shape: lazygrid_sim::Shape::Point,
        times: vec![0.0],
        release: sizes.clone().map(|size| (size - 1, (n / 10) as u32)).collect(),
    };
    Model {
        time_step: STEP,
        species: sizes.map(species).collect(),
        transmitters: vec![transmitter],
        ..Model::default()
    }
}

/// The carriers as they are now. None is ever removed, so each keeps its place.
fn spheres(simulation: &Simulation) -> Vec<Sphere> {
    let particles = &simulation.state().particles;
    (0..particles.len()).map(|k| Sphere::new(particles.position_of(k), particles.radius[k])).collect()
}
