use std::f64::consts::PI;

use lazygrid_sim::{Decay, Model, Reaction, ReactionRate, Shape, Transmitter};
use rayon::prelude::*;

use crate::Row;
use crate::setup::{begin, burst, mean, run_for, scenario, species, steps, steps_until};

fn parse(text: &str) -> Model {
    scenario(text.to_owned())
}

fn box_of(n: u32, time_step: f64, diffusion: f64, more: &str) -> String {
    let species = |name: &str| format!("[[species]]\nname = \"{name}\"\ndiffusion = {diffusion}\n");
    let release = |name: &str| format!("{{ species = \"{name}\", count = {n} }}");
    format!(
        "time-step = {time_step}\nsteps = 1\n[boundary]\nkind = \"periodic\"\nlow = [-1, -1, -1]\nhigh = [1, 1, 1]\n\
         {}{}{}{more}\n[[transmitter]]\nname = \"all\"\nshape = {{ kind = \"box\", size = [2, 2, 2] }}\n\
         release = [{}, {}]\n",
        species("A"),
        species("B"),
        species("C"),
        release("A"),
        release("B")
    )
}

/// Mean bound of n + n: m bound weigh (n over m)²·m!·(K/V)^m.
fn bound(n: u32, constant: f64) -> f64 {
    let (mut weight, mut sum, mut first) = (1.0, 1.0, 0.0);
    for m in 1..=n {
        weight *= f64::from(n - m + 1).powi(2) / f64::from(m) * constant;
        sum += weight;
        first += f64::from(m) * weight;
    }
    first / sum
}

pub(crate) fn equilibrium() -> Vec<Row> {
    let (n, volume) = (20, 8.0);
    let row = |what: &str, text: String, constant: f64, (relax, count): (u32, u32)| {
        let model = parse(&text);
        let run = |seed: u64| {
            let mut simulation = run_for(&model, seed, 20 * relax);
            let one = |_| {
                steps(&mut simulation, 1);
                simulation.state().totals.present[2] as f64
            };
            (0..count).map(one).sum::<f64>() / f64::from(count)
        };
        let means: Vec<f64> = (0..20).into_par_iter().map(run).collect();
        Row::mean(format!("bound, {what}"), bound(n, constant / volume), means)
    };
    let ball = 4.0 / 3.0 * PI * 0.1_f64.powi(3);
    let inside = |dt: f64, d: f64| {
        let both = "[[reaction]]\nequation = \"A + B -> C\"\nbinding-radius = 0.1\nrate-inside = 190\n\
                    [[decay]]\nequation = \"C -> A + B\"\nrate = 1\n";
        box_of(n, dt, d, both)
    };
    let by_rate = |dt: f64, unbinding: f64| {
        let both = format!(
            "[[reaction]]\nequation = \"A + B -> C\"\nrate = 80\n\
             [[decay]]\nequation = \"C -> A + B\"\nrate = 100\nunbinding-radius = {unbinding}\n"
        );
        box_of(n, dt, 50.0, &both)
    };
    let plane = inside(4e-3, 5.0)
        .replace("steps = 1", "steps = 1\ndimensions = 2")
        .replace("-1, -1, -1", "-1, -1, 0")
        .replace("high = [1, 1, 1]", "high = [1, 1, 0]");
    // The area is 4.
    let disk = 190.0 * PI * 0.1_f64.powi(2) * volume / 4.0;
    vec![
        row("rate inside a disk", plane, disk, (100, 8_000)),
        row("rate inside a ball, long steps", inside(4e-3, 5.0), 190.0 * ball, (100, 8_000)),
        row("rate inside a ball, short steps", inside(4e-4, 5.0), 190.0 * ball, (500, 12_000)),
        row("rate, step σ/2, apart by 0.1", by_rate(5e-6, 0.1), 0.8, (300, 20_000)),
        row("rate, step 2σ, apart by 0.1", by_rate(5e-5, 0.1), 0.8, (60, 8_000)),
        row("rate, step 2σ, apart by nothing", by_rate(5e-5, 0.0), 0.8, (60, 8_000)),
    ]
}

pub(crate) fn exchange() -> Vec<Row> {
    let (n, ratio, seeds) = (60_u32, 4.0_f64, 12);
    let text = |time_step: f64, [there, back]: [f64; 2]| {
        let both = format!(
            "[[species]]\nname = \"D\"\ndiffusion = 50\n\
             [[reaction]]\nequation = \"A + B -> C + D\"\nrate = 80\nunbinding-radius = {there}\n\
             [[reaction]]\nequation = \"C + D -> A + B\"\nrate = 20\nunbinding-radius = {back}\n"
        );
        box_of(n, time_step, 50.0, &both)
    };
    // With m of C and as many of D: (n over m)²·K^m.
    let (mut weight, mut sum, mut first) = (1.0, 1.0, 0.0);
    for m in 1..=n {
        weight *= (f64::from(n - m + 1) / f64::from(m)).powi(2) * ratio;
        sum += weight;
        first += f64::from(m) * weight;
    }
    let row = |(time_step, apart): (f64, [f64; 2])| {
        let model = parse(&text(time_step, apart));
        let (relax, count) = ((0.2 / time_step) as u32, (0.5 / time_step) as u32);
        let run = |seed: u64| {
            let mut simulation = run_for(&model, seed, relax);
            let one = |_| {
                steps(&mut simulation, 1);
                simulation.state().totals.present[2] as f64
            };
            (0..count).map(one).sum::<f64>() / f64::from(count)
        };
        let means: Vec<f64> = (0..seeds).into_par_iter().map(run).collect();
        Row::mean(format!("exchanged, apart by {apart:?}"), first / sum, means)
    };
    [(1e-4, [0.1, 0.3]), (5e-5, [0.3, 0.15])].into_iter().map(row).collect()
}

pub(crate) fn michaelis_menten() -> Vec<Row> {
    let (inside, back, onwards, radius) = (40.0, 1.0, 2.0, 0.05_f64);
    let text = format!(
        "time-step = 1e-3\nsteps = 1\n[boundary]\nkind = \"periodic\"\nlow = [0, 0, 0]\nhigh = [1, 1, 1]\n\
         [[species]]\nname = \"E\"\ndiffusion = 50\n[[species]]\nname = \"S\"\ndiffusion = 50\n\
         [[species]]\nname = \"ES\"\ndiffusion = 50\n[[species]]\nname = \"P\"\ndiffusion = 50\n\
         [[reaction]]\nequation = \"E + S -> ES\"\nbinding-radius = {radius}\nrate-inside = {inside}\n\
         [[decay]]\nequation = \"ES -> E + S\"\nrate = {back}\n\
         [[decay]]\nequation = \"ES -> E + P\"\nrate = {onwards}\n\
         [[transmitter]]\nname = \"all\"\ncenter = [0.5, 0.5, 0.5]\nshape = {{ kind = \"box\", size = [1, 1, 1] }}\n\
         release = [{{ species = \"E\", count = 100 }}, {{ species = \"S\", count = 1000 }}]\n"
    );
    let model = parse(&text);
    let times = [0.5, 2.0, 4.0];
    let run = |seed| {
        let mut simulation = begin(&model, seed);
        times.map(|time: f64| {
            steps_until(&mut simulation, (time * 1000.0) as u32);
            simulation.state().totals.present[3] as f64
        })
    };
    let runs: Vec<[f64; 3]> = (0..8).into_par_iter().map(run).collect();
    let per_pair = inside * 4.0 / 3.0 * PI * radius.powi(3);
    let row = |(index, time): (usize, f64)| {
        let [_, product] = rate_equations([per_pair, back, onwards], time);
        Row::mean(format!("product after {time} s"), product, runs.iter().map(|run| run[index]))
    };
    times.into_iter().enumerate().map(row).collect()
}

/// Uses the method of Runge and Kutta.
fn rate_equations([there, back, onwards]: [f64; 3], time: f64) -> [f64; 2] {
    let slope = |[complex, product]: [f64; 2]| {
        let bind = there * (100.0 - complex) * (1000.0 - complex - product);
        [bind - (back + onwards) * complex, onwards * complex]
    };
    let count = 10_000;
    let h = time / f64::from(count);
    let go = |y: [f64; 2], by: f64, k: [f64; 2]| [y[0] + by * k[0], y[1] + by * k[1]];
    (0..count).fold([0.0, 0.0], |y, _| {
        let a = slope(y);
        let b = slope(go(y, h / 2.0, a));
        let c = slope(go(y, h / 2.0, b));
        let d = slope(go(y, h, c));
        let k = [0, 1].map(|i| (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]) / 6.0);
        go(y, h, k)
    })
}

/// The numbers of particles are Poisson at any step.
pub(crate) fn births() -> Vec<Row> {
    let text = "time-step = 1\nsteps = 1\n[boundary]\nkind = \"reflecting\"\nlow = [0, 0, 0]\nhigh = [1, 2, 5]\n\
                [[species]]\nname = \"A\"\nradius = 0.1\ndiffusion = 0.1\n\
                [[species]]\nname = \"B\"\ndiffusion = 0.1\n\
                [[source]]\nequation = \"-> A\"\nrate = 3\n[[decay]]\nequation = \"A -> B\"\nrate = 1.5\n\
                [[decay]]\nequation = \"B ->\"\nrate = 0.5\n";
    let model = parse(text);
    let run = |seed| {
        let simulation = run_for(&model, seed, 30);
        simulation.state().totals.present.iter().map(|&count| count as f64).collect::<Vec<_>>()
    };
    let runs: Vec<Vec<f64>> = (0..2000).into_par_iter().map(run).collect();
    let mut rows = Vec::new();
    for (index, expected) in [(0, 20.0), (1, 60.0)] {
        let counts: Vec<f64> = runs.iter().map(|run| run[index]).collect();
        let (measured, error) = mean(counts.iter().copied());
        let name = &model.species[index].name;
        rows.push(Row::new(format!("mean of {name}"), expected, measured, 4.0 * error));
        let n = counts.len() as f64;
        let variance = counts.iter().map(|count| (count - measured).powi(2)).sum::<f64>() / (n - 1.0);
        // Fourth central moment of a Poisson number: λ + 3λ².
        let error = ((expected + 2.0 * expected * expected) / n).sqrt();
        rows.push(Row::new(format!("variance of {name}"), expected, variance, 4.0 * error));
    }
    rows
}

pub(crate) fn branching() -> Vec<Row> {
    let more = "[[species]]\nname = \"D\"\n[[reaction]]\nequation = \"A + B -> C\"\nrate = 60\n\
                [[reaction]]\nequation = \"B + A -> D\"\nrate = 20\n";
    let model = parse(&box_of(2000, 1e-4, 5.0, more));
    let run = |seed| {
        let simulation = run_for(&model, seed, 200);
        let reacted = &simulation.state().totals.reacted;
        [reacted[0], reacted[1]]
    };
    let runs: Vec<[u64; 2]> = (0..10).into_par_iter().map(run).collect();
    let [first, second] = [0, 1].map(|k| runs.iter().map(|run| run[k]).sum::<u64>() as f64);
    let n = first + second;
    vec![Row::fraction("fraction of the first channel", 0.75, first / n, n)]
}

/// Particles that react within a target at a rate λ. With κ = √(λ/D) those at r ever react with probability h(r) =
/// (ρ/r)·(1 − tanh(κρ)/κρ), and 1 − (ρ − ρh(ρ))·sinh(κr)/(r·sinh(κρ)) inside. The mean of h, counting reacted ones as
/// 1, is conserved.
pub(crate) fn rate_inside() -> Vec<Row> {
    let (n, radius, rate, start, time) = (250_u32, 1.0_f64, 4.0_f64, 1.5_f64, 1.0);
    let kappa = rate.sqrt();
    let effective_radius = radius - (kappa * radius).tanh() / kappa;
    let ever = |r: f64| match r > radius {
        true => effective_radius / r,
        false => 1.0 - (radius - effective_radius) * (kappa * r).sinh() / (r * (kappa * radius).sinh()),
    };
    let row = |step: f64| {
        let time_step = step * step / 2.0;
        let reaction = Reaction {
            name: "target + A -> target".to_owned(),
            reactants: [0, 1],
            products: [Some(0), None],
            binding_radius: radius as f32,
            chance: ReactionRate::PerTime(rate),
            ..Reaction::default()
        };
        let around = Transmitter { center: [start as f32, 0.0, 0.0], ..burst(Shape::Point, &[(1, n)]) };
        let model = Model {
            time_step,
            species: vec![species("target", 0.0, 0.0), species("A", 0.0, 1.0)],
            reactions: vec![reaction],
            transmitters: vec![burst(Shape::Point, &[(0, 1)]), around],
            ..Model::default()
        };
        let batch = |seed| {
            let simulation = run_for(&model, seed, (time / time_step).round() as u32);
            let particles = &simulation.state().particles;
            let mut values = vec![1.0; simulation.state().totals.reacted[0] as usize];
            for at in (0..particles.len()).filter(|&at| particles.species[at] == 1) {
                let [x, y, z] = particles.position_of(at).map(f64::from);
                values.push(ever((x * x + y * y + z * z).sqrt()));
            }
            values
        };
        let values: Vec<f64> = (0..160).into_par_iter().flat_map_iter(batch).collect();
        Row::mean(format!("ever reacted, step {step} ρ"), ever(start), values)
    };
    [0.1, 0.3].map(row).into()
}

pub(crate) fn chain() -> Vec<Row> {
    let decay = |reactant, products, rate| Decay { reactant, products, rate, ..Decay::default() };
    let n = 200_000;
    let model = Model {
        time_step: 0.1,
        species: vec![species("A", 0.0, 0.0), species("B", 0.0, 0.0)],
        decays: vec![decay(0, [Some(1), None], 1.0), decay(1, [None, None], 2.0)],
        transmitters: vec![burst(Shape::Point, &[(0, n)])],
        ..Model::default()
    };
    let simulation = run_for(&model, 8, 10);
    let present = &simulation.state().totals.present;
    let expected = [(-1.0_f64).exp(), (-1.0_f64).exp() - (-2.0_f64).exp()];
    let row = |k: usize| {
        let fraction = present[k] as f64 / f64::from(n);
        let what = format!("fraction of {} after 1 s", model.species[k].name);
        Row::fraction(what, expected[k], fraction, n)
    };
    vec![row(0), row(1), chain_to_dissociation(0.5, 9), chain_to_dissociation(1.0, 10)]
}

fn chain_to_dissociation(time_step: f64, seed: u64) -> Row {
    let decay = |reactant, products, rate| Decay { reactant, products, rate, ..Decay::default() };
    let n = 100_000;
    let model = Model {
        time_step,
        species: ["A", "B", "C"].map(|name| species(name, 0.0, 0.0)).into(),
        decays: vec![decay(0, [Some(1), None], 1.0), decay(1, [Some(2); 2], 2.0)],
        transmitters: vec![burst(Shape::Point, &[(0, n)])],
        ..Model::default()
    };
    let simulation = run_for(&model, seed, (1.0 / time_step) as u32);
    let fraction = simulation.state().totals.present[2] as f64 / f64::from(2 * n);
    let expected = (1.0 - (-1.0_f64).exp()).powi(2);
    Row::fraction(format!("fraction of the dissociated, step {time_step} s"), expected, fraction, n)
}
