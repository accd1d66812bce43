use std::sync::Arc;

use lazygrid_sim::{Boundary, Flow, FlowField, Model, Shape};

use crate::Row;
use crate::setup::{burst, mean, run_for, species};

const N: u32 = 40_000;
const D: f64 = 1.0;

fn grid(half: f64, velocity: impl Fn([f64; 3]) -> [f64; 3]) -> Flow {
    let mut velocities = Vec::new();
    for index in 0..27_u32 {
        let point = [index / 9, index / 3 % 3, index % 3].map(|k| half * (f64::from(k) - 1.0));
        velocities.extend(velocity(point).map(|v| v as f32));
    }
    let field = FlowField::new([[-half; 3], [half; 3]], [3; 3], velocities);
    Flow::Field(Arc::new(field.expect("a field")))
}

fn model(flow: Flow, time_step: f64) -> Model {
    Model {
        time_step,
        species: vec![species("A", 0.0, D)],
        transmitters: vec![burst(Shape::Point, &[(0, N)])],
        flow: Some(flow),
        ..Model::default()
    }
}

fn products(model: &Model, count: u32, seed: u64, axes: &[[usize; 2]]) -> Vec<(f64, f64)> {
    let simulation = run_for(model, seed, count);
    let product = |[a, b]: [usize; 2]| mean(simulation.positions().map(|point| point[a] * point[b]));
    axes.iter().map(|&axes| product(axes)).collect()
}

/// A grid represents linear flows exactly. The steps need the second order.
pub(crate) fn flow_fields() -> Vec<Row> {
    let mut rows = Vec::new();
    let mut add = |what: &str, expected: f64, (found, error): (f64, f64)| {
        rows.push(Row::new(what, expected, found, 4.0 * error));
    };
    let (shear, time) = (2.0, 1.0);
    let shear_model = model(grid(100.0, |[_, y, _]| [shear * y, 0.0, 0.0]), 0.1);
    let found = products(&shear_model, 10, 1, &[[0, 0], [0, 1], [2, 2]]);
    add("shear, mean of x²", 2.0 * D * time + 2.0 / 3.0 * shear * shear * D * time.powi(3), found[0]);
    add("shear, mean of xy", shear * D * time * time, found[1]);
    add("shear, mean of z²", 2.0 * D * time, found[2]);
    let rate = 1.0;
    let extension = model(grid(100.0, |[x, y, _]| [rate * x, -rate * y, 0.0]), 0.1);
    let found = products(&extension, 15, 2, &[[0, 0], [1, 1]]);
    add("extension, mean of x²", D * libm::expm1(2.0 * rate * 1.5) / rate, found[0]);
    add("extension, mean of y²", -D * libm::expm1(-2.0 * rate * 1.5) / rate, found[1]);
    // A flow of −v along x between walls at 0 and w: the density is ∝ exp(−vx/D).
    let (v, w) = (3.0, 1.0);
    let mut column = model(grid(1.0, |_| [-v, 0.0, 0.0]), 0.02);
    column.boundary = Boundary::reflecting([0.0, -1.0, -1.0], [w as f32, 1.0, 1.0]);
    column.transmitters[0].center = [0.5, 0.0, 0.0];
    let simulation = run_for(&column, 3, 50);
    let heights: Vec<f64> = simulation.state().particles.position[0].iter().map(|&x| x.into()).collect();
    add("towards a wall, mean height", D / v - w / libm::expm1(v * w / D), mean(heights));
    rows
}
