use lazygrid_results::bit_errors::{BitErrors, ReplicaFiles, SymbolDetector};
use lazygrid_results::log::{Log, LoggedArrival};
use lazygrid_results::symbols::{SymbolSlots, messages};
use lazygrid_sim::random::philox::Key;
use lazygrid_sim::{Model, Schedule};
use rayon::prelude::*;

use crate::Row;
use crate::setup::{begin, run_for, scenario, steps};

const D: f64 = 100.0;
const R: f64 = 5.0;
const DISTANCE: f64 = 10.0;
const N: u32 = 40;
const SYMBOLS: u32 = 100;
const SYMBOL_TIME: f64 = 0.2;
const STEPS: u32 = 50;
/// At or above it a receiver reads 1.
const THRESHOLD: usize = 12;

fn model(numbers: &str) -> Model {
    let text = format!(
        "time-step = {}\nsteps = 1\n[[species]]\nname = \"A\"\ndiffusion = {D}\n\
         [[transmitter]]\nname = \"tx\"\nrandom-bits = {SYMBOLS}\nsymbol-time = {SYMBOL_TIME}\n\
         numbers = \"{numbers}\"\nrelease = [{{ species = \"A\", count = {N} }}]\n\
         [[receiver]]\nname = \"rx\"\ncenter = [{DISTANCE}, 0, 0]\nradius = {R}\nkind = \"absorbing\"\n",
        SYMBOL_TIME / f64::from(STEPS)
    );
    scenario(text)
}

fn arrived(time: f64) -> f64 {
    if time > 0.0 { R / DISTANCE * libm::erfc((DISTANCE - R) / (4.0 * D * time).sqrt()) } else { 0.0 }
}

fn too_few(fractions: &[f64], is_poisson: bool) -> f64 {
    let mut below = [0.0; THRESHOLD];
    below[0] = 1.0;
    if is_poisson {
        let mean = f64::from(N) * fractions.iter().sum::<f64>();
        below[0] = (-mean).exp();
        (1..THRESHOLD).for_each(|k| below[k] = below[k - 1] * mean / k as f64);
    } else {
        for &fraction in fractions {
            for _ in 0..N {
                (0..THRESHOLD).rev().for_each(|k| {
                    below[k] =
                        below[k] * (1.0 - fraction) + if k > 0 { below[k - 1] * fraction } else { 0.0 };
                });
            }
        }
    }
    below.iter().sum()
}

pub(crate) fn on_off_keying() -> Vec<Row> {
    let fractions: Vec<f64> = (0..SYMBOLS)
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
                let bursts: Vec<f64> =
                    (0..=now).filter(|&k| sent[k] == 1).map(|k| fractions[now - k]).collect();
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
        let model = scenario(text);
        let simulation = run_for(&model, 5, 200);
        simulation.state().totals.arrived[0].clone()
    };
    let mut rows = Vec::new();
    let mut row = |what: &str, released: f64, fraction: f64, measured: u64| {
        let tolerance = 4.0 * (released * fraction * (1.0 - fraction)).sqrt();
        rows.push(Row::new(what, released * fraction, measured as f64, tolerance));
    };
    let csk = format!(
        "{one}bits = \"1101\"\nsymbol-time = 0.2\nmodulation = \"csk\"\nlevels = [0, 0.25, 0.5, 1]\n"
    );
    let fraction = (arrived(0.4) + 0.25 * arrived(0.2)) / 1.25;
    row("concentration shift keying", 50_000.0, fraction, arrivals(&csk)[0]);
    let mosk = arrivals(&format!("{two}bits = \"01\"\nsymbol-time = 0.2\nmodulation = \"mosk\"\n"));
    row("molecule shift keying, A", 40_000.0, arrived(0.4), mosk[0]);
    row("molecule shift keying, B", 40_000.0, arrived(0.2), mosk[1]);
    let n = 1000;
    let middle = |k: i32| 0.3 * (f64::from(k) + 0.5) / f64::from(n);
    let fraction = (0..n).map(|k| arrived(0.1 + middle(k))).sum::<f64>() / f64::from(n);
    for numbers in ["fixed", "poisson"] {
        let steady = arrivals(&format!(
            "release = [{{ species = \"A\", rate = 200000 }}]\nuntil = 0.3\nnumbers = \"{numbers}\"\n"
        ));
        row(&format!("steady release, {numbers}"), 60_000.0, fraction, steady[0]);
    }
    rows
}

const FEW_SYMBOLS: u32 = 30;
const RUNS: u64 = 16;
/// Levels begin at these arrivals.
const THRESHOLDS: [u64; 3] = [14, 30, 52];
const MOST: u32 = 120;
const OF_A_SPECIES: u32 = 15;

/// Probability of each number of arrivals of bursts (size, fraction in time).
fn arrivals_of(bursts: &[(u32, f64)]) -> Vec<f64> {
    let mut chances = vec![1.0];
    for &(count, fraction) in bursts {
        for _ in 0..count {
            chances.resize(chances.len() + 1, 0.0);
            for k in (0..chances.len()).rev() {
                chances[k] =
                    chances[k] * (1.0 - fraction) + if k > 0 { chances[k - 1] * fraction } else { 0.0 };
            }
        }
    }
    chances
}

/// Probability of each received symbol; `sent` begins with the latest burst.
fn taken_for(modulation: &str, sent: &[u32], fractions: &[f64]) -> [f64; 4] {
    let ago = |k: usize| fractions[sent.len() - 1 - k];
    if modulation == "csk" {
        let bursts: Vec<_> = (0..sent.len()).map(|k| (MOST * sent[k] / 3, ago(k))).collect();
        let mut taken = [0.0; 4];
        for (count, chance) in (0..).zip(arrivals_of(&bursts)) {
            taken[THRESHOLDS.partition_point(|&threshold| threshold <= count)] += chance;
        }
        return taken;
    }
    let of = |species: u32| {
        let bursts = (0..sent.len()).filter(|&k| sent[k] == species).map(|k| (OF_A_SPECIES, ago(k)));
        arrivals_of(&bursts.collect::<Vec<_>>())
    };
    let counts = [0, 1, 2, 3].map(of);
    std::array::from_fn(|symbol| {
        let wins = |count: usize| -> f64 {
            let below = |other: usize| -> f64 {
                let most = if other < symbol { count } else { count + 1 };
                counts[other].iter().take(most).sum()
            };
            (0..4).filter(|&other| other != symbol).map(below).product()
        };
        counts[symbol].iter().enumerate().map(|(count, chance)| chance * wins(count)).sum()
    })
}

pub(crate) fn shift_keying() -> Vec<Row> {
    let time = |k: u32| f64::from(k) * SYMBOL_TIME;
    let fractions: Vec<f64> = (0..FEW_SYMBOLS).map(|k| arrived(time(k + 1)) - arrived(time(k))).collect();
    let of = |modulation: &'static str| {
        let species =
            ["A", "B", "C", "D"].map(|name| format!("[[species]]\nname = \"{name}\"\ndiffusion = {D}\n"));
        let entry = |name: &str, count: u32| format!("{{ species = \"{name}\", count = {count} }}");
        let release = match modulation {
            "csk" => {
                format!("release = [{}]\nlevels = [0, {}, {}, 1]", entry("A", MOST), 1.0 / 3.0, 2.0 / 3.0)
            }
            _ => format!(
                "release = [{}]",
                ["A", "B", "C", "D"].map(|name| entry(name, OF_A_SPECIES)).join(", ")
            ),
        };
        let text = format!(
            "time-step = {}\nsteps = 1\n{}\n[[transmitter]]\nname = \"tx\"\nrandom-bits = {}\n\
             symbol-time = {SYMBOL_TIME}\nmodulation = \"{modulation}\"\n{release}\n\
             [[receiver]]\nname = \"rx\"\ncenter = [{DISTANCE}, 0, 0]\nradius = {R}\nkind = \"absorbing\"\n\
             [output]\narrivals = true\n",
            SYMBOL_TIME / f64::from(STEPS),
            species.concat(),
            2 * FEW_SYMBOLS
        );
        let model = scenario(text);
        let run = |seed: u64| {
            let mut simulation = begin(&model, seed);
            let mut log = Log::default();
            for step in 1..=FEW_SYMBOLS * STEPS {
                steps(&mut simulation, 1);
                let one = |arrival: &lazygrid_sim::Arrival| {
                    let [receiver, species] = [arrival.receiver, arrival.species].map(|index| index as usize);
                    LoggedArrival { step, receiver, species, origin: None }
                };
                log.arrivals.extend(simulation.arrivals().iter().map(one));
            }
            let (_, message) = messages(&model).next().expect("a message");
            let mut errors = BitErrors::new(&model, message, [0, 0], SymbolDetector::Arrivals, 0);
            let files = ReplicaFiles { seed, log, ..ReplicaFiles::default() };
            let slots = SymbolSlots::new(message, model.time_step, 0, FEW_SYMBOLS * STEPS);
            errors.add(&files, &model, &slots);
            let thresholds = if modulation == "csk" { &THRESHOLDS[..] } else { &[] };
            let sent: Vec<u32> = (0..FEW_SYMBOLS).map(|k| message.symbol(k, 0, Key::new(seed))).collect();
            let (mut expected, mut variance) = (0.0, 0.0);
            for now in 0..sent.len() {
                let taken = taken_for(modulation, &sent[..=now], &fractions);
                let wrong = |symbol: usize| f64::from((symbol as u32 ^ sent[now]).count_ones());
                let moment = |power: i32| (0..4).map(|k| taken[k] * wrong(k).powi(power)).sum::<f64>();
                expected += moment(1);
                variance += moment(2) - moment(1).powi(2);
            }
            assert_eq!(errors.bits, 2 * u64::from(FEW_SYMBOLS));
            [errors.at(thresholds).1 as f64, expected, variance]
        };
        let runs: Vec<[f64; 3]> = (0..RUNS).into_par_iter().map(run).collect();
        let [errors, expected, variance] = [0, 1, 2].map(|k| runs.iter().map(|run| run[k]).sum::<f64>());
        let bits = 2.0 * f64::from(FEW_SYMBOLS) * RUNS as f64;
        let what = format!("bit error rate, {modulation} of four symbols");
        Row::new(what, expected / bits, errors / bits, 4.0 * variance.sqrt() / bits)
    };
    ["csk", "mosk"].map(of).into()
}
