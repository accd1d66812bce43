use lazygrid_sim::{
    Adsorption, Boundary, Flow, Ligand, Model, Particle, Particles, Receiver, ReceiverKind, ReceptorType,
    Shape, Transmitter,
};
use rayon::prelude::*;

use crate::Row;
use crate::receivers::{FLOW, passing};
use crate::setup::{begin, burst, fraction_error, mean, receiver, run_for, scenario, species, steps};

const D: f64 = 100.0;
const R: f64 = 5.0;
const DISTANCE: f64 = 10.0;

/// Adsorbed within T by a sphere of reactivity κ (Collins and Kimball, 1949).
fn taken(kappa: f64, time: f64) -> f64 {
    let h = kappa / D + 1.0 / R;
    let y = (DISTANCE - R) / (4.0 * D * time).sqrt();
    let x = h * (D * time).sqrt();
    let tail = (-y * y).exp() * erfcx(y + x);
    R / DISTANCE * kappa / (D * h) * (libm::erfc(y) - tail)
}

/// exp(x²)·erfc(x), by its continued fraction if factors overflow.
fn erfcx(x: f64) -> f64 {
    if x < 20.0 {
        return (x * x).exp() * libm::erfc(x);
    }
    1.0 / (std::f64::consts::PI.sqrt() * (x + 0.5 / (x + 1.0 / (x + 1.5 / x))))
}

pub(crate) fn partial() -> Vec<Row> {
    let (n, time) = (40_000_u32, 0.5);
    let fraction = |sticking, count: u32| {
        let center = [DISTANCE as f32, 0.0, 0.0];
        let model = Model {
            time_step: time / f64::from(count),
            species: vec![species("A", 0.0, D)],
            transmitters: vec![burst(Shape::Point, &[(0, n)])],
            receivers: vec![Receiver { center, ..receiver(R, ReceiverKind::Partial(sticking)) }],
            ..Model::default()
        };
        let simulation = run_for(&model, 6, count);
        simulation.state().totals.arrived[0][0] as f64 / f64::from(n)
    };
    let mut rows = Vec::new();
    for kappa in [5.0, 20.0, 200.0] {
        let expected = taken(kappa, time);
        let tolerance = 4.0 * fraction_error(expected, n.into());
        for count in [20, 200] {
            let found = fraction(Adsorption::Reactivity(kappa), count);
            rows.push(Row::new(format!("rate {kappa} µm/s, {count} steps"), expected, found, tolerance));
        }
    }
    let [few, many] = [20, 200].map(|count| fraction(Adsorption::PerStep(0.1), count));
    let tolerance = 4.0 * fraction_error(few, n.into());
    rows.push(Row {
        must_differ: true,
        ..Row::new("probability 0.1, 20 and 200 steps", few, many, tolerance)
    });
    rows
}

fn bound(n: u32, receptors: u32, constant_per_volume: f64) -> f64 {
    let (mut weight, mut sum, mut total) = (1.0, 0.0, 1.0);
    for b in 0..n.min(receptors) {
        // One more: any free particle to any free receptor, against any bound one leaving.
        let b = f64::from(b);
        weight *= (f64::from(n) - b) * (f64::from(receptors) - b) * constant_per_volume / (b + 1.0);
        sum += (b + 1.0) * weight;
        total += weight;
    }
    sum / total
}

pub(crate) fn receptors() -> Vec<Row> {
    const N: u32 = 200;
    const SIDE: f64 = 4.0;
    let radius = 0.5;
    let free_volume = SIDE.powi(3) - 4.0 / 3.0 * std::f64::consts::PI * f64::powi(radius, 3);
    let row = |(time_step, binding_rate): (f64, f64)| {
        let unbinding_rate = 5.0;
        let receptors = ReceptorType::new(100, binding_rate, unbinding_rate, [0]);
        let count = receptors.count;
        let model = Model {
            time_step,
            species: vec![species("A", 0.0, 1.0)],
            transmitters: vec![burst(Shape::Box([SIDE as f32; 3]), &[(0, N)])],
            receivers: vec![receiver(radius, ReceiverKind::Receptors(vec![receptors]))],
            boundary: Boundary::periodic([-2.0; 3], [2.0; 3]),
            ..Model::default()
        };
        let run = |seed: u64| {
            let mut simulation = run_for(&model, seed, (2.0 / time_step) as u32);
            let (samples, between) = (300, (0.04 / time_step) as u32);
            let held = (0..samples).map(|_| {
                steps(&mut simulation, between);
                let state = simulation.state();
                assert_eq!(state.particles.len() + state.bound.len(), N as usize);
                state.bound.len() as f64
            });
            held.sum::<f64>() / f64::from(samples)
        };
        let means: Vec<f64> = (0..16).into_par_iter().map(run).collect();
        let expected = bound(N, count, binding_rate / unbinding_rate / free_volume);
        Row::mean(format!("held, binding {binding_rate} µm³/s, step {time_step} s"), expected, means)
    };
    [(0.005, 2.0), (0.02, 2.0), (0.02, 0.2)].map(row).into()
}

/// Means of A and B bound to the first receptors, and of A bound to the second. Each binding changes the weight of a
/// state by the ratio of the rates.
fn competing(free: [u32; 2], receptors: [u32; 2], constants: [f64; 3]) -> [f64; 3] {
    let [a, b] = free.map(f64::from);
    let [both, only] = receptors.map(f64::from);
    let (mut sums, mut total, mut of_b) = ([0.0; 3], 0.0, 1.0);
    for bound_b in 0..=receptors[0] {
        let held_b = f64::from(bound_b);
        let mut of_a = of_b;
        for bound_a in 0..=receptors[0] - bound_b {
            let held_a = f64::from(bound_a);
            let mut weight = of_a;
            for bound_only in 0..=receptors[1] {
                let held_only = f64::from(bound_only);
                total += weight;
                for (sum, held) in sums.iter_mut().zip([held_a, held_b, held_only]) {
                    *sum += held * weight;
                }
                weight *= (a - held_a - held_only) * (only - held_only) * constants[2] / (held_only + 1.0);
            }
            of_a *= (a - held_a) * (both - held_a - held_b) * constants[0] / (held_a + 1.0);
        }
        of_b *= (b - held_b) * (both - held_b) * constants[1] / (held_b + 1.0);
    }
    sums.map(|sum| sum / total)
}

/// The law of mass action, exactly and with the mean free concentrations c: N·(c/K)/(1 + Σ c/K) up to fluctuations.
pub(crate) fn competition() -> Vec<Row> {
    const FREE: [u32; 2] = [150, 100];
    const RECEPTORS: [u32; 2] = [60, 30];
    const SIDE: f64 = 4.0;
    let ligand = |species, binding_rate, unbinding_rate| Ligand { species, binding_rate, unbinding_rate };
    let [a, b, only] = [ligand(0, 2.0, 4.0), ligand(1, 3.0, 8.0), ligand(0, 1.0, 4.0)];
    let types = vec![
        ReceptorType { count: RECEPTORS[0], ligands: vec![a, b] },
        ReceptorType { count: RECEPTORS[1], ligands: vec![only] },
    ];
    let receiver = Receiver { sees: vec![true; 2], ..receiver(0.5, ReceiverKind::Receptors(types)) };
    let volume = SIDE.powi(3) - 4.0 / 3.0 * std::f64::consts::PI * f64::powi(0.5, 3);
    let constants = [a, b, only].map(|ligand| ligand.binding_rate / ligand.unbinding_rate / volume);
    let expected = competing(FREE, RECEPTORS, constants);
    let mut rows = Vec::new();
    for time_step in [0.005, 0.02] {
        let model = Model {
            time_step,
            species: vec![species("A", 0.0, 1.0), species("B", 0.0, 0.5)],
            transmitters: vec![burst(Shape::Box([SIDE as f32; 3]), &[(0, FREE[0]), (1, FREE[1])])],
            receivers: vec![receiver.clone()],
            boundary: Boundary::periodic([-2.0; 3], [2.0; 3]),
            ..Model::default()
        };
        let run = |seed: u64| {
            let mut simulation = run_for(&model, seed, (3.0 / time_step) as u32);
            let (samples, between) = (300, (0.04 / time_step) as u32);
            let mut held = [0.0; 3];
            for _ in 0..samples {
                steps(&mut simulation, between);
                for bound in &simulation.state().bound {
                    held[(bound.species + 2 * bound.receptor) as usize] += 1.0 / f64::from(samples);
                }
            }
            held
        };
        let runs: Vec<[f64; 3]> = (0..48).into_par_iter().map(run).collect();
        let of = |k: usize| mean(runs.iter().map(|held| held[k]));
        let names = ["A on both's", "B on both's", "A on its own"];
        for k in 0..3 {
            let (measured, error) = of(k);
            let what = format!("{} receptors, step {time_step} s", names[k]);
            rows.push(Row::new(what, expected[k], measured, 4.0 * error));
        }
        let [bound_a, bound_b, bound_only] = [0, 1, 2].map(|k| of(k).0);
        let c_a = (f64::from(FREE[0]) - bound_a - bound_only) * constants[0];
        let c_b = (f64::from(FREE[1]) - bound_b) * constants[1];
        let mass_action = f64::from(RECEPTORS[0]) * c_b / (1.0 + c_a + c_b);
        let what = format!("B by the law of mass action, step {time_step} s");
        rows.push(Row::new(what, mass_action, bound_b, 4.0 * of(1).1 + 0.005 * mass_action));
    }
    rows
}

pub(crate) fn reflecting() -> Vec<Row> {
    const N: u32 = 20_000;
    const RADIUS: f32 = 1.0;
    let mut rows = Vec::new();
    for (what, diffusion, velocity) in
        [("at rest", 0.0, [0.0; 3]), ("diffusing", 0.5, [0.0; 3]), ("in a flow", 0.0, [20.0, 0.0, 0.0])]
    {
        let boundary = Boundary::periodic([-2.0; 3], [2.0; 3]);
        let obstacle = Receiver { velocity, diffusion, ..receiver(RADIUS.into(), ReceiverKind::Reflecting) };
        let model = Model {
            time_step: 0.02,
            species: vec![species("A", 0.0, 1.0)],
            receivers: vec![obstacle],
            flow: Some(Flow::Plug(velocity)),
            boundary,
            ..Model::default()
        };
        let inside = |particles: &Particles, center: [f32; 3], radius: f32| {
            let ball = Receiver { radius, sees: vec![true], ..Receiver::default() };
            ball.inside(center, &boundary, particles)[0] as f64
        };
        let run = |seed: u64| {
            let all = Transmitter { ..burst(Shape::Box([4.0; 3]), &[(0, N)]) };
            let from =
                begin(&Model { transmitters: vec![all], receivers: Vec::new(), ..model.clone() }, seed);
            let mut particles = Particles::default();
            let all = &from.state().particles;
            let out = |p: &Particle| p.position.iter().map(|c| c * c).sum::<f32>() > RADIUS * RADIUS;
            (0..all.len()).map(|at| all.get(at)).filter(out).for_each(|p| particles.push(p, false));
            let mut simulation = begin(&model, seed);
            simulation.insert(&particles);
            let mut fractions = [0.0; 3];
            for _ in 0..4 {
                steps(&mut simulation, 4);
                let state = simulation.state();
                let within = |radius| inside(&state.particles, state.centers[0], radius);
                let counts = [RADIUS, RADIUS + 0.05, RADIUS + 0.2].map(within);
                fractions[0] += 0.25 * counts[0];
                (1..3).for_each(|k| {
                    fractions[k] += 0.25 * (counts[k] - counts[k - 1]) / particles.len() as f64
                });
            }
            fractions
        };
        let runs: Vec<[f64; 3]> = (0..16).into_par_iter().map(run).collect();
        rows.push(Row::new(format!("inside a sphere {what}"), 0.0, runs.iter().map(|r| r[0]).sum(), 0.0));
        let ball = |radius: f64| 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        for (k, [from, to]) in [(1, [1.0, 1.05]), (2, [1.05, 1.2])] {
            let expected = (ball(to) - ball(from)) / (64.0 - ball(1.0));
            let what = format!("from {from} to {to} µm around one {what}");
            rows.push(Row::mean(what, expected, runs.iter().map(|run| run[k])));
        }
    }
    rows
}

/// A moving receiver adsorbs as a resting one in a flow; diffusion coefficients add up.
pub(crate) fn moving() -> Vec<Row> {
    let row = |count| passing("on the way of a receiver", [0.0, -FLOW], count);
    let mut rows: Vec<Row> = [8, 32, 400].map(row).into();
    rows.push(diffusing());
    rows
}

fn diffusing() -> Row {
    const SIDE: u32 = 10;
    const BURST: u32 = 40;
    const RECEIVER_DIFFUSION: f64 = 50.0;
    let (time, count) = (0.5, 100);
    let centers =
        (0..SIDE.pow(3)).map(|k| [k % SIDE, k / SIDE % SIDE, k / SIDE / SIDE].map(|c| 150.0 * c as f32));
    let receiver =
        |center| Receiver { center, diffusion: RECEIVER_DIFFUSION, ..receiver(R, ReceiverKind::Absorbing) };
    let near = |[x, y, z]: [f32; 3]| Transmitter {
        center: [x + DISTANCE as f32, y, z],
        ..burst(Shape::Point, &[(0, BURST)])
    };
    let model = Model {
        time_step: time / f64::from(count),
        species: vec![species("A", 0.0, D)],
        transmitters: centers.clone().map(near).collect(),
        receivers: centers.map(receiver).collect(),
        ..Model::default()
    };
    let simulation = run_for(&model, 7, count);
    let arrived = &simulation.state().totals.arrived;
    let fractions = arrived.iter().map(|row| row[0] as f64 / f64::from(BURST));
    let expected = R / DISTANCE * libm::erfc((DISTANCE - R) / (4.0 * (D + RECEIVER_DIFFUSION) * time).sqrt());
    Row::mean("by many that diffuse", expected, fractions)
}

pub(crate) fn transmitters() -> Vec<Row> {
    let model = |motion: &str, release: &str| {
        let text = format!(
            "time-step = 0.25\nsteps = 1\n[[species]]\nname = \"A\"\n[[transmitter]]\nname = \"tx\"\ncenter = [1, 2, 3]\n\
             {motion}\n{release}\n"
        );
        scenario(text)
    };
    let positions = |model: &Model, seed, count| run_for(model, seed, count).positions().collect::<Vec<_>>();
    // Uniform from 0 to 8 µm along the path.
    let steady = "release = [{ species = \"A\", rate = 1000 }]";
    let line: Vec<f64> = positions(&model("velocity = [0, 4, 0]", steady), 1, 8)
        .iter()
        .map(|position| position[1] - 2.0)
        .collect();
    let n = line.len() as f64;
    let moment = |power: i32| line.iter().map(|y| y.powi(power)).sum::<f64>() / n;
    let mut rows = vec![
        Row::new("steady release on a way, mean", 4.0, moment(1), 0.01),
        Row::new("steady release on a way, mean square", 64.0 / 3.0, moment(2), 0.1),
    ];
    // 6Dt after 4 s with D = 2.
    let late = "times = [4]\nrelease = [{ species = \"A\", count = 1 }]";
    let wandering = model("diffusion = 2", late);
    let square = |seed| {
        let [x, y, z] = positions(&wandering, seed, 20)[0];
        (x - 1.0).powi(2) + (y - 2.0).powi(2) + (z - 3.0).powi(2)
    };
    rows.push(Row::mean("square distance of a diffusing transmitter", 48.0, (0..2000).map(square)));
    rows
}
