use lazygrid_sim::model::receiver::WallFace;
use lazygrid_sim::{Boundary, Membrane, MembraneSurface, Model, Receiver, ReceiverKind, Shape, Transmitter};
use rayon::prelude::*;

use crate::Row;
use crate::setup::{self, receiver, run_for, scenario, species};

const N: u32 = 40_000;
const D: f64 = 1.0;

fn model(time_step: f64, boundary: &str, permeability: f64, transmitter: &str) -> Model {
    let text = format!(
        "time-step = {time_step}\nsteps = 1\n{boundary}\n[[species]]\nname = \"A\"\ndiffusion = {D}\n\
         [[membrane]]\nname = \"m\"\naxis = \"x\"\nposition = 0\npermeability = {permeability}\n\
         [[transmitter]]\nname = \"tx\"\n{transmitter}\n"
    );
    scenario(text)
}

fn burst(center: f64, shape: &str) -> String {
    format!("center = [{center}, 0, 0]\nshape = {shape}\nrelease = [{{ species = \"A\", count = {N} }}]")
}

fn fraction(model: &Model, count: u32, seed: u64, [low, high]: [f32; 2]) -> f64 {
    let simulation = run_for(model, seed, count);
    let x = &simulation.state().particles.position[0];
    x.iter().filter(|x| (low..high).contains(*x)).count() as f64 / x.len() as f64
}

/// N-th zero of μ·tan μ − b.
fn zero(n: u32, b: f64) -> f64 {
    let from = f64::from(n) * std::f64::consts::PI;
    let [mut low, mut high] = [from, from + 0.5 * std::f64::consts::PI];
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if middle * middle.sin() < b * middle.cos() { low = middle } else { high = middle }
    }
    low
}

pub(crate) fn membranes() -> Vec<Row> {
    let mut rows = Vec::new();
    let mut add = |what: String, expected: f64, found: f64| {
        rows.push(Row::fraction(what, expected, found, N));
    };
    // The difference of both halves is that of a plate which loses heat at one face, with b = 2κw/D (Carslaw and
    // Jaeger, *Conduction of Heat in Solids*, section 3.11).
    let halves = "[boundary]\nkind = \"reflecting\"\nlow = [-1, -50, -50]\nhigh = [1, 50, 50]";
    for (seed, spread, permeability, time) in [
        (1, 0.05_f64, 0.5, 0.3),
        (2, 0.05, 0.5, 1.0),
        (3, 0.3, 0.5, 1.0),
        (4, 0.3, 5.0, 0.3),
        (5, 0.5, 0.5, 1.0),
    ] {
        let count = (2.0 * D * time / (spread * spread)).round() as u32;
        let time_step = time / f64::from(count);
        let b = 2.0 * permeability / D;
        let mode = |n: u32| {
            let mu = zero(n, b);
            2.0 * b * b / (mu * mu * (mu * mu + b * b + b)) * (-mu * mu * D * time).exp()
        };
        let expected = 0.5 * (1.0 - (0..20).map(mode).sum::<f64>());
        let model =
            model(time_step, halves, permeability, &burst(-0.5, "{ kind = \"box\", size = [1, 1, 1] }"));
        let what = format!("κ = {permeability}, passed in {time} s, steps of {spread}");
        add(what, expected, fraction(&model, count, seed, [0.0, 2.0]));
    }
    // The mean of exp(−2κL/D) from the distance 1.
    for (seed, permeability, count) in [(6, 0.5, 1), (7, 0.5, 100), (8, 4.0, 2), (9, 4.0, 400)] {
        let time = 8.0;
        let (h, y) = (2.0 * permeability / D, 1.0 / (4.0 * D * time).sqrt());
        let x = y + h * (D * time).sqrt();
        // exp(x²)·erfc(x), by its continued fraction.
        let erfcx = 1.0 / (std::f64::consts::PI.sqrt() * (x + 0.5 / (x + 1.0 / (x + 1.5 / (x + 2.0 / x)))));
        let expected = 0.5 * (libm::erfc(y) - (-y * y).exp() * erfcx);
        let model = model(time / f64::from(count), "", permeability, &burst(1.0, "{ kind = \"point\" }"));
        let found = fraction(&model, count, seed, [-1e9, 0.0]);
        add(format!("κ = {permeability}, passed from a point, {count} steps"), expected, found);
    }
    for (seed, low, high) in [(10, -0.05, 0.0), (11, 0.0, 0.05)] {
        let model = model(0.045, halves, 1.0, &burst(0.0, "{ kind = \"box\", size = [2, 1, 1] }"));
        add(format!("uniform from {low} to {high}"), 0.025, fraction(&model, 20, seed, [low, high]));
    }
    let steady = "center = [0.01, 0, 0]\nrelease = [{ species = \"A\", rate = 20000 }]";
    let mut closed = model(0.02, "", 0.0, steady);
    let center = [-0.52, 0.0, 0.0];
    closed.receivers.push(Receiver { center, ..receiver(0.5, ReceiverKind::Absorbing) });
    let simulation = run_for(&closed, 12, 50);
    rows.push(Row::exact("closed, arrived on the other side", 0, simulation.state().totals.arrived[0][0]));
    let mut walls = model(0.0625, halves, 0.0, &burst(0.1, "{ kind = \"point\" }"));
    let faces = [WallFace::Low(0), WallFace::High(0)];
    walls.receivers.extend(faces.map(|face| receiver(0.0, ReceiverKind::Wall(face))));
    let simulation = run_for(&walls, 14, 8);
    let [beyond, before] = [0, 1].map(|k| simulation.state().totals.arrived[k][0]);
    rows.push(Row::exact("closed, arrived at the wall beyond it", 0, beyond));
    // From 0.1 between a mirror at 0 and the wall at 1.
    let mode = |n: i32| {
        let k = f64::from(2 * n + 1) * 0.5 * std::f64::consts::PI;
        2.0 / k * f64::from(1 - 2 * (n % 2)) * (0.1 * k).cos() * (-k * k * D * 0.5).exp()
    };
    let (reached, found) = (1.0 - (0..20).map(mode).sum::<f64>(), before as f64 / f64::from(N));
    rows.push(Row::fraction("closed, arrived at the wall before it", reached, found, N));
    rows.push(Row::new("closed, passed", 0.0, fraction(&closed, 50, 13, [-1e9, 0.0]), 0.0));
    let receivers = closed.receivers.iter_mut();
    receivers.for_each(|receiver| (receiver.velocity, receiver.diffusion) = ([1.0, 0.0, 0.0], 0.5));
    let simulation = run_for(&closed, 15, 50);
    let arrived = simulation.state().totals.arrived[0][0];
    rows.push(Row::exact("closed, arrived at one that moves", 0, arrived));
    rows.extend(diffusing_receiver());
    rows
}

fn diffusing_receiver() -> Vec<Row> {
    const RADIUS: f64 = 0.35;
    const COUNT: u32 = 2500;
    let surface = |position| MembraneSurface::Plane { axis: 0, position };
    let membrane = |permeability, surface| {
        let (name, sees) = ("m".to_owned(), vec![true]);
        Membrane { name, surface, permeability, sees }
    };
    let model = |permeability: f64, [from, width]: [f32; 2]| Model {
        time_step: 2.5e-4,
        species: vec![species("A", 0.0, D)],
        membranes: [0.0, 1.0].map(|at| membrane(permeability, surface(at))).into(),
        receivers: vec![Receiver {
            center: [0.5, 0.0, 0.0],
            diffusion: 0.02,
            ..receiver(RADIUS, ReceiverKind::Reflecting)
        }],
        transmitters: vec![Transmitter {
            center: [from, 0.0, 0.0],
            ..setup::burst(Shape::Box([width, 1.0, 1.0]), &[(0, COUNT)])
        }],
        boundary: Boundary::periodic([-0.75, -0.5, -0.5], [1.25, 0.5, 0.5]),
        ..Model::default()
    };
    let half = |model: &Model, seed| fraction(model, 3000, seed, [0.0, 1.0]);
    let open = model(5.0, [0.25, 2.0]);
    let fractions: Vec<f64> = (0..12).into_par_iter().map(|seed| half(&open, seed)).collect();
    let free = 1.0 - 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3);
    let mut closed = [[-0.25, 0.5], [0.5, 0.5]].map(|from| model(0.0, from));
    closed.iter_mut().for_each(|model| model.receivers[0].velocity = [4.0, 4.0, 0.0]);
    vec![
        Row::mean("fraction around a receiver that diffuses", free / (1.0 + free), fractions),
        Row::new("closed, passed to a receiver that moves", 0.0, half(&closed[0], 16), 0.0),
        Row::new("closed, stayed around a receiver that moves", 1.0, half(&closed[1], 17), 0.0),
    ]
}
