use std::path::PathBuf;

use lazygrid::{Algorithm, Space};

use lazygrid_io::arguments::periodic_space_f32;

use super::parsers::one_of;

/// Writes a page that finds the overlapping spheres of moving scenes on the GPU of a browser with WebGPU, and checks and
/// measures it there. The page is one file and loads nothing from a network.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "In the browser: #check and #measure after the page's address run at once, and leave their JSON in the page.

Example:
  lazygrid page -o lazygrid.html"
)]
pub(crate) struct PageArgs {
    /// The HTML file to write
    #[arg(long, short, value_name = "PATH", default_value = "lazygrid.html")]
    pub(crate) output: PathBuf,
}

/// Writes the plan of a GPU call as JSON: buffers, kernels in WGSL, bindings, dispatches and constants. Any WebGPU or
/// Vulkan program can execute it; docs/page.md describes the format.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  lazygrid plan -n 100000 --algorithm cell-list --subgroups 32 -o plan.json")]
pub(crate) struct PlanArgs {
    /// Number of spheres
    #[arg(short = 'n', long = "spheres", value_name = "N")]
    pub(crate) spheres: u32,
    /// Algorithm
    #[arg(long, default_value_t, value_parser = one_of::<Algorithm>([Algorithm::Auto].iter().chain(Algorithm::GPU).map(|algorithm| algorithm.name())))]
    pub(crate) algorithm: Algorithm,
    /// Pairs that the output holds; more are counted
    #[arg(long, value_name = "N", default_value_t = 1 << 20)]
    pub(crate) pairs: u32,
    /// Lengths of a periodic box, - for an unbounded axis
    #[arg(long, value_name = "X,Y,Z", value_parser = periodic_space_f32, allow_hyphen_values = true)]
    pub(crate) periodic: Option<Space>,
    /// Smallest subgroup size of the device; 4, 8, 16, 32, 64 or 128 [default: kernels without subgroups]
    #[arg(long, value_name = "SIZE", value_parser = subgroups)]
    pub(crate) subgroups: Option<u32>,
    /// Largest storage binding of the device, in MiB
    #[arg(long, value_name = "MIB", default_value_t = 128, value_parser = clap::value_parser!(u64).range(1..=4095))]
    pub(crate) binding: u64,
    /// Workgroup memory of the device, in KiB
    #[arg(long, value_name = "KIB", default_value_t = 16, value_parser = clap::value_parser!(u32).range(16..=1024))]
    pub(crate) workgroup_memory: u32,
    /// Read the number of spheres, -n at most, from an input buffer
    #[arg(long)]
    pub(crate) count_in_buffer: bool,
    /// The file to write [default: standard output]
    #[arg(long, short, value_name = "PATH")]
    pub(crate) output: Option<PathBuf>,
}

impl PlanArgs {
    pub(crate) fn space(&self) -> Space {
        self.periodic.unwrap_or(Space::UNBOUNDED)
    }
}

fn subgroups(text: &str) -> Result<u32, String> {
    let size = text.parse().ok().filter(|size: &u32| size.is_power_of_two() && (4..=128).contains(size));
    size.ok_or_else(|| "choose 4, 8, 16, 32, 64 or 128".to_owned())
}
