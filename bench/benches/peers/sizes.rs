//! Time and memory per sphere for growing numbers of spheres, each in a separate process.

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
}

#[derive(Clone, Copy)]
struct Kind {
    scene: Scene,
    algorithm: Algorithm,
    output: Output,
}

pub(crate) fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let mut rows = vec![];
    for &scene in &args.options.scene {
        for &algorithm in &args.algorithm {
            for &output in &args.output {
                rows.extend(rows_of(args, Kind { scene, algorithm, output })?);
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

fn rows_of(args: &Args, kind: Kind) -> Result<Vec<Vec<String>>, Box<dyn Error>> {
    let Kind { scene, algorithm, output } = kind;
    let sizes = args.options.n.iter().copied();
    let sizes: Vec<usize> = sizes.filter(|&n| algorithm != Algorithm::Naive || n <= NAIVE_LIMIT).collect();
    let mut samples = vec![vec![]; sizes.len()];
    for _ in 0..args.options.rounds {
        for (k, &n) in sizes.iter().enumerate() {
            samples[k].push(spawn(args, kind, n)?);
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
    let values: Vec<f64> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
    match values[..] {
        [first, nanos, bytes, estimate] => Ok(Sample { first, nanos, bytes, estimate }),
        _ => {
            let reason = String::from_utf8_lossy(&output.stderr);
            Err(format!("{algorithm} at {n} spheres of {scene}: {}, {reason}", output.status).into())
        }
    }
}

pub(crate) fn child(args: &Args) -> Result<(), Box<dyn Error>> {
    let options = &args.options;
    let (scene, n, algorithm, output) = (options.scene[0], options.n[0], args.algorithm[0], args.output[0]);
    let contender = contender(args, algorithm, output, args.threads);
    let sample = memory::sample(&contender, scene, n, options.steps as u32, options.seed)?;
    let detector = Detector::new(config(args, algorithm, output, args.threads))?;
    let estimate = detector.memory_for(n as u64) as f64 / n as f64;
    println!("{} {} {} {estimate}", sample.first, sample.nanos, sample.bytes.unwrap_or(f64::NAN));
    Ok(())
}
