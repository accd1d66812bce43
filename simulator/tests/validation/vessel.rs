use lazygrid_sim::{Axis, Boundary, Flow, Model, Particles, Shape, Transmitter, Vessel};

use crate::Row;
use crate::setup::{begin, burst, run_for, scenario, species, steps, steps_until};

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
    scenario(text)
}

const ZEROS: [f64; 6] = [3.831_706, 7.015_587, 10.173_468, 13.323_692, 16.470_630, 19.615_859];

/// Variance along a vessel. The flow at a particle is correlated with that a time s before as v²·Σ
/// (64/λ⁴)·exp(−λ²Ds/R²), so the limit is D(1 + v²R²/48D²) of Taylor and Aris.
fn taylor(time: f64) -> f64 {
    let term = |zero: f64| {
        let rate = zero * zero * D / (RADIUS * RADIUS);
        64.0 / zero.powi(4) * (time / rate + libm::expm1(-rate * time) / (rate * rate))
    };
    2.0 * D * time + 2.0 * SPEED * SPEED * ZEROS.into_iter().map(term).sum::<f64>()
}

/// The flow begins and ends within steps.
fn pulse(profile: &str) -> Row {
    let mut model = model(profile);
    model.flow_pulse = Some([0.0642, 0.1872]);
    let simulation = run_for(&model, 4, 30);
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
            steps_until(&mut simulation, until);
            let time = simulation.time();
            let [[mean, error], [spread, of_spread]] = along(&simulation.state().particles);
            rows.push(Row::new(format!("{profile}, mean after {time} s"), SPEED * time, mean, 4.0 * error));
            let what = format!("{profile}, variance after {time} s");
            rows.push(Row::new(what, variance(time), spread, 4.0 * of_spread));
        }
        rows.push(pulse(profile));
        let inside = simulation.positions().filter(|[x, _, z]| x.hypot(*z) < 0.9 * RADIUS).count();
        let what = format!("{profile}, fraction within 0.9 R");
        rows.push(Row::fraction(what, 0.81, inside as f64 / f64::from(N), N));
    }
    rows
}

/// The profile of Poiseuille flow is flat at the middle line of a wide vessel.
pub(crate) fn drift_at_ends() -> Vec<Row> {
    let (n, speed, diffusion, time_step, length) = (20_000, 100.0, 100.0, 0.01, 200.0);
    let row = |(what, flow, radius, sign): (&str, fn(f64) -> Flow, f32, f64)| {
        let end = if sign < 0.0 { 0.0 } else { length };
        let vessel = Some(Vessel { along: Some(2), center: [0.0; 3], radius });
        let axes = [Axis::Open, Axis::Open, Axis::Reflecting { low: 0.0, high: length as f32 }];
        let height = (diffusion / speed) as f32;
        let center = [0.0, 0.0, end as f32 - sign as f32 * height];
        let model = Model {
            time_step,
            species: vec![species("A", 0.0, diffusion)],
            flow: Some(flow(sign * speed)),
            transmitters: vec![Transmitter { center, ..burst(Shape::Point, &[(0, n)]) }],
            boundary: Boundary { axes, vessel },
            ..Model::default()
        };
        let mut simulation = begin(&model, 5);
        // The slowest relaxation time is 4D/v², four steps.
        steps(&mut simulation, 40);
        let mut heights = Vec::new();
        for _ in 0..4 {
            steps(&mut simulation, 20);
            heights
                .extend(simulation.state().particles.position[2].iter().map(|&z| (f64::from(z) - end).abs()));
        }
        Row::mean(format!("mean height, {what}"), diffusion / speed, heights)
    };
    let plug: fn(f64) -> Flow = |v| Flow::Plug([0.0, 0.0, v]);
    let poiseuille: fn(f64) -> Flow = |v| Flow::Poiseuille { mean: 0.5 * v };
    vec![
        row(("plug flow to the lower end", plug, 5.0, -1.0)),
        row(("plug flow to the upper end", plug, 5.0, 1.0)),
        row(("poiseuille flow to the upper end", poiseuille, 1e4, 1.0)),
    ]
}
