//! What receivers count.

use lazygrid_sim::{Model, Receiver, ReceiverKind, Shape, Species, Transmitter};

use crate::Row;
use crate::setup::{begin, burst, in_ball, share_error, species, steps};

const D: f64 = 100.0;
const R: f64 = 5.0;
const DISTANCE: f64 = 10.0;
const N: u32 = 200_000;

fn model(time_step: f64, kind: ReceiverKind) -> Model {
    let receiver = Receiver {
        name: "rx".to_owned(),
        center: [DISTANCE as f32, 0.0, 0.0],
        radius: R as f32,
        kind,
        sees: vec![true],
        ..Receiver::default()
    };
    Model {
        time_step,
        species: vec![species("A", 0.0, D)],
        transmitters: vec![burst(Shape::Point, &[(0, N)])],
        receivers: vec![receiver],
        ..Model::default()
    }
}

/// Share that reaches an absorbing sphere within T: (r/d)·erfc((d − r)/√(4DT)).
pub(crate) fn absorbing() -> Vec<Row> {
    let time = 0.5;
    let expected = R / DISTANCE * libm::erfc((DISTANCE - R) / (4.0 * D * time).sqrt());
    let tolerance = 4.0 * share_error(expected, N.into()) + 0.005 * expected;
    let mut rows = Vec::new();
    for kind in [ReceiverKind::Absorbing, ReceiverKind::Endpoint] {
        for count in [50, 200, 500] {
            let mut simulation = begin(&model(time / f64::from(count), kind), 2);
            steps(&mut simulation, count);
            let share = simulation.state().totals.arrived[0][0] as f64 / f64::from(N);
            let what = format!("{kind:?}, {count} steps").to_lowercase();
            let must_differ = kind == ReceiverKind::Endpoint;
            rows.push(Row { must_differ, ..Row::new(what, expected, share, tolerance) });
        }
    }
    rows
}

/// Share inside a transparent sphere after some times: the integral of the concentration over it.
pub(crate) fn transparent() -> Vec<Row> {
    let time_step = 0.01;
    let mut simulation = begin(&model(time_step, ReceiverKind::Transparent), 3);
    let mut rows = Vec::new();
    for until in [5, 20, 50] {
        let done = simulation.state().step;
        steps(&mut simulation, until - done);
        let time = simulation.time();
        let expected = in_ball(R, DISTANCE, 2.0 * D * time);
        let share = simulation.inside(0)[0] as f64 / f64::from(N);
        let what = format!("inside after {time} s");
        rows.push(Row::new(what, expected, share, 4.0 * share_error(expected, N.into())));
    }
    rows
}

/// Share of what a flow v carries past an absorbing sphere that ever reaches it. With κ = v/2D that is
/// exp(−κr·cosθ)·Σ (2l + 1)·iₗ(κR)·kₗ(κr)/kₗ(κR)·Pₗ(cosθ), θ from the direction of the flow; in steps in which the flow
/// goes up to two radii.
pub(crate) fn absorbing_in_flow() -> Vec<Row> {
    let mut rows = vec![Row::new("the series, hardly a flow", 0.25, reached(1e-3, 4.0, 0.3), 0.002)];
    rows.extend([8, 32, 1600].map(|count| passing("from a flow", [FLOW, 0.0], count)));
    rows
}

/// How fast particles and an absorbing sphere pass each other.
pub(crate) const FLOW: f64 = 10.0;

/// What the sphere takes where particles drift along x and it goes along x at these velocities.
pub(crate) fn passing(what: &str, [drift, velocity]: [f64; 2], count: u32) -> Row {
    let (start, n) = ([-4.0_f32, 1.0, 0.0], 40_000_u32);
    let distance = f64::from(start[0].hypot(start[1]));
    let expected = reached((drift - velocity) / 2.0, distance, f64::from(start[0]) / distance);
    let receiver = Receiver {
        name: "rx".to_owned(),
        radius: 1.0,
        kind: ReceiverKind::Absorbing,
        sees: vec![true],
        velocity: [velocity, 0.0, 0.0],
        ..Receiver::default()
    };
    let model = Model {
        time_step: 1.6 / f64::from(count),
        species: vec![Species { drift: [drift, 0.0, 0.0], ..species("A", 0.0, 1.0) }],
        transmitters: vec![Transmitter { center: start, ..burst(Shape::Point, &[(0, n)]) }],
        receivers: vec![receiver],
        ..Model::default()
    };
    let mut simulation = begin(&model, 5);
    steps(&mut simulation, count);
    let share = simulation.state().totals.arrived[0][0] as f64 / f64::from(n);
    Row::new(format!("{what}, {count} steps"), expected, share, 4.0 * share_error(expected, n.into()))
}

/// The series for a sphere of radius 1.
fn reached(kappa: f64, distance: f64, cosine: f64) -> f64 {
    const TERMS: usize = 60;
    // kₗ rises with l, so that its recurrence holds upwards, and that of iₗ downwards.
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
    // The factors exp(−x) of kₗ were left out.
    (-kappa * distance * cosine - kappa * (distance - 1.0)).exp() * sum
}
