//! Measurements for the defaults: τ and the cell ratio of the paper's grids, and crossovers.
#![allow(clippy::print_stdout)]

use std::error::Error;

use clap::{Parser, ValueEnum};
use lazygrid::gpu::GpuConfig;
use lazygrid::{Algorithm, Backend, Config, Order, Skin};
use lazygrid_bench::measure::{ContenderFactory, Options, Plan, compare, markdown, provenance};
use lazygrid_io::scenes::Scene;

#[derive(Parser)]
#[command(about = "Times of the algorithms by their settings and by the number of spheres")]
struct Args {
    /// Backend: cpu or gpu, also with a software adapter
    #[arg(long, default_value_t = Backend::Cpu)]
    backend: Backend,
    /// Parameters to vary, separated by commas
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [Parameter::Tau, Parameter::CellRatio, Parameter::Crossover])]
    what: Vec<Parameter>,
    /// Values of τ, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [0, 4, 8, 16, 32, 64, 128, 256])]
    tau: Vec<u32>,
    /// Cell ratios (cell size over largest diameter), separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0, 4.0])]
    cell_ratio: Vec<f32>,
    /// Numbers of spheres of the crossover, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [10, 30, 100, 200, 300, 500, 1000, 2000, 5000, 20_000])]
    sizes: Vec<usize>,
    /// Fixed skins as fractions of the largest diameter, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [0.125, 0.25, 0.5, 1.0])]
    skin: Vec<f32>,
    /// Number of threads
    #[arg(long, default_value_t = 1)]
    threads: usize,
    #[command(flatten)]
    options: Options,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Parameter {
    /// τ of the recursive grid; on the GPU, of LazyGrid at each cell ratio.
    Tau,
    /// Cell ratio (cell size over largest diameter) of the paper's grids.
    CellRatio,
    /// All algorithms as the number of spheres grows.
    Crossover,
    /// Skins on the CPU, fixed ones as fractions of the largest diameter; a round should have many steps.
    Skin,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = Args::parse();
    if args.options.is_quick() {
        args.sizes = vec![0, 1, 10, 100];
    }
    args.options = args.options.shrunk();
    println!("{}\n", provenance());
    // A pool per detector would add a thread switch to each call.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads).build()?;
    Ok(pool
        .install(|| args.what.iter().try_for_each(|&what| sweep(&args, what).map_err(|e| e.to_string())))?)
}

fn sweep(args: &Args, what: Parameter) -> Result<(), Box<dyn Error>> {
    match what {
        Parameter::Tau => tau(args),
        Parameter::CellRatio => cell_ratio(args),
        Parameter::Crossover => crossover(args),
        Parameter::Skin => skin(args),
    }
}

impl Args {
    fn config(&self, algorithm: Algorithm) -> Config {
        // Only some algorithms keep a candidate list, which would shift the crossover.
        Config::default().backend(self.backend).order(Order::Unordered).algorithm(algorithm).skin(Skin::Off)
    }

    fn ratios(&self) -> impl Iterator<Item = f32> {
        let least = if self.backend == Backend::Gpu { GpuConfig::MIN_CELL_RATIO } else { 0.0 };
        self.cell_ratio.iter().copied().filter(move |&ratio| ratio >= least)
    }
}

fn tau(args: &Args) -> Result<(), Box<dyn Error>> {
    let contenders = |config: Config| -> Vec<ContenderFactory> {
        args.tau.iter().map(|&tau| ContenderFactory::list(tau.to_string(), config.clone().tau(tau))).collect()
    };
    if args.backend == Backend::Cpu {
        let table = table(args, &contenders(args.config(Algorithm::RecursiveGrid)))?;
        println!("### recursive-grid over τ, ns per sphere and step\n\n{table}");
        return Ok(());
    }
    for ratio in args.ratios() {
        let table = table(args, &contenders(args.config(Algorithm::LazyGrid).cell_ratio(ratio)))?;
        println!("### lazy-grid over τ at cell ratio {ratio}, ns per sphere and step\n\n{table}");
    }
    Ok(())
}

fn cell_ratio(args: &Args) -> Result<(), Box<dyn Error>> {
    let algorithms = match args.backend {
        Backend::Cpu => [Algorithm::ArrayGrid, Algorithm::HashGrid, Algorithm::RecursiveGrid],
        _ => [Algorithm::ArrayGrid, Algorithm::EagerGrid, Algorithm::LazyGrid],
    };
    for algorithm in algorithms {
        let contender =
            |ratio: f32| ContenderFactory::list(ratio.to_string(), args.config(algorithm).cell_ratio(ratio));
        let table = table(args, &args.ratios().map(contender).collect::<Vec<_>>())?;
        println!("### {algorithm} over the cell ratio, ns per sphere and step\n\n{table}");
    }
    Ok(())
}

fn skin(args: &Args) -> Result<(), Box<dyn Error>> {
    let config = |skin| args.config(Algorithm::Auto).skin(skin);
    let mut contenders = vec![
        ContenderFactory::list("off", config(Skin::Off)),
        ContenderFactory::list("auto", config(Skin::Auto)),
    ];
    let fixed = |&fraction: &f32| {
        ContenderFactory::list(fraction.to_string(), config(Skin::Fixed(f64::from(2.0 * fraction))))
    };
    contenders.extend(args.skin.iter().map(fixed));
    let step_length = args.options.step_length;
    println!(
        "### skins, steps of {step_length} radii, ns per sphere and step\n\n{}",
        table(args, &contenders)?
    );
    Ok(())
}

fn table(args: &Args, contenders: &[ContenderFactory]) -> Result<String, Box<dyn Error>> {
    let mut rows = vec![];
    for plan in args.options.plans() {
        let mut row = vec![plan.scene.to_string(), plan.n.to_string()];
        row.extend(fastest_in_bold(&plan, contenders)?);
        rows.push(row);
    }
    let names = contenders.iter().map(|c| c.name.as_str());
    Ok(markdown(&["scene", "spheres"].into_iter().chain(names).collect::<Vec<_>>(), &rows))
}

fn crossover(args: &Args) -> Result<(), Box<dyn Error>> {
    let algorithms: &[Algorithm] = match args.backend {
        Backend::Cpu => Algorithm::CPU,
        _ => Algorithm::GPU,
    };
    let contenders: Vec<ContenderFactory> =
        algorithms.iter().map(|&a| ContenderFactory::list(a.name(), args.config(a))).collect();
    let mut rows = vec![];
    for &scene in &args.options.scene {
        for &n in &args.sizes {
            let steps = if args.options.is_quick() {
                2
            } else {
                (100_000 / n.max(1)).clamp(args.options.steps, 1000)
            };
            let Options { rounds, seed, .. } = args.options;
            let plan = Plan { scene, n, seed, rounds, steps, step_length: Scene::STEP, fresh: false };
            let mut row = vec![scene.to_string(), n.to_string()];
            row.extend(fastest_in_bold(&plan, &contenders)?);
            rows.push(row);
        }
    }
    let names = contenders.iter().map(|c| c.name.as_str());
    let header: Vec<&str> = ["scene", "spheres"].into_iter().chain(names).collect();
    println!(
        "### Algorithms over the number of spheres, ns per sphere and step\n\n{}",
        markdown(&header, &rows)
    );
    Ok(())
}

fn fastest_in_bold(plan: &Plan, contenders: &[ContenderFactory]) -> Result<Vec<String>, Box<dyn Error>> {
    let medians: Vec<f64> = compare(plan, contenders)?.iter().map(|t| t.median()).collect();
    let fastest = medians.iter().copied().fold(f64::INFINITY, f64::min);
    let cell = |m: f64| if m == fastest { format!("**{m:.1}**") } else { format!("{m:.1}") };
    Ok(medians.into_iter().map(cell).collect())
}
