use lazygrid_sim::Model;

use crate::Row;
use crate::setup::{begin, mean, run_for, scenario, steps};

const N: u32 = 20_000;
const SPEED: f64 = 20.0;
const RATE: f64 = 1.0;

fn model(top: &str, attractant: &str, swimmer: &str, shape: &str) -> Model {
    let text = format!(
        "steps = 1\n{top}\n[[attractant]]\nname = \"food\"\nprofile = {attractant}\n[[species]]\nname = \"A\"\n{swimmer}\n\
         [[transmitter]]\nname = \"tx\"\n{shape}\nrelease = [{{ species = \"A\", count = {N} }}]\n"
    );
    scenario(text)
}

fn drift(dimensions: u32, alpha: f64, time_step: f64, seed: u64) -> (f64, f64) {
    let sensitivity = alpha / (0.01 * SPEED);
    let model = model(
        &format!("time-step = {time_step}\ndimensions = {dimensions}"),
        "{ kind = \"linear\", level = 1e6, gradient = [0.01, 0, 0] }",
        &format!(
            "speed = {SPEED}\ntumble-rate = {RATE}\nchemotaxis = {{ attractant = \"food\", sensitivity = {sensitivity} }}"
        ),
        "",
    );
    let mut simulation = begin(&model, seed);
    let positions = |time: f64| {
        steps(&mut simulation, (time / time_step).round() as u32);
        let mut ordered: Vec<_> = {
            let particles = &simulation.state().particles;
            particles.id.iter().zip(&particles.position[0]).map(|(&id, &x)| (id, f64::from(x))).collect()
        };
        ordered.sort_unstable_by_key(|&(id, _)| id);
        ordered
    };
    // Directions are stationary after ten runs, the longest of which last for exp(α)/λ₀.
    let [before, after] = [10.0 * alpha.abs().exp() / RATE, 10.0].map(positions);
    mean(before.iter().zip(&after).map(|((_, a), (_, b))| (b - a) / 10.0))
}

/// In one dimension with reflecting ends no flux remains, and both directions balance where p′ = p·λ₀·sinh(α)/v.
pub(crate) fn chemotaxis() -> Vec<Row> {
    let mut rows = Vec::new();
    let alpha = 0.4;
    let (found, error) = drift(3, alpha, 0.05, 1);
    let weak = SPEED * alpha / 3.0;
    // The next term of coth α − 1/α is −α³/45.
    rows.push(Row::new("weak gradient, χv²∇c/3", weak, found, 4.0 * error + weak * alpha * alpha / 15.0));
    for (seed, alpha, time_step) in [(2, 0.5, 0.05), (3, 1.5, 0.1), (4, 1.5, 0.05)] {
        let (found, error) = drift(3, alpha, time_step, seed);
        let expected = SPEED * (1.0 / f64::tanh(alpha) - 1.0 / alpha);
        rows.push(Row::new(format!("α = {alpha}, steps of {time_step} s"), expected, found, 4.0 * error));
    }
    let (found, error) = drift(1, -0.5, 0.1, 5);
    rows.push(Row::new("α = −0.5 in one dimension", -SPEED * f64::tanh(0.5), found, 4.0 * error));
    let [speed, peak, width, saturation, sensitivity] = [1.0, 3.0, 2.0, 1.0, 6.0];
    let model = model(
        "time-step = 0.1\ndimensions = 1\n[boundary]\nkind = \"reflecting\"\nlow = [-10, 0, 0]\nhigh = [10, 0, 0]",
        &format!("{{ kind = \"gaussian\", peak = {peak}, width = {width} }}"),
        &format!(
            "speed = {speed}\ntumble-rate = {RATE}\nchemotaxis = {{ attractant = \"food\", sensitivity = {sensitivity}, \
             half-saturation = {saturation} }}"
        ),
        "shape = { kind = \"box\", size = [20, 1, 1] }",
    );
    let slope = |x: f64| {
        let c = peak * (-x * x / (2.0 * width * width)).exp();
        let occupied = saturation / (saturation + c).powi(2) * -c * x / (width * width);
        RATE * (sensitivity * speed * occupied).sinh() / speed
    };
    let cells = 20_000;
    let (mut logarithm, mut near, mut all) = (0.0, 0.0, 0.0);
    for k in 0..cells {
        let x = 10.0 * (f64::from(k) + 0.5) / f64::from(cells);
        logarithm += slope(x) * 10.0 / f64::from(cells);
        all += f64::exp(logarithm);
        near += if x < width { f64::exp(logarithm) } else { 0.0 };
    }
    let simulation = run_for(&model, 6, 1500);
    let found =
        simulation.state().particles.position[0].iter().filter(|x| f64::from(x.abs()) < width).count();
    rows.push(Row::fraction("fraction within a width of a peak", near / all, found as f64 / f64::from(N), N));
    rows
}
