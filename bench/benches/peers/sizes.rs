use std::collections::BTreeMap;
use std::error::Error;
use std::process::Command;

use lazygrid::{Algorithm, Detector};
use lazygrid_bench::measure::{Spread, markdown, memory};
use lazygrid_io::scenes::Scene;

use crate::{Args, NAIVE_LIMIT, Output, config, contender, value_name};

/// A measurement, and the bytes per sphere by [`Detector::memory_for`].
type Sample = (memory::Sample, f64);

#[derive(Clone, Copy)]
struct SweepCase {
    scene: Scene,
    algorithm: Algorithm,
    output: Output,
}

/// Number of pairs and checksum, by scene and number of spheres.
type Answers = BTreeMap<(&'static str, usize), (u64, Option<u64>)>;

pub(crate) fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let (mut rows, mut answers) = (vec![], Answers::new());
    for &scene in &args.options.scene {
        for &algorithm in &args.algorithm {
            for &output in &args.output {
                rows.extend(rows_of(args, SweepCase { scene, algorithm, output }, &mut answers)?);
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

fn rows_of(args: &Args, case: SweepCase, answers: &mut Answers) -> Result<Vec<Vec<String>>, Box<dyn Error>> {
    let SweepCase { scene, algorithm, output } = case;
    let sizes = args.options.n.iter().copied();
    let sizes: Vec<usize> = sizes.filter(|&n| algorithm != Algorithm::Naive || n <= NAIVE_LIMIT).collect();
    let mut samples = vec![vec![]; sizes.len()];
    for _ in 0..args.options.rounds {
        for (k, &n) in sizes.iter().enumerate() {
            let sample = spawn(args, case, n)?;
            check(answers, case, n, &sample.0)?;
            samples[k].push(sample);
        }
    }
    let row = |k: usize| {
        let over_first: Vec<f64> =
            samples[k].iter().zip(&samples[0]).map(|(s, first)| s.0.nanos / first.0.nanos).collect();
        let median = |value: fn(&Sample) -> f64| {
            let values: Vec<f64> = samples[k].iter().map(value).collect();
            format!("{:.1}", Spread::from_values(&values).median)
        };
        vec![
            scene.to_string(),
            algorithm.to_string(),
            value_name(output),
            sizes[k].to_string(),
            median(|s| s.0.first),
            median(|s| s.0.nanos),
            Spread::from_values(&over_first).to_string(),
            median(|s| s.0.bytes.unwrap_or(f64::NAN)),
            median(|s| s.1),
        ]
    };
    Ok((0..sizes.len()).map(row).collect())
}

fn spawn(args: &Args, case: SweepCase, n: usize) -> Result<Sample, Box<dyn Error>> {
    let SweepCase { scene, algorithm, output } = case;
    let options = &args.options;
    let mut command = Command::new(std::env::current_exe()?);
    command.args(["--child", "--scene", scene.name(), "--algorithm", algorithm.name()]);
    command.args(["--output", &value_name(output), "--threads", &args.threads.to_string()]);
    command.args(args.rebuild.then_some("--rebuild"));
    command.args(["--n", &n.to_string(), "--steps", &options.steps.to_string()]);
    command.args(["--seed", &options.seed.to_string()]);
    let output = command.output()?;
    Ok(serde_json::from_slice(&output.stdout).map_err(|error| {
        let reason = String::from_utf8_lossy(&output.stderr);
        format!("{algorithm} at {n} spheres of {scene}: {}, {error}, {reason}", output.status)
    })?)
}

fn check(
    answers: &mut Answers,
    case: SweepCase,
    n: usize,
    sample: &memory::Sample,
) -> Result<(), Box<dyn Error>> {
    let (pairs, sum) = answers.entry((case.scene.name(), n)).or_insert((sample.pairs, sample.sum));
    *sum = sum.or(sample.sum);
    if *pairs != sample.pairs || sample.sum.is_some_and(|found| *sum != Some(found)) {
        let SweepCase { scene, algorithm, .. } = case;
        let found = sample.pairs;
        return Err(format!("{algorithm}, {n} spheres of {scene}: {found} pairs, not {pairs}").into());
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
    println!("{}", serde_json::to_string(&(sample, estimate))?);
    Ok(())
}
