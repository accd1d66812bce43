use lazygrid_sim::random::philox::{open_unit, philox};
use lazygrid_sim::{Adsorption, Boundary, Model, Receiver, ReceiverKind, Shape, Species, Transmitter};
use rayon::prelude::*;

use crate::Row;
use crate::setup::{
    begin, burst, in_ball, receiver, run_for, share_error, species, steps, steps_until,
};

const D: f64 = 100.0;
const R: f64 = 5.0;
const DISTANCE: f64 = 10.0;
const N: u32 = 200_000;

fn model(time_step: f64, kind: ReceiverKind) -> Model {
    let center = [DISTANCE as f32, 0.0, 0.0];
    Model {
        time_step,
        species: vec![species("A", 0.0, D)],
        transmitters: vec![burst(Shape::Point, &[(0, N)])],
        receivers: vec![Receiver { center, ..receiver(R, kind) }],
        ..Model::default()
    }
}

/// (r/d)·erfc((d − r)/√(4DT)) reach an absorbing sphere within T.
pub(crate) fn absorbing() -> Vec<Row> {
    let time = 0.5;
    let expected = R / DISTANCE * libm::erfc((DISTANCE - R) / (4.0 * D * time).sqrt());
    let tolerance = 4.0 * share_error(expected, N.into()) + 0.005 * expected;
    let mut rows = Vec::new();
    for kind in [ReceiverKind::Absorbing, ReceiverKind::Endpoint] {
        for count in [50, 200, 500] {
            let simulation = run_for(&model(time / f64::from(count), kind.clone()), 2, count);
            let share = simulation.state().totals.arrived[0][0] as f64 / f64::from(N);
            let what = format!("{kind:?}, {count} steps").to_lowercase();
            let must_differ = kind == ReceiverKind::Endpoint;
            rows.push(Row { must_differ, ..Row::new(what, expected, share, tolerance) });
        }
    }
    rows
}

/// Concentration, integrated over a transparent sphere.
pub(crate) fn transparent() -> Vec<Row> {
    let time_step = 0.01;
    let mut simulation = begin(&model(time_step, ReceiverKind::Transparent), 3);
    let mut rows = Vec::new();
    for until in [5, 20, 50] {
        steps_until(&mut simulation, until);
        let time = simulation.time();
        let expected = in_ball(R, DISTANCE, 2.0 * D * time);
        let share = simulation.received()[0][0] as f64 / f64::from(N);
        let what = format!("inside after {time} s");
        rows.push(Row::share(what, expected, share, N));
    }
    rows
}

/// Fraction in a flow v that ever reaches an absorbing sphere: with κ = v/2D, exp(−κr·cosθ)·Σ (2l +
/// 1)·iₗ(κR)·kₗ(κr)/kₗ(κR)·Pₗ(cosθ), θ from the flow; steps up to two radii.
pub(crate) fn absorbing_in_flow() -> Vec<Row> {
    let mut rows = vec![Row::new("the series, hardly a flow", 0.25, reached(1e-3, 4.0, 0.3), 0.002)];
    rows.extend([8, 32, 1600].map(|count| passing("from a flow", [FLOW, 0.0], count)));
    rows
}

pub(crate) const FLOW: f64 = 10.0;

pub(crate) fn passing(what: &str, [drift, velocity]: [f64; 2], count: u32) -> Row {
    let (start, n) = ([-4.0_f32, 1.0, 0.0], 40_000_u32);
    let distance = f64::from(start[0].hypot(start[1]));
    let expected = reached((drift - velocity) / 2.0, distance, f64::from(start[0]) / distance);
    let velocity = [velocity, 0.0, 0.0];
    let model = Model {
        time_step: 1.6 / f64::from(count),
        species: vec![Species { drift: [drift, 0.0, 0.0], ..species("A", 0.0, 1.0) }],
        transmitters: vec![Transmitter { center: start, ..burst(Shape::Point, &[(0, n)]) }],
        receivers: vec![Receiver { velocity, ..receiver(1.0, ReceiverKind::Absorbing) }],
        ..Model::default()
    };
    let simulation = run_for(&model, 5, count);
    let share = simulation.state().totals.arrived[0][0] as f64 / f64::from(n);
    Row::share(format!("{what}, {count} steps"), expected, share, n)
}

fn reached(kappa: f64, distance: f64, cosine: f64) -> f64 {
    const TERMS: usize = 60;
    // kₗ rises with l, so its recurrence is stable upwards, and that of iₗ downwards.
    let second = |x: f64| {
        let mut k = vec![1.0 / x, 1.0 / x + 1.0 / (x * x)];
        (1..TERMS).for_each(|l| k.push(k[l - 1] + (2 * l + 1) as f64 / x * k[l]));
        k
    };
    let mut first = vec![0.0; TERMS + 2];
    first[TERMS] = 1e-300;
    (1..=TERMS).rev().for_each(|l| first[l - 1] = first[l + 1] + (2 * l + 1) as f64 / kappa * first[l]);
    let scale = kappa.sinh() / kappa / first[0];
    let (near, far) = (second(kappa), second(kappa * distance));
    let (mut before, mut legendre, mut sum) = (0.0, 1.0, 0.0);
    for l in 0..TERMS {
        let order = (2 * l + 1) as f64;
        sum += order * scale * first[l] * far[l] / near[l] * legendre;
        (before, legendre) = (legendre, (order * cosine * legendre - l as f64 * before) / (l + 1) as f64);
    }
    // Factors exp(−x) of kₗ.
    (-kappa * distance * cosine - kappa * (distance - 1.0)).exp() * sum
}

pub(crate) fn long_steps() -> Vec<Row> {
    const CASES: u32 = 16;
    let n = 20_000_u32;
    let row = |case: u32| {
        let words = philox([case, 0, 0, 0], [33, 1]);
        let between = |low: f64, high: f64, word: u32| low + (high - low) * f64::from(open_unit(word));
        let (step, start) = (between(0.3, 4.0, words[0]), between(1.1, 4.0, words[1]));
        let count = 1 + words[2] % 12;
        let time_step = step * step / 2.0;
        let from = [0.0, start as f32, 0.0];
        let model = Model {
            time_step,
            species: vec![species("A", 0.0, 1.0)],
            transmitters: vec![Transmitter { center: from, ..burst(Shape::Point, &[(0, n)]) }],
            receivers: vec![receiver(1.0, ReceiverKind::Absorbing)],
            ..Model::default()
        };
        let simulation = run_for(&model, 40 + u64::from(case), count);
        let expected = libm::erfc((start - 1.0) / (4.0 * f64::from(count) * time_step).sqrt()) / start;
        let share = simulation.state().totals.arrived[0][0] as f64 / f64::from(n);
        Row::share(format!("from {start:.2} R in {count} steps of {step:.2} R"), expected, share, n)
    };
    (0..CASES).into_par_iter().map(row).collect()
}

const GAP: f64 = 0.1;

/// Two equal spheres adsorb equally from the same distance, and together as the method of images predicts.
pub(crate) fn neighbors() -> Vec<Row> {
    let kinds = [ReceiverKind::Absorbing, ReceiverKind::Partial(Adsorption::Reactivity(2.0))];
    let cases: Vec<_> = kinds.iter().flat_map(|kind| [0.25, 0.5, 1.0].map(|step| (kind, step))).collect();
    let (n, time, height) = (10_000_u32, 100.0, 1.5);
    let rows = |&(kind, step): &(&ReceiverKind, f64)| {
        let time_step = step * step / 2.0;
        let receiver = |sign: f64| Receiver {
            center: [(sign * (1.0 + GAP / 2.0)) as f32, 0.0, 0.0],
            ..receiver(1.0, kind.clone())
        };
        let model = Model {
            time_step,
            species: vec![species("A", 0.0, 1.0)],
            transmitters: vec![Transmitter {
                center: [0.0, height as f32, 0.0],
                ..burst(Shape::Point, &[(0, n)])
            }],
            receivers: vec![receiver(-1.0), receiver(1.0)],
            ..Model::default()
        };
        let simulation = run_for(&model, 8, (time / time_step) as u32);
        let [first, second] = [0, 1].map(|k| simulation.state().totals.arrived[k][0] as f64);
        let both = first + second;
        let name = if *kind == ReceiverKind::Absorbing { "absorbing" } else { "partial" };
        let what = format!("first of two, {name}, step {step} R");
        let mut rows = vec![Row::share(what, 0.5, first / both, both)];
        if *kind == ReceiverKind::Absorbing {
            let expected = reached_by_two(height, time);
            rows.push(Row::share(format!("both, step {step} R"), expected, both / f64::from(n), n));
        }
        rows
    };
    cases.par_iter().flat_map(rows).collect()
}

/// Fraction from the middle plane of two spheres, at a height above their line, that reaches one: the potential of both
/// at 1 is that of charges q and their images, q′ = −q/(d − a) at a′ = 1/(d − a). Later arrivals are those of a sphere
/// of the same capacity.
fn reached_by_two(height: f64, time: f64) -> f64 {
    let distance = 2.0 + GAP;
    let (mut charge, mut place, mut potential, mut capacity) = (1.0, 0.0, 0.0, 0.0);
    for _ in 0..400 {
        potential += 2.0 * charge / height.hypot(distance / 2.0 - place);
        capacity += 2.0 * charge;
        (charge, place) = (-charge / (distance - place), 1.0 / (distance - place));
    }
    potential - (1.0 - potential) * capacity / (std::f64::consts::PI * time).sqrt()
}

/// Steady density at a wall towards which particles drift: v/D, falling by exp(−vx/D).
pub(crate) fn drift_at_wall() -> Vec<Row> {
    let (n, layer, width) = (20_000_u32, 0.1_f32, 12.0_f32);
    let row = |&ratio: &f64| {
        let time_step = 2.0 * ratio * ratio;
        let model = Model {
            time_step,
            species: vec![Species { drift: [-1.0, 0.0, 0.0], ..species("A", 0.0, 1.0) }],
            transmitters: vec![Transmitter {
                center: [1.5, 0.0, 0.0],
                ..burst(Shape::Box([3.0, 1.0, 1.0]), &[(0, n)])
            }],
            boundary: Boundary::reflecting([0.0, -1.0, -1.0], [width, 1.0, 1.0]),
            ..Model::default()
        };
        let mut simulation = run_for(&model, 12, (12.0 / time_step).ceil() as u32);
        let mut shares = Vec::new();
        for _ in 0..8 {
            steps(&mut simulation, (3.0 / time_step).ceil() as u32);
            let particles = &simulation.state().particles;
            let near = particles.position[0].iter().filter(|&&x| x < layer).count();
            shares.push(near as f64 / f64::from(n));
        }
        let measured = shares.iter().sum::<f64>() / shares.len() as f64;
        let expected = -(-f64::from(layer)).exp_m1();
        Row::new(format!("share at a wall, vΔt = {ratio}·√(2DΔt)"), expected, measured, 0.02 * expected)
    };
    [0.1, 0.2, 1.0].par_iter().map(row).collect()
}
