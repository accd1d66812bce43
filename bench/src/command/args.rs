use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Parser, Subcommand};
use lazygrid::gpu::AdapterId;
use lazygrid_bench::figures::Figure;
use lazygrid_io::scenes::Scene;
use lazygrid_kernels::kernel::KERNELS;

/// Repeat the paper's figures on this machine, compare runs, and inspect GPU kernels as Vulkan drivers compile them.
#[derive(Debug, Parser)]
#[command(name = "lazygrid-bench", version, arg_required_else_help = true)]
#[command(after_help = "Exit code: 0 success; 1 wrong answer, regression or failure; 2 wrong usage.")]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Repeat the paper's evaluation on this machine and write a report
    Figures(Figures),
    /// List what became slower between two folders of figures
    Compare(Compare),
    /// Write RESULTS-GPU.md: the times that arithmetic expects of GPUs, and measured ones
    GpuResults(GpuResults),
    /// Compile the GPU kernels with Vulkan drivers and print the drivers' statistics
    Kernels(Kernels),
    #[command(hide = true)]
    MeasureMemory(MeasureMemory),
}

/// Repeat the paper's evaluation on this machine. Engines take turns on the same spheres, and each answer is checked
/// before its time counts. Writes results.json, results.csv, plots, report.html and results.md.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "An interrupted run resumes if settings and build are the same. Exit code 1 if an engine gave a wrong answer.
Bullet takes part if built with --features bullet, LAMMPS if LAZYGRID_LAMMPS_LIB names its library.

Examples:
  lazygrid-bench figures --quick
  lazygrid-bench figures --only 4 --budget-minutes 5 --out trees"
)]
pub(crate) struct Figures {
    /// Smaller sizes and fewer runs: under three minutes on two cores
    #[arg(long)]
    pub(crate) quick: bool,
    /// Smoke sizes: checks answers, times are meaningless
    #[arg(long, conflicts_with = "quick")]
    pub(crate) smoke: bool,
    /// Only these figures, separated by commas [default: all]
    #[arg(long, value_name = "FIGURE", value_delimiter = ',', value_parser = one_of(Figure::ALL.map(Figure::name)).try_map(|name| name.parse::<Figure>()))]
    pub(crate) only: Vec<Figure>,
    /// Folder for results; finished points in it are not run again
    #[arg(long, value_name = "DIR", default_value = "figures")]
    pub(crate) out: PathBuf,
    /// Maximum number of runs, or steps, of each engine at each point [default: as in the paper, fewer with --quick]
    #[arg(long, value_name = "N")]
    pub(crate) runs: Option<NonZeroUsize>,
    /// Approximate time budget in minutes [default: 30, with --quick 1.75]
    #[arg(long, value_name = "M", value_parser = minutes)]
    pub(crate) budget_minutes: Option<f64>,
}

/// List the measurements that changed by more than their noise between two runs: medians more than 5 % apart, with
/// disjoint middle halves. Exit code 1 if any broke, was lost, or became slower or larger.
#[derive(Debug, clap::Args)]
pub(crate) struct Compare {
    /// Folder of the older run
    pub(crate) old: PathBuf,
    /// Folder of the newer run
    pub(crate) new: PathBuf,
}

/// Write a document with the times that arithmetic expects of GPUs, and next to them the times of runs.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  lazygrid check --full --json > gpu.json
  lazygrid-bench gpu-results gpu.json -o RESULTS-GPU.md")]
pub(crate) struct GpuResults {
    /// JSON files of `lazygrid check --json`, or of the measurement on the page of `lazygrid page`
    pub(crate) runs: Vec<PathBuf>,
    /// The document to write
    #[arg(long, short, value_name = "PATH", default_value = "RESULTS-GPU.md")]
    pub(crate) output: PathBuf,
}

/// Compile each GPU kernel with the Vulkan drivers, as the engine does, and print each driver's statistics of its
/// programs, such as registers, spills and code size. No kernel is run. Exit code 1 if a driver rejects a kernel.
#[derive(Debug, clap::Args)]
#[command(after_help = "Mesa's driver for AMD needs no GPU:
  RADV_FORCE_FAMILY=navi21 VK_DRIVER_FILES=/usr/share/vulkan/icd.d/radeon_icd.x86_64.json lazygrid-bench kernels")]
pub(crate) struct Kernels {
    /// GPU: its index as listed by `lazygrid devices`, or a part of its name [default: all Vulkan GPUs]
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) adapter: Option<AdapterId>,
    /// Only these kernels, separated by commas [default: all]
    #[arg(long, value_name = "KERNEL", value_delimiter = ',', hide_possible_values = true, value_parser = one_of(KERNELS.map(|kernel| kernel.name)))]
    pub(crate) only: Vec<String>,
    /// Include kernel variants for devices without subgroup operations
    #[arg(long)]
    pub(crate) all_variants: bool,
    /// Folder for the assembly and other representations that the driver provides
    #[arg(long, value_name = "DIR")]
    pub(crate) disassembly: Option<PathBuf>,
    /// Print everything as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Measures one engine in a separate process.
#[derive(Debug, clap::Args)]
pub(crate) struct MeasureMemory {
    pub(crate) engine: String,
    #[arg(value_parser = one_of(Scene::ALL.map(Scene::name)).try_map(|name| name.parse::<Scene>()))]
    pub(crate) scene: Scene,
    pub(crate) n: usize,
    pub(crate) steps: u32,
}

fn one_of<const N: usize>(names: [&'static str; N]) -> PossibleValuesParser {
    PossibleValuesParser::new(names)
}

fn minutes(text: &str) -> Result<f64, String> {
    let minutes = f64::from_str(text).ok().filter(|minutes| (0.0..=1e5).contains(minutes));
    minutes.ok_or_else(|| "expected a number of minutes from 0 to 100000".to_owned())
}
