//! A channel from a transmitter to a receiver.

use std::path::Path;

use lazygrid_sim::philox::Key;
use lazygrid_sim::scenario::Scenario;
use lazygrid_sim::{Model, Schedule};
use rayon::prelude::*;

use crate::Row;
use crate::setup::{begin, steps};

const D: f64 = 100.0;
const R: f64 = 5.0;
const DISTANCE: f64 = 10.0;
const N: u32 = 40;
const SYMBOLS: u32 = 100;
/// Seconds from a symbol to the next, and steps.
const SYMBOL_TIME: f64 = 0.2;
const STEPS: u32 = 50;
/// From so many arrivals on a receiver takes a symbol for 1.
const THRESHOLD: usize = 12;

fn model(numbers: &str) -> Model {
    let text = format!(
        "time-step = {}\nsteps = 1\n[[species]]\nname = \"A\"\ndiffusion = {D}\n\
         [[transmitter]]\nname = \"tx\"\nrandom-bits = {SYMBOLS}\nsymbol-time = {SYMBOL_TIME}\n\
         numbers = \"{numbers}\"\nrelease = [{{ species = \"A\", count = {N} }}]\n\
         [[receiver]]\nname = \"rx\"\ncenter = [{DISTANCE}, 0, 0]\nradius = {R}\nkind = \"absorbing\"\n",
        SYMBOL_TIME / f64::from(STEPS)
    );
    Scenario::parse(Path::new("validation.toml"), text).expect("a scenario").model
}

/// The part of a burst that has arrived at a time after it: (r/d)·erfc((d − r)/√(4DT)).
fn arrived(time: f64) -> f64 {
    if time > 0.0 { R / DISTANCE * libm::erfc((DISTANCE - R) / (4.0 * D * time).sqrt()) } else { 0.0 }
}

/// The probability that fewer than the threshold arrive, of Poisson bursts or of fixed ones, of which those of `parts`
/// of each are in time.
fn too_few(parts: &[f64], is_poisson: bool) -> f64 {
    let mut below = [0.0; THRESHOLD];
    below[0] = 1.0;
    if is_poisson {
        let mean = f64::from(N) * parts.iter().sum::<f64>();
        below[0] = (-mean).exp();
        (1..THRESHOLD).for_each(|k| below[k] = below[k - 1] * mean / k as f64);
    } else {
        // One particle after the other.
        for &part in parts {
            for _ in 0..N {
                (0..THRESHOLD).rev().for_each(|k| {
                    below[k] = below[k] * (1.0 - part) + if k > 0 { below[k - 1] * part } else { 0.0 };
                });
            }
        }
    }
    below.iter().sum()
}

/// On–off keying of random bits with an absorbing receiver: bit errors of a threshold, given what was sent, from the
/// binomial and Poisson numbers that arrive of the burst of a symbol and of all before it.
pub(crate) fn on_off_keying() -> Vec<Row> {
    let parts: Vec<f64> = (0..SYMBOLS)
        .map(|k| arrived(f64::from(k + 1) * SYMBOL_TIME) - arrived(f64::from(k) * SYMBOL_TIME))
        .collect();
    let mut rows = Vec::new();
    for numbers in ["fixed", "poisson"] {
        let model = model(numbers);
        let run = |seed: u64| {
            let Schedule::Message(message) = &model.transmitters[0].schedule else { panic!("no message") };
            let sent: Vec<u32> = (0..SYMBOLS).map(|k| message.symbol(k, 0, Key::new(seed))).collect();
            let mut simulation = begin(&model, seed);
            let (mut before, mut errors, mut expected, mut variance) = (0, 0.0, 0.0, 0.0);
            for now in 0..SYMBOLS as usize {
                steps(&mut simulation, STEPS);
                let all = simulation.state().totals.arrived[0][0];
                let is_one = all - before >= THRESHOLD as u64;
                before = all;
                errors += f64::from(u8::from(is_one != (sent[now] == 1)));
                let bursts: Vec<f64> = (0..=now).filter(|&k| sent[k] == 1).map(|k| parts[now - k]).collect();
                let few = too_few(&bursts, numbers == "poisson");
                let wrong = if sent[now] == 1 { few } else { 1.0 - few };
                expected += wrong;
                variance += wrong * (1.0 - wrong);
            }
            [errors, expected, variance]
        };
        let runs: Vec<[f64; 3]> = (0..12).into_par_iter().map(run).collect();
        let [errors, expected, variance] = [0, 1, 2].map(|k| runs.iter().map(|run| run[k]).sum::<f64>());
        let bits = f64::from(SYMBOLS) * 12.0;
        let what = format!("bit error rate, {numbers} numbers");
        rows.push(Row::new(what, expected / bits, errors / bits, 4.0 * variance.sqrt() / bits));
    }
    rows
}

/// Mean arrivals of concentration and molecule shift keying, symbol by symbol, and of a steady release.
pub(crate) fn other_modulations() -> Vec<Row> {
    let head = format!(
        "time-step = 0.002\nsteps = 1\n[[species]]\nname = \"A\"\ndiffusion = {D}\n\
         [[species]]\nname = \"B\"\ndiffusion = {D}\n\
         [[receiver]]\nname = \"rx\"\ncenter = [{DISTANCE}, 0, 0]\nradius = {R}\nkind = \"absorbing\"\n\
         [[transmitter]]\nname = \"tx\"\n"
    );
    let two = "release = [{ species = \"A\", count = 40000 }, { species = \"B\", count = 40000 }]\n";
    let one = "release = [{ species = \"A\", count = 40000 }]\n";
    let arrivals = |more: &str| {
        let text = format!("{head}{more}");
        let model = Scenario::parse(Path::new("validation.toml"), text).expect("a scenario").model;
        let mut simulation = begin(&model, 5);
        steps(&mut simulation, 200);
        simulation.state().totals.arrived[0].clone()
    };
    let mut rows = Vec::new();
    let mut row = |what: &str, released: f64, part: f64, measured: u64| {
        let tolerance = 4.0 * (released * part * (1.0 - part)).sqrt();
        rows.push(Row::new(what, released * part, measured as f64, tolerance));
    };
    let csk = format!(
        "{one}bits = \"1101\"\nsymbol-time = 0.2\nmodulation = \"csk\"\nlevels = [0, 0.25, 0.5, 1]\n"
    );
    // A whole burst at the beginning, and a quarter of one half way.
    let part = (arrived(0.4) + 0.25 * arrived(0.2)) / 1.25;
    row("concentration shift keying", 50_000.0, part, arrivals(&csk)[0]);
    let mosk = arrivals(&format!("{two}bits = \"01\"\nsymbol-time = 0.2\nmodulation = \"mosk\"\n"));
    row("molecule shift keying, A", 40_000.0, arrived(0.4), mosk[0]);
    row("molecule shift keying, B", 40_000.0, arrived(0.2), mosk[1]);
    let n = 1000;
    let middle = |k: i32| 0.3 * (f64::from(k) + 0.5) / f64::from(n);
    let part = (0..n).map(|k| arrived(0.1 + middle(k))).sum::<f64>() / f64::from(n);
    for numbers in ["fixed", "poisson"] {
        let steady = arrivals(&format!(
            "release = [{{ species = \"A\", rate = 200000 }}]\nuntil = 0.3\nnumbers = \"{numbers}\"\n"
        ));
        row(&format!("steady release, {numbers}"), 60_000.0, part, steady[0]);
    }
    rows
}
