use lazygrid_sim::Model;
use rayon::prelude::*;

use crate::Row;
use crate::setup::{begin, run_for, scenario, steps};

const N: u32 = 20_000;

fn model(dimensions: usize, time_step: f64, center: &str, more: &str) -> Model {
    let text = format!(
        "time-step = {time_step}\nsteps = 1\ndimensions = {dimensions}\n[[species]]\nname = \"A\"\ndiffusion = 1\n\
         [[transmitter]]\nname = \"tx\"\ncenter = {center}\nrelease = [{{ species = \"A\", count = {N} }}]\n{more}"
    );
    scenario(text)
}

fn receiver(kind: &str, center: f64, radius: f64) -> String {
    format!("[[receiver]]\nname = \"rx\"\ncenter = [{center}, 0, 0]\nradius = {radius}\nkind = {kind}\n")
}

fn taken(model: &Model, time: f64, seed: u64) -> f64 {
    let simulation = run_for(model, seed, (time / model.time_step).round() as u32);
    simulation.received()[0][0] as f64 / f64::from(N)
}

fn mean_time(model: &Model, seed: u64) -> [f64; 2] {
    let mut simulation = begin(model, seed);
    let (mut first, mut second, mut left) = (0.0, 0.0, N as usize);
    while left > 0 {
        steps(&mut simulation, 1);
        let now = simulation.state().particles.len();
        let (time, count) = (simulation.time() - 0.5 * model.time_step, (left - now) as f64 / f64::from(N));
        (first, second) = (first + count * time, second + count * time * time);
        left = now;
    }
    [first, ((second - first * first) / f64::from(N)).sqrt()]
}

pub(crate) fn fewer_dimensions() -> Vec<Row> {
    let mut rows = Vec::new();
    for dimensions in [1_usize, 2] {
        let simulation = run_for(&model(dimensions, 0.01, "[0, 0, 0]", ""), dimensions as u64, 50);
        let what = format!("mean square displacement, d = {dimensions}");
        rows.push(Row::mean(what, 2.0 * dimensions as f64 * 0.5, simulation.squares()));
    }
    let fraction = |what: String, expected: f64, found: f64| Row::fraction(what, expected, found, N);
    // A radius of 1e-4 is a point that steps jump over.
    for (seed, spread, radius) in [(3, 0.1_f64, 1e-4), (4, 0.5, 0.5), (5, 1.0, 1e-4)] {
        let time_step = spread * spread / 2.0;
        let line = model(1, time_step, "[1, 0, 0]", &receiver("\"absorbing\"", -radius, radius));
        let found = taken(&line, 1.0, seed);
        rows.push(fraction(
            format!("first passage, steps of {spread}, R = {radius}"),
            libm::erfc(0.5),
            found,
        ));
    }
    let ends = "[boundary]\nkind = \"reflecting\"\nlow = [0, 0, 0]\nhigh = [2, 0, 0]\n\
                [[receiver]]\nname = \"low\"\nkind = \"wall\"\nface = \"low-x\"\n\
                [[receiver]]\nname = \"high\"\nkind = \"wall\"\nface = \"high-x\"\n";
    let [found, error] = mean_time(&model(1, 2e-4, "[0.5, 0, 0]", ends), 6);
    rows.push(Row::new("mean time to the ends of a segment", 0.5 * 0.5 * 1.5, found, 4.0 * error));
    for (seed, spread) in [(7, 0.1_f64), (8, 0.7)] {
        let time_step = spread * spread / 2.0;
        let line = model(1, time_step, "[1, 0, 0]", &receiver("\"partial\"\nrate = 2", -1e-4, 1e-4));
        let time = (1.0 / time_step).round() * time_step;
        let y = 0.5 / time.sqrt();
        let expected = libm::erfc(y) - (2.0 + 4.0 * time).exp() * libm::erfc(y + 2.0 * time.sqrt());
        rows.push(fraction(
            format!("partial on a line, steps of {spread}"),
            expected,
            taken(&line, time, seed),
        ));
    }
    // In a disk of radius 3 around one of radius 1, from 2: b²/2·ln(r/a) − (r² − a²)/4 + (b² − a²)/(2κa).
    let around = "[boundary]\nkind = \"cylinder\"\naxis = \"z\"\nradius = 3\n";
    let to_disk = 4.5 * 2.0_f64.ln() - 0.75;
    let disks = [
        (9, 0.1_f64, "\"absorbing\"", to_disk),
        (10, 0.5, "\"absorbing\"", to_disk),
        (11, 0.1, "\"partial\"\nrate = 2", to_disk + 2.0),
        (12, 0.4, "\"partial\"\nrate = 2", to_disk + 2.0),
    ];
    let disk = |&(seed, spread, kind, expected): &(u64, f64, &str, f64)| {
        let more = format!("{around}{}", receiver(kind, 0.0, 1.0));
        let [found, error] = mean_time(&model(2, spread * spread / 2.0, "[2, 0, 0]", &more), seed);
        let kind = if expected > to_disk { "partial" } else { "absorbing" };
        Row::new(
            format!("mean time to a disk, {kind}, steps of {spread}"),
            expected,
            found,
            4.0 * error + 0.01 * expected,
        )
    };
    rows.par_extend(disks.par_iter().map(disk));
    rows
}
