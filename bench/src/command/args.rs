use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Parser, Subcommand};
use lazygrid::gpu::AdapterId;
use lazygrid_bench::figures::Figure;
use lazygrid_io::scenes::Scene;
use lazygrid_kernels::kernel::KERNELS;

/// The figures of the paper, and others beside them, on this machine; what its drivers make of the GPU kernels.
#[derive(Debug, Parser)]
#[command(name = "lazygrid-bench", version, arg_required_else_help = true)]
#[command(after_help = "Exit code: 0 done; 1 a wrong answer, a loss or a failure; 2 wrong usage.")]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Repeat the paper's evaluation on this machine and write a report
    Figures(Figures),
    /// Say what became slower between two folders of figures
    Compare(Compare),
    /// Say what Vulkan drivers make of the GPU kernels
    Kernels(Kernels),
    #[command(hide = true)]
    MeasureMemory(MeasureMemory),
}

/// Repeats the paper's evaluation on this machine: engines in turn on the same spheres, every answer checked before its
/// time counts. Writes results.json, results.csv, plots, report.html and RESULTS.md.
#[derive(Debug, clap::Args)]
#[command(after_help = "A run that was interrupted goes on where it was, with the same settings and build.
Exit code 1 where an engine gave a wrong answer. Bullet takes part where built with --features bullet.

Examples:
  lazygrid-bench figures --quick
  lazygrid-bench figures --only 4 --budget-minutes 5 --out trees")]
pub(crate) struct Figures {
    /// Smaller sizes and fewer runs: under three minutes on two cores
    #[arg(long)]
    pub(crate) quick: bool,
    /// The smallest size of everything: checks answers, times mean nothing
    #[arg(long, conflicts_with = "quick")]
    pub(crate) smallest: bool,
    /// Only these figures, separated by commas [default: all]
    #[arg(long, value_name = "FIGURE", value_delimiter = ',', value_parser = one_of(Figure::ALL.map(Figure::name)).try_map(|name| name.parse::<Figure>()))]
    pub(crate) only: Vec<Figure>,
    /// The folder for results; finished points that it holds are not run again
    #[arg(long, value_name = "DIR", default_value = "figures")]
    pub(crate) out: PathBuf,
    /// The most runs, or steps, of each engine at each point [default: as many as the paper's, fewer with --quick]
    #[arg(long, value_name = "N")]
    pub(crate) runs: Option<NonZeroUsize>,
    /// About how many minutes it may take [default: 30, with --quick 1.75]
    #[arg(long, value_name = "M", value_parser = minutes)]
    pub(crate) budget_minutes: Option<f64>,
}

/// Says what changed between two runs of the figures by more than their noise: the medians differ by more than 5 % and
/// the middle halves of the runs do not overlap. Exit code 1 where something broke, was lost, or became slower or larger.
#[derive(Debug, clap::Args)]
pub(crate) struct Compare {
    /// The folder of the older run
    pub(crate) old: PathBuf,
    /// The folder of the newer run
    pub(crate) new: PathBuf,
}

/// Compiles every GPU kernel with the drivers of Vulkan here, as the engine has it, and prints what each driver says of its
/// programs: registers, values kept in memory for want of them, code. Nothing is run. Exit code 1 where a kernel is refused.
#[derive(Debug, clap::Args)]
#[command(after_help = "Mesa's driver for AMD needs no GPU:
  RADV_FORCE_FAMILY=navi21 VK_DRIVER_FILES=/usr/share/vulkan/icd.d/radeon_icd.x86_64.json lazygrid-bench kernels")]
pub(crate) struct Kernels {
    /// Which GPU: its index among those that `lazygrid devices` lists, or a part of its name [default: all by Vulkan]
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) adapter: Option<AdapterId>,
    /// Only these kernels, separated by commas [default: all]
    #[arg(long, value_name = "KERNEL", value_delimiter = ',', hide_possible_values = true, value_parser = one_of(KERNELS.map(|kernel| kernel.name)))]
    pub(crate) only: Vec<String>,
    /// Also the texts for devices without subgroup operations or with little workgroup memory
    #[arg(long)]
    pub(crate) other_devices: bool,
    /// A folder for the assembly, or whatever else the driver shows of its programs
    #[arg(long, value_name = "DIR")]
    pub(crate) texts: Option<PathBuf>,
    /// Everything as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Measures one engine in a process of its own.
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
