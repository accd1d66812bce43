//! Time and memory per sphere for growing numbers of spheres, each in a separate process.

use std::collections::BTreeMap;
use std::error::Error;
use std::process::Command;

use clap::ValueEnum as _;
use lazygrid::{Algorithm, Detector};
use lazygrid_bench::measure::{Spread, markdown, memory};
use lazygrid_io::scenes::Scene;

use crate::{Args, NAIVE_LIMIT, Output, config, contender};

#[derive(Clone, Copy)]
struct Sample {
    first: f64,
    nanos: f64,
    /// Peak bytes per sphere besides spheres and result; NaN if the system does not report it.
    bytes: f64,
    estimate: f64,
    pairs: u64,
    /// `None` if pairs were only counted.
    sum: Option<u64>,
}

#[derive(Clone, Copy)]
struct Kind {
    scene: Scene,
    algorithm: Algorithm,
    output: Output,
}

/// Numbers of pairs and their sums, by scene and number of spheres.
type Answers = BTreeMap<(&'static str, usize), (u64, Option<u64>)>;

pub(crate) fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let (mut rows, mut answers) = (vec![], Answers::new());
    for &scene in &args.options.scene {
        for &algorithm in &args.algorithm {
            for &output in &args.output {
                rows.extend(rows_of(args, Kind { scene, algorithm, output }, &mut answers)?);
            }
        }
    }
    let header = [
        "scene",
        "algorithm",
        "output",
        "spheres",
        "ns per sphere, first call",
        "then, per step",
        "over the first size (range)",
        "bytes per sphere besides input and result",
        "bytes by `memory_for`",
    ];
    if args.options.is_quick() {
        println!("Sizes: {} kinds of child process answered", rows.len());
        return Ok(());
    }
    println!("### Growing input, threads: {}\n\n{}", args.threads, markdown(&header, &rows));
    Ok(())
}

fn rows_of(args: &Args, kind: Kind, answers: &mut Answers) -> Result<Vec<Vec<String>>, Box<dyn Error>> {
    let Kind { scene, algorithm, output } = kind;
    let sizes = args.options.n.iter().copied();
    let sizes: Vec<usize> = sizes.filter(|&n| algorithm != Algorithm::Naive || n <= NAIVE_LIMIT).collect();
    let mut samples = vec![vec![]; sizes.len()];
    for _ in 0..args.options.rounds {
        for (k, &n) in sizes.iter().enumerate() {
            let sample = spawn(args, kind, n)?;
            check(answers, kind, n, &sample)?;
            samples[k].push(sample);
        }
    }
    let row = |k: usize| {
        let over_first: Vec<f64> =
            samples[k].iter().zip(&samples[0]).map(|(s, first)| s.nanos / first.nanos).collect();
        let median = |of: fn(&Sample) -> f64| {
            let values: Vec<f64> = samples[k].iter().map(of).collect();
            format!("{:.1}", Spread::of(&values).median)
        };
        vec![
            scene.to_string(),
            algorithm.to_string(),
            name(output),
            sizes[k].to_string(),
            median(|s| s.first),
            median(|s| s.nanos),
            Spread::of(&over_first).to_string(),
            median(|s| s.bytes),
            median(|s| s.estimate),
        ]
    };
    Ok((0..sizes.len()).map(row).collect())
}

fn name(output: Output) -> String {
    output.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

fn spawn(args: &Args, kind: Kind, n: usize) -> Result<Sample, Box<dyn Error>> {
    let Kind { scene, algorithm, output } = kind;
    let options = &args.options;
    let mut command = Command::new(std::env::current_exe()?);
    command.args(["--child", "--scene", scene.name(), "--algorithm", algorithm.name()]);
    command.args(["--output", &name(output), "--threads", &args.threads.to_string()]);
    command.args(args.rebuild.then_some("--rebuild"));
    command.args(["--n", &n.to_string(), "--steps", &options.steps.to_string()]);
    command.args(["--seed", &options.seed.to_string()]);
    let output = command.output()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let words: Vec<&str> = text.split_whitespace().collect();
    let [first, nanos, bytes, estimate, pairs, sum] = words[..] else {
        let reason = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{algorithm} at {n} spheres of {scene}: {}, {reason}", output.status).into());
    };
    let [first, nanos, bytes, estimate] = [first.parse()?, nanos.parse()?, bytes.parse()?, estimate.parse()?];
    Ok(Sample { first, nanos, bytes, estimate, pairs: pairs.parse()?, sum: sum.parse().ok() })
}

/// Checks that a sample has the answer of earlier ones of the same spheres.
fn check(answers: &mut Answers, kind: Kind, n: usize, sample: &Sample) -> Result<(), Box<dyn Error>> {
    let (pairs, sum) = answers.entry((kind.scene.name(), n)).or_insert((sample.pairs, sample.sum));
    *sum = sum.or(sample.sum);
    if *pairs != sample.pairs || sample.sum.is_some_and(|found| *sum != Some(found)) {
        let Kind { scene, algorithm, .. } = kind;
        let message =
            format!("{algorithm} finds other pairs of {n} spheres of {scene}: {}, not {pairs}", sample.pairs);
        return Err(message.into());
    }
    Ok(())
}

pub(crate) fn child(args: &Args) -> Result<(), Box<dyn Error>> {
    let options = &args.options;
    let (scene, n, algorithm, output) = (options.scene[0], options.n[0], args.algorithm[0], args.output[0]);
    let contender = contender(args, algorithm, output, args.threads);
    let sample = memory::sample(&contender, scene, n, options.steps as u32, options.seed)?;
    let detector = Detector::new(config(args, algorithm, output, args.threads))?;
    let estimate = detector.memory_for(n as u64) as f64 / n as f64;
    let sum = sample.sum.map_or("none".to_owned(), |sum| sum.to_string());
    let bytes = sample.bytes.unwrap_or(f64::NAN);
    println!("{} {} {bytes} {estimate} {} {sum}", sample.first, sample.nanos, sample.pairs);
    Ok(())
}
