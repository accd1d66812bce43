use std::path::Path;

use lazygrid_sim::scenario::Scenario;
use lazygrid_sim::{Model, Particles};

use crate::Row;
use crate::setup::{begin, share_error, steps};

const RADIUS: f64 = 1.0;
const SPEED: f64 = 10.0;
const D: f64 = 1.0;
const N: u32 = 40_000;
const TIME_STEP: f64 = 0.01;

fn model(profile: &str) -> Model {
    let text = format!(
        "time-step = {TIME_STEP}\nsteps = 1\n[boundary]\nkind = \"cylinder\"\naxis = \"y\"\nradius = {RADIUS}\n\
         [flow]\nprofile = \"{profile}\"\nspeed = {SPEED}\n[[species]]\nname = \"A\"\ndiffusion = {D}\n\
         [[transmitter]]\nname = \"tx\"\nshape = {{ kind = \"cylinder\", axis = \"y\", radius = {RADIUS} }}\n\
         release = [{{ species = \"A\", count = {N} }}]\n"
    );
    Scenario::parse(Path::new("validation.toml"), text).expect("a scenario").model
}

const ZEROS: [f64; 6] = [3.831_706, 7.015_587, 10.173_468, 13.323_692, 16.470_630, 19.615_859];

/// Variance along a vessel after a release that is uniform across it. The flow at a particle is correlated with that a
/// time s before as v²·Σ (64/λ⁴)·exp(−λ²Ds/R²), so the limit is D(1 + v²R²/48D²) of Taylor and Aris.
fn taylor(time: f64) -> f64 {
    let term = |zero: f64| {
        let rate = zero * zero * D / (RADIUS * RADIUS);
        64.0 / zero.powi(4) * (time / rate + libm::expm1(-rate * time) / (rate * rate))
    };
    2.0 * D * time + 2.0 * SPEED * SPEED * ZEROS.into_iter().map(term).sum::<f64>()
}

/// Mean displacement by a flow that is on for 0.123 s, between the ends of steps.
fn pulse(profile: &str) -> Row {
    let mut model = model(profile);
    model.flow_pulse = Some([0.0642, 0.1872]);
    let mut simulation = begin(&model, 4);
    steps(&mut simulation, 30);
    let [[mean, error], _] = along(&simulation.state().particles);
    Row::new(format!("{profile}, mean after a pulse"), 0.123 * SPEED, mean, 4.0 * error)
}

fn along(particles: &Particles) -> [[f64; 2]; 2] {
    let n = particles.len() as f64;
    let y = || particles.position[1].iter().map(|&y| f64::from(y));
    let mean = y().sum::<f64>() / n;
    let moment = |power: i32| y().map(|y| (y - mean).powi(power)).sum::<f64>() / n;
    let variance = moment(2);
    let error = (moment(4) - variance * variance).sqrt() / n.sqrt();
    [[mean, (variance / n).sqrt()], [variance, error]]
}

pub(crate) fn flow_profiles() -> Vec<Row> {
    let mut rows = Vec::new();
    for (profile, variance) in [("plug", (|t| 2.0 * D * t) as fn(f64) -> f64), ("poiseuille", taylor)] {
        let mut simulation = begin(&model(profile), 3);
        for until in [10, 50, 300] {
            let done = simulation.state().step;
            steps(&mut simulation, until - done);
            let time = simulation.time();
            let [[mean, error], [spread, of_spread]] = along(&simulation.state().particles);
            rows.push(Row::new(format!("{profile}, mean after {time} s"), SPEED * time, mean, 4.0 * error));
            let what = format!("{profile}, variance after {time} s");
            rows.push(Row::new(what, variance(time), spread, 4.0 * of_spread));
        }
        rows.push(pulse(profile));
        let particles = &simulation.state().particles;
        let inside = |at: &usize| {
            let [x, _, z] = particles.position_of(*at).map(f64::from);
            x.hypot(z) < 0.9 * RADIUS
        };
        let share = (0..particles.len()).filter(inside).count() as f64 / f64::from(N);
        let what = format!("{profile}, share within 0.9 R");
        rows.push(Row::new(what, 0.81, share, 4.0 * share_error(0.81, N.into())));
    }
    rows
}
