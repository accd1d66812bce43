use lazygrid_sim::{Model, Receiver, ReceiverKind};

use crate::Row;
use crate::setup::{begin, mean, receiver, run_for, scenario, steps};

const N: u32 = 40_000;
const D: f64 = 1.0;

fn model(time_step: f64, boundary: &str, drift: f64, center: &str, faces: &[&str]) -> Model {
    let face = |face: &&str| format!("[[receiver]]\nname = \"{face}\"\nkind = \"wall\"\nface = \"{face}\"\n");
    let text = format!(
        "time-step = {time_step}\nsteps = 1\n[boundary]\n{boundary}\n[[species]]\nname = \"A\"\ndiffusion = {D}\n\
         drift = [{drift}, 0, 0]\n[[transmitter]]\nname = \"tx\"\ncenter = {center}\n\
         release = [{{ species = \"A\", count = {N} }}]\n{}",
        faces.iter().map(face).collect::<String>()
    );
    scenario(text)
}

fn reflecting_sphere(distance: f32, radius: f32) -> Receiver {
    let center = [distance + radius, 0.0, 0.0];
    Receiver { center, ..receiver(radius.into(), ReceiverKind::Reflecting) }
}

fn taken(model: &Model, count: u32, receiver: usize, seed: u64) -> f64 {
    let simulation = run_for(model, seed, count);
    simulation.received()[receiver][0] as f64 / f64::from(N)
}

/// The mean cosine decays by the first mode without symmetry, and the density becomes uniform.
pub(crate) fn inside_a_sphere() -> Vec<Row> {
    let mut rows = Vec::new();
    let boundary = "kind = \"sphere\"\nradius = 1";
    for (seed, time_step, time) in [(1, 1e-3, 0.05_f64), (2, 0.02, 0.1), (3, 0.1, 0.1), (4, 0.1, 0.2)] {
        let count = (time / time_step).round() as u32;
        let sphere = model(time_step, boundary, 0.0, "[0, 0, 0]", &["side"]);
        let mode = |n: i32| {
            let rate = (f64::from(n) * std::f64::consts::PI).powi(2) * D;
            2.0 * f64::from(1 - 2 * (n % 2)) * (-rate * time).exp()
        };
        let expected = 1.0 + (1..20).map(mode).sum::<f64>();
        let what = format!("absorbs until {time} s, steps of {time_step} s");
        rows.push(Row::fraction(what, expected, taken(&sphere, count, 0, seed), N));
    }
    // From x = 0.5 in small steps. The first mode is j₁(kr)·cos θ, with the zero k = 2.0816 of j₁′.
    let [k, start]: [f64; 2] = [2.081_576, 0.5];
    let first = |x: f64| x.sin() / (x * x) - x.cos() / x;
    let mut simulation = begin(&model(1e-3, boundary, 0.0, "[0.5, 0, 0]", &[]), 5);
    let mut mean_mode = || {
        steps(&mut simulation, 100);
        let mode = |[x, y, z]: [f64; 3]| {
            let r = (x * x + y * y + z * z).sqrt();
            first(k * r) * x / r
        };
        (mean(simulation.positions().map(mode)), simulation.time())
    };
    for _ in 0..3 {
        let ((found, error), time) = mean_mode();
        let expected = first(k * start) * (-k * k * D * time).exp();
        rows.push(Row::new(format!("reflects, first mode after {time:.1} s"), expected, found, 4.0 * error));
    }
    let long = model(0.05, boundary, 0.0, "[0.5, 0, 0]", &[]);
    let simulation = run_for(&long, 6, 100);
    let particles = &simulation.state().particles;
    let far = |at: &usize| particles.position_of(*at).iter().map(|x| x * x).sum::<f32>() > 0.81;
    let found = (0..particles.len()).filter(far).count() as f64 / f64::from(N);
    rows.push(Row::fraction("reflects, fraction beyond 0.9 R", 0.271, found, N));
    rows
}

fn legendre(x: f64) -> Vec<f64> {
    let mut all = vec![1.0, x];
    for l in 1..41 {
        let k = l as f64;
        all.push(((2.0 * k + 1.0) * x * all[l] - k * all[l - 1]) / (k + 1.0));
    }
    all
}

pub(crate) fn absorbing_walls() -> Vec<Row> {
    let mut rows = Vec::new();
    let mut add = |what: String, expected: f64, found: f64| {
        rows.push(Row::fraction(what, expected, found, N));
    };
    let normal = |x: f64| 0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2);
    let box_of = |width: f64| format!("kind = \"reflecting\"\nlow = [0, -50, -50]\nhigh = [{width}, 50, 50]");
    // First passage of Brownian motion with drift.
    for (seed, spread, drift) in
        [(1, 0.1_f64, 0.0), (2, 0.7, 0.0), (3, 2.0, 0.0), (4, 0.3, -1.0), (5, 1.5, -0.5), (6, 0.5, 0.5)]
    {
        let time_step = spread * spread / (2.0 * D);
        let count = (1.0 / time_step).ceil() as u32;
        let (time, s) = (f64::from(count) * time_step, (2.0 * D * f64::from(count) * time_step).sqrt());
        let expected =
            normal((-1.0 - drift * time) / s) + (-drift / D).exp() * normal((-1.0 + drift * time) / s);
        let model = model(time_step, &box_of(60.0), drift, "[1, 0, 0]", &["low-x"]);
        add(format!("plane, steps of {spread}, drift {drift}"), expected, taken(&model, count, 0, seed));
    }
    // The survival in a slit of width 2, from a quarter.
    let slit = model(2e-4, &box_of(2.0), 0.0, "[0.5, 0, 0]", &["low-x", "high-x"]);
    let survival: f64 = (0..40)
        .map(|k| {
            let n = f64::from(2 * k + 1) * std::f64::consts::PI;
            4.0 / n * (n / 4.0).sin() * (-n * n / 4.0 * D * 0.2).exp()
        })
        .sum();
    let both = taken(&slit, 1000, 0, 7) + taken(&slit, 1000, 1, 7);
    add("slit, both planes".to_owned(), 1.0 - survival, both);
    for (seed, start, count) in [(11, 0.4, 1), (12, 0.25, 1), (13, 0.25, 5)] {
        let mut model = model(0.045, &box_of(3000.0), 0.0, &format!("[{start}, 0, 0]"), &["low-x"]);
        model.receivers.push(reflecting_sphere(0.5, 1000.0));
        let mode = |n: u32| {
            let k = f64::from(2 * n + 1) * std::f64::consts::PI;
            4.0 / k * (k * start).sin() * (-k * k * D * 0.045 * f64::from(count)).exp()
        };
        let expected = 1.0 - (0..40).map(mode).sum::<f64>();
        add(format!("slit, sphere, {count} steps from {start}"), expected, taken(&model, count, 0, seed));
    }
    // From the middle line of a cylinder of radius 1: Σ 2/(j·J₁(j))·exp(−j²Dt), with the zeros j of J₀.
    let zeros =
        [(2.404_826, 0.519_147), (5.520_078, -0.340_265), (8.653_728, 0.271_452), (11.791_534, -0.232_460)];
    for (seed, time_step, time) in [(8, 2e-4, 0.1), (9, 2e-4, 0.3), (10, 1e-3, 0.3)] {
        let cylinder = model(time_step, "kind = \"cylinder\"\nradius = 1", 0.0, "[0, 0, 0]", &["side"]);
        let survival: f64 =
            zeros.iter().map(|(j, of_j): &(f64, f64)| 2.0 / (j * of_j) * (-j * j * D * time).exp()).sum();
        let count = (time / time_step).round() as u32;
        add(
            format!("cylinder after {time} s, steps of {time_step} s"),
            1.0 - survival,
            taken(&cylinder, count, 0, seed),
        );
    }
    rows.push(hemisphere_on_a_plane());
    rows
}

/// From the distance r = 2 µm, at 45°, a hemisphere of 1 µm takes the fraction Σ over odd l of
/// (P(l − 1, 0) − P(l + 1, 0))·P(l, cos 45°)/r^(l + 1), with Legendre polynomials. After 20 s, 0.5 % of it are missing.
fn hemisphere_on_a_plane() -> Row {
    let (at, spread, n) = (std::f64::consts::SQRT_2, 0.35_f64, 2 * N);
    let time_step = spread * spread / (2.0 * D);
    let boundary = "kind = \"reflecting\"\nlow = [0, -3e3, -3e3]\nhigh = [3e3, 3e3, 3e3]";
    let mut model = model(time_step, boundary, 0.0, &format!("[{at}, {at}, 0]"), &["low-x"]);
    model.transmitters[0].release[0].1 = n;
    model.receivers.push(receiver(1.0, ReceiverKind::Absorbing));
    let [still, rotated] = [0.0, 0.5 * at].map(legendre);
    let term = |l: usize| (still[l - 1] - still[l + 1]) * 0.5_f64.powi(l as i32 + 1) * rotated[l];
    let expected = (1..40).step_by(2).map(term).sum();
    let found = taken(&model, (20.0 / time_step) as u32, 1, 14) * f64::from(N) / f64::from(n);
    Row::fraction(format!("hemisphere on the plane, steps of {spread}"), expected, found, n)
}
