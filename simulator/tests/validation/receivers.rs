use lazygrid_sim::random::philox::{open_unit, philox};
use lazygrid_sim::{Adsorption, Boundary, Model, Receiver, ReceiverKind, Shape, Species, Transmitter};
use rayon::prelude::*;

use crate::Row;
use crate::setup::{begin, burst, fraction_error, in_ball, receiver, run_for, species, steps, steps_until};

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

pub(crate) fn absorbing() -> Vec<Row> {
    let time = 0.5;
    let expected = R / DISTANCE * libm::erfc((DISTANCE - R) / (4.0 * D * time).sqrt());
    let tolerance = 4.0 * fraction_error(expected, N.into()) + 0.005 * expected;
    let mut rows = Vec::new();
    for kind in [ReceiverKind::Absorbing, ReceiverKind::Endpoint] {
        for count in [50, 200, 500] {
            let simulation = run_for(&model(time / f64::from(count), kind.clone()), 2, count);
            let fraction = simulation.state().totals.arrived[0][0] as f64 / f64::from(N);
            let what = format!("{kind:?}, {count} steps").to_lowercase();
            let must_differ = kind == ReceiverKind::Endpoint;
            rows.push(Row { must_differ, ..Row::new(what, expected, fraction, tolerance) });
        }
    }
    rows
}

pub(crate) fn transparent() -> Vec<Row> {
    let time_step = 0.01;
    let mut simulation = begin(&model(time_step, ReceiverKind::Transparent), 3);
    let mut rows = Vec::new();
    for until in [5, 20, 50] {
        steps_until(&mut simulation, until);
        let time = simulation.time();
        let expected = in_ball(R, DISTANCE, 2.0 * D * time);
        let fraction = simulation.received()[0][0] as f64 / f64::from(N);
        let what = format!("inside after {time} s");
        rows.push(Row::fraction(what, expected, fraction, N));
    }
    rows
}

/// In a flow v with κ = v/2D, the fraction exp(−κr·cosθ)·Σ (2l + 1)·iₗ(κR)·kₗ(κr)/kₗ(κR)·Pₗ(cosθ) ever reaches the
/// sphere, θ from the flow.
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
    let fraction = simulation.state().totals.arrived[0][0] as f64 / f64::from(n);
    Row::fraction(format!("{what}, {count} steps"), expected, fraction, n)
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
        let fraction = simulation.state().totals.arrived[0][0] as f64 / f64::from(n);
        Row::fraction(format!("from {start:.2} R in {count} steps of {step:.2} R"), expected, fraction, n)
    };
    (0..CASES).into_par_iter().map(row).collect()
}

/// Two spheres of radius 1, and a release between them.
#[derive(Clone, Debug)]
struct Neighbors {
    kind: ReceiverKind,
    /// √(2DΔt).
    step: f64,
    gap: f64,
    /// Height of the release above the line of both.
    height: f64,
}

/// Both spheres adsorb equally, and together as the method of images predicts.
pub(crate) fn neighbors() -> Vec<Row> {
    let kinds = [ReceiverKind::Absorbing, ReceiverKind::Partial(Adsorption::Reactivity(2.0))];
    let fixed = |kind: &ReceiverKind| {
        let kind = kind.clone();
        [0.25, 0.5, 1.0].map(|step| Neighbors { kind: kind.clone(), step, gap: 0.1, height: 1.5 })
    };
    let drawn = |case: u32| {
        let words = philox([case, 0, 0, 0], [31, 1]);
        let between = |low: f64, high: f64, word: u32| low + (high - low) * f64::from(open_unit(word));
        Neighbors {
            kind: kinds[case as usize % 2].clone(),
            step: between(0.2, 1.0, words[0]),
            gap: between(0.02, 2.0, words[1]),
            height: between(0.5, 3.0, words[2]),
        }
    };
    let cases: Vec<_> = kinds.iter().flat_map(fixed).chain((0..8).map(drawn)).collect();
    cases.par_iter().flat_map(|case| case.rows()).collect()
}

impl Neighbors {
    fn rows(&self) -> Vec<Row> {
        let Self { ref kind, step, gap, height } = *self;
        let (n, time, time_step) = (10_000_u32, 100.0, step * step / 2.0);
        let receiver = |sign: f64| Receiver {
            center: [(sign * (1.0 + gap / 2.0)) as f32, 0.0, 0.0],
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
        let case = format!("{gap:.2} R apart, step {step:.2} R");
        let mut rows = vec![Row::fraction(format!("first, {name}, {case}"), 0.5, first / both, both)];
        if *kind == ReceiverKind::Absorbing {
            let expected = reached_by_two((gap, height), time);
            rows.push(Row::fraction(format!("both, {case}"), expected, both / f64::from(n), n));
        }
        rows
    }
}

/// The potential of both spheres at 1 is that of charges q and their images, q′ = −q/(d − a) at a′ = 1/(d − a). Later
/// arrivals are those of a sphere of the same capacity.
fn reached_by_two((gap, height): (f64, f64), time: f64) -> f64 {
    let distance = 2.0 + gap;
    let (mut charge, mut position, mut potential, mut capacity) = (1.0, 0.0, 0.0, 0.0);
    for _ in 0..400 {
        potential += 2.0 * charge / height.hypot(distance / 2.0 - position);
        capacity += 2.0 * charge;
        (charge, position) = (-charge / (distance - position), 1.0 / (distance - position));
    }
    potential - (1.0 - potential) * capacity / (std::f64::consts::PI * time).sqrt()
}

/// Steady density at a wall towards which particles drift: v/D, falling by exp(−vx/D).
pub(crate) fn drift_at_wall() -> Vec<Row> {
    let fixed = [0.1, 0.2, 1.0];
    let fixed = fixed.map(|ratio| DriftAtWall { ratio, layer: 0.1, axis: 0, is_high: false, n: 20_000 });
    // A fraction of a tenth has a standard error of 0.3 % in eight independent counts of 100,000 particles.
    let drawn = |case: u32| {
        let words = philox([case, 0, 0, 0], [32, 1]);
        let units = words.map(|word| f64::from(open_unit(word)));
        DriftAtWall {
            ratio: 0.1 * 20_f64.powf(units[0]),
            layer: 0.1 + 0.9 * units[1],
            axis: words[2] as usize % 3,
            is_high: words[3].is_multiple_of(2),
            n: 100_000,
        }
    };
    let cases: Vec<_> = fixed.into_iter().chain((0..6).map(drawn)).collect();
    cases.par_iter().map(DriftAtWall::row).collect()
}

/// Drift and diffusion are 1.
#[derive(Clone, Copy, Debug)]
struct DriftAtWall {
    /// Drift of a step over √(2DΔt).
    ratio: f64,
    /// Thickness of the counted layer at the wall.
    layer: f64,
    axis: usize,
    is_high: bool,
    n: u32,
}

impl DriftAtWall {
    fn row(&self) -> Row {
        let Self { ratio, layer, axis, is_high, n } = *self;
        let (time_step, width) = (2.0 * ratio * ratio, 12.0_f32);
        let sign = if is_high { 1.0 } else { -1.0 };
        let along = |x: f32, others: f32| std::array::from_fn(|k| if k == axis { x } else { others });
        let center = along(if is_high { width - 1.5 } else { 1.5 }, 0.0);
        let drift = along(sign, 0.0).map(f64::from);
        let model = Model {
            time_step,
            species: vec![Species { drift, ..species("A", 0.0, 1.0) }],
            transmitters: vec![Transmitter { center, ..burst(Shape::Box(along(3.0, 1.0)), &[(0, n)]) }],
            boundary: Boundary::reflecting(along(0.0, -1.0), along(width, 1.0)),
            ..Model::default()
        };
        let mut simulation = run_for(&model, 12, (12.0 / time_step).ceil() as u32);
        let is_near = |x: f32| f64::from(if is_high { width - x } else { x }) < layer;
        let mut fractions = Vec::new();
        for _ in 0..8 {
            steps(&mut simulation, (3.0 / time_step).ceil() as u32);
            let particles = &simulation.state().particles;
            let near = particles.position[axis].iter().filter(|&&x| is_near(x)).count();
            fractions.push(near as f64 / f64::from(n));
        }
        let measured = fractions.iter().sum::<f64>() / fractions.len() as f64;
        let expected = -(-layer).exp_m1();
        let what = format!("fraction within {layer:.2} of a wall, vΔt = {ratio:.2}·√(2DΔt)");
        Row::new(what, expected, measured, 0.02 * expected)
    }
}
