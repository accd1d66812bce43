//! Figure 5: a burst of carriers of ten sizes from one point, driven by the simulator.

use std::error::Error;
use std::path::Path;

use lazygrid::{Algorithm, Sphere};
use lazygrid_sim::scenario::Scenario;
use lazygrid_sim::{Contact, Model, Simulation};

use super::Engine;
use super::plan::Point;
use super::race::{Limits, Race};
use super::row::Row;

/// The scenario that `lazygrid simulate` runs too.
const SCENARIO: &str = include_str!("../../../simulator/scenarios/burst.toml");
const NAME: &str = "simulator/scenarios/burst.toml";

/// What is simulated, for the report.
pub(super) const DESCRIPTION: &str = "The scenario is simulator/scenarios/burst.toml without its receiver: one transmitter \
    releases carriers of ten radii, 1 to 10 nm in equal numbers, from one point into unbounded water of 25 °C, where \
    they diffuse as Stokes and Einstein say. The simulator takes them from moment to moment as free carriers, whose \
    diffusion is exact in steps of any length. From each moment on they push each other apart, in steps of 2 ns, in \
    which the smallest move about their radius along each axis, so that what keeps a structure from step to step can \
    profit from it; every engine finds the pairs of the same consecutive steps. The first of them brings its structure \
    up to date and does not count. Times are of the search alone, on all threads, but for N3Sim's sweep, which has one.";

/// Simulated seconds at which engines are timed: from dozens of pairs per carrier to none, where carriers are most.
const MOMENTS: [f64; 5] = [200e-6, 500e-6, 2e-3, 10e-3, 50e-3];
/// Steps from one moment to the next.
const STEPS: u32 = 10;
/// Simulated seconds of a step while engines are timed: √(2·D·t) of a carrier of 1 nm and 245 µm²/s is 0.99 nm.
const FINE_STEP: f64 = 2e-9;

/// The rows of every moment at which the engines are timed.
pub(super) fn rows(
    point: &Point,
    limits: Limits,
    seed: u64,
    left_out: impl Fn(Engine) -> Option<String>,
) -> Result<Vec<Row>, Box<dyn Error>> {
    let model = model(point.n)?;
    let mut race = Race::new(
        point,
        Limits {
            time: limits.time / MOMENTS.len() as u32,
            in_all: limits.in_all / MOMENTS.len() as u32,
            ..limits
        },
        left_out,
    );
    let (mut state, mut time, mut rows) = (None, 0.0, vec![]);
    for moment in MOMENTS {
        let step = (moment - time) / f64::from(STEPS);
        let free = Model { time_step: step, contact: Contact::Ignore, ..model.clone() };
        let mut simulation = match state {
            None => Simulation::new(free, seed, Algorithm::Auto)?,
            Some(state) => Simulation::resume(free, seed, Algorithm::Auto, state)?,
        };
        (0..STEPS).try_for_each(|_| simulation.step())?;
        let fine = Model { time_step: FINE_STEP, contact: Contact::Separate, ..model.clone() };
        let mut timed = Simulation::resume(fine, seed, Algorithm::Auto, simulation.state().clone())?;
        (state, time) = (Some(simulation.state().clone()), moment);
        let mut warm_up = true;
        while !race.is_over() {
            race.frame(&spheres(&timed), warm_up)?;
            timed.step()?;
            warm_up = false;
        }
        rows.extend(race.take_rows(Some(moment)));
    }
    Ok(rows)
}

/// The scenario with `n` carriers, rounded down to a multiple of ten.
fn model(n: usize) -> Result<Model, Box<dyn Error>> {
    let mut model = Scenario::parse(Path::new(NAME), SCENARIO.to_owned())?.model;
    // It would take carriers away, whose places in the list others would get.
    model.receivers.clear();
    for transmitter in &mut model.transmitters {
        let sizes = transmitter.release.len().max(1);
        transmitter.release.iter_mut().for_each(|(_, count)| *count = (n / sizes) as u32);
    }
    Ok(model)
}

/// The carriers as they are now. None is ever removed, so each keeps its place.
fn spheres(simulation: &Simulation) -> Vec<Sphere> {
    let particles = &simulation.state().particles;
    (0..particles.len()).map(|k| Sphere::new(particles.position_of(k), particles.radius[k])).collect()
}
