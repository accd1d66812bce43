//! lazygrid compared with parry3d, one thread with two, and small inputs with large ones.
#![allow(clippy::print_stdout)]

mod sizes;

use std::error::Error;
use std::fmt::Write as _;
use std::path::PathBuf;

use clap::{Parser, ValueEnum};
use lazygrid::{Algorithm, Backend, Config, Order, Skin};
use lazygrid_bench::measure::{ContenderFactory, Options, Plan, Timing, compare, markdown, provenance};
use lazygrid_bench::peers::{cell_list, lammps, parry, verlet};
use lazygrid_io::scenes::Scene;

/// Largest input of the naive algorithm, whose time grows quadratically.
const NAIVE_LIMIT: usize = 20_000;

#[derive(Parser)]
#[command(about = "lazygrid compared with parry3d; checks that all pairs are equal before it reports times")]
struct Args {
    /// Comparisons, separated by commas
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [Mode::Running, Mode::Scratch])]
    mode: Vec<Mode>,
    /// Algorithms, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = ALGORITHMS)]
    algorithm: Vec<Algorithm>,
    /// Results of lazygrid, separated by commas
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [Output::List, Output::Unordered, Output::Count])]
    output: Vec<Output>,
    /// Number of threads of `--mode sizes`
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Search at each step, without a skin
    #[arg(long)]
    rebuild: bool,
    /// Write each value to this CSV file
    #[arg(long)]
    csv: Option<PathBuf>,
    /// Measure the time and memory of one detector in this process, for `--mode sizes`
    #[arg(long, hide = true)]
    child: bool,
    #[command(flatten)]
    options: Options,
}

const ALGORITHMS: [Algorithm; 6] = [
    Algorithm::CellList,
    Algorithm::ArrayGrid,
    Algorithm::RecursiveGrid,
    Algorithm::HashGrid,
    Algorithm::Naive,
    Algorithm::Auto,
];

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Mode {
    /// Steps of a simulation, each detector or tree kept between steps; one thread.
    Running,
    /// Settings of Bullet, kept between steps; one thread.
    #[cfg(feature = "bullet")]
    Bullet,
    /// Skins of the Verlet list and, for equal spheres, of LAMMPS, kept between steps; one thread.
    Skins,
    /// Settings of the plain cell list compared with parry3d's tree, kept between steps; one thread.
    Yardstick,
    /// One call from arbitrary order; one thread.
    Scratch,
    /// One thread compared with two.
    Threads,
    /// Growing numbers of spheres, each in a separate process.
    Sizes,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Output {
    /// List in canonical order.
    List,
    /// List in any order.
    Unordered,
    /// List in any order, streamed in chunks that are dropped.
    Stream,
    /// Only the number of pairs.
    Count,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = Args::parse();
    if args.child {
        return sizes::child(&args);
    }
    if args.options.is_quick() {
        args.mode = Mode::value_variants().into();
    }
    args.options = args.options.shrunk();
    println!("{}\n", provenance());
    let mut csv = String::from("mode,scene,n,contender,round,ns_per_sphere_and_step\n");
    for &mode in &args.mode {
        if mode == Mode::Sizes {
            sizes::run(&args)?;
            continue;
        }
        for plan in args.options.plans() {
            let plan = plan_for(mode, plan);
            let timings = compare(&plan, &contenders(mode, &args, &plan))?;
            if args.options.is_quick() {
                println!(
                    "{mode:?}, {}: {} searches agree on {} pairs",
                    plan.scene,
                    timings.len(),
                    timings[0].pairs
                );
                continue;
            }
            println!("{}", heading(mode, &plan));
            match mode {
                Mode::Threads => println!("{}", threads_table(&timings)),
                _ => println!("{}{}", peers_table(&timings), grids_line(&timings)),
            }
            append(&mut csv, mode, &plan, &timings)?;
        }
    }
    if let Some(path) = &args.csv {
        std::fs::write(path, csv)?;
    }
    Ok(())
}

fn plan_for(mode: Mode, plan: Plan) -> Plan {
    // Without state between steps, a step is equivalent to a round.
    if mode == Mode::Scratch { Plan { fresh: true, steps: 1, ..plan } } else { plan }
}

fn heading(mode: Mode, plan: &Plan) -> String {
    let Plan { scene, n, seed, rounds, steps, .. } = plan;
    let what = match mode {
        Mode::Running | Mode::Skins | Mode::Yardstick => "kept from step to step, one thread",
        #[cfg(feature = "bullet")]
        Mode::Bullet => "kept from step to step, one thread",
        Mode::Scratch => "from scratch, one thread",
        Mode::Threads => "kept from step to step, one thread and two",
        Mode::Sizes => "growing input",
    };
    format!(
        "### {scene}, {n} spheres, {what} ({rounds} rounds of {steps} steps after one to warm up, seed {seed})\n"
    )
}

fn contenders(mode: Mode, args: &Args, plan: &Plan) -> Vec<ContenderFactory> {
    let mut contenders = match mode {
        Mode::Running => parry::incremental(),
        Mode::Yardstick => {
            std::iter::once(parry::refitted("parry3d refit")).chain(cell_list::tunings(plan.scene)).collect()
        }
        Mode::Skins => {
            let of_lammps = if plan.scene == Scene::Equal { lammps::skins() } else { vec![] };
            verlet::skins(plan.scene).into_iter().chain(of_lammps).collect()
        }
        Mode::Scratch => parry::from_scratch(),
        #[cfg(feature = "bullet")]
        Mode::Bullet => lazygrid_bench::peers::bullet::tunings(plan.scene),
        Mode::Threads | Mode::Sizes => vec![],
    };
    let threads: &[usize] = if mode == Mode::Threads { &[1, 2] } else { &[1] };
    for &algorithm in args.algorithm.iter().filter(|&&a| a != Algorithm::Naive || plan.n <= NAIVE_LIMIT) {
        for &output in &args.output {
            contenders.extend(threads.iter().map(|&threads| contender(args, algorithm, output, threads)));
        }
    }
    contenders
}

fn config(args: &Args, algorithm: Algorithm, output: Output, threads: usize) -> Config {
    let order = if output == Output::List { Order::Canonical } else { Order::Unordered };
    let skin = if args.rebuild { Skin::Off } else { Skin::Auto };
    Config::default().backend(Backend::Cpu).algorithm(algorithm).threads(threads).order(order).skin(skin)
}

fn contender(args: &Args, algorithm: Algorithm, output: Output, threads: usize) -> ContenderFactory {
    let config = config(args, algorithm, output, threads);
    match output {
        Output::List => ContenderFactory::list(algorithm.name(), config),
        Output::Unordered => ContenderFactory::list(format!("{algorithm}, unordered"), config),
        Output::Stream => ContenderFactory::stream(format!("{algorithm}, stream"), config),
        Output::Count => ContenderFactory::count(format!("{algorithm}, count"), config),
    }
}

fn peers_table(timings: &[Timing]) -> String {
    let trees = timings.iter().filter(|t| t.name.starts_with("parry3d"));
    let best = trees.min_by(|a, b| a.median().total_cmp(&b.median()));
    let row = |timing: &Timing| {
        let ratio = best.map_or_else(String::new, |best| best.over(timing).to_string());
        let chosen = if timing.name.starts_with("auto") { timing.note.clone() } else { String::new() };
        vec![timing.name.clone(), format!("{:.1}", timing.median()), ratio, timing.pairs.to_string(), chosen]
    };
    let tree = best.map_or("parry3d", |t| t.name.as_str());
    let faster = format!("times as fast as {tree} (range)");
    markdown(
        &["search", "ns per sphere and step", &faster, "pairs", "chosen"],
        &timings.iter().map(row).collect::<Vec<_>>(),
    )
}

fn grids_line(timings: &[Timing]) -> String {
    let find = |algorithm: Algorithm| timings.iter().find(|t| t.name == algorithm.name());
    match (find(Algorithm::ArrayGrid), find(Algorithm::RecursiveGrid)) {
        (Some(array), Some(recursive)) => {
            format!("\nrecursive-grid is {} times as fast as array-grid.\n", array.over(recursive))
        }
        _ => String::new(),
    }
}

fn threads_table(timings: &[Timing]) -> String {
    let row = |pair: &[Timing]| {
        let [one, two] = pair else { return vec![] };
        let nanos = |t: &Timing| format!("{:.1}", t.median());
        vec![one.name.clone(), nanos(one), nanos(two), one.over(two).to_string()]
    };
    markdown(
        &["search", "one thread, ns per sphere and step", "two threads", "times as fast (range)"],
        &timings.chunks(2).map(row).collect::<Vec<_>>(),
    )
}

fn append(csv: &mut String, mode: Mode, plan: &Plan, timings: &[Timing]) -> Result<(), std::fmt::Error> {
    let mode = value_name(mode);
    for timing in timings {
        for (round, nanos) in timing.nanos.iter().enumerate() {
            writeln!(csv, "{mode},{},{},\"{}\",{round},{nanos}", plan.scene, plan.n, timing.name)?;
        }
    }
    Ok(())
}

fn value_name(value: impl ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}
