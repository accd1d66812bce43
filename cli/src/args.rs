mod detect;
mod page;
mod parsers;

use std::num::{NonZeroU32, NonZeroUsize};
use std::path::PathBuf;
use std::time::Duration;

use clap::{Parser, Subcommand};
use lazygrid::gpu::AdapterId;
use lazygrid::{Algorithm, Backend, MAX_SPHERES, Skin, Space};
use lazygrid_check::Effort;
use lazygrid_io::arguments::{periodic_space, species_radius};
use lazygrid_io::read::{Format, Precision};
use lazygrid_io::scenes::Scene;
use lazygrid_io::write::{SphereFormat, TableFormat};
use lazygrid_sim::run::run_args::RunArgs;

pub(crate) use page::{PageArgs, PlanArgs};
use parsers::{PathWith, cell_ratio, one_of, seconds, skin, table_format, threads, tilts};

pub(crate) const STANDARD: &str = "-";

/// Replaced by the number of the frame in the names of outputs.
pub(crate) const FRAME: &str = "{frame}";

/// All pairs of overlapping spheres.
#[derive(Debug, Parser)]
#[command(name = "lazygrid", version, arg_required_else_help = true)]
#[command(
    after_help = "Exit code: 0 done; 1 bad input or failure; 2 wrong usage; 128 plus the number of a signal \
                        that stopped simulate. RUST_LOG=info says more on standard error."
)]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Find the overlapping pairs of the spheres in a file
    Detect(Box<Detect>),
    /// Write a scene to a file
    Generate(Generate),
    /// Run a scenario of diffusing, reacting and colliding particles
    Simulate(Simulate),
    /// List GPU adapters and the CPU's vector width
    Devices,
    /// Measure the GPU: from how many spheres a grid, a radix sort and the GPU itself are faster, and the costs of skins
    #[command(
        after_help = "The result is stored in the user's cache directory, as lazygrid/calibration.json, for the \
                            adapter, its driver and this version; --json of `detect` says whether it was used."
    )]
    Calibrate {
        /// GPU adapter: its index in `lazygrid devices`, or a part of its name
        #[arg(long, value_name = "NAME|INDEX")]
        adapter: Option<AdapterId>,
    },
    /// Verify and time every kernel and algorithm on this machine
    Check(Check),
    /// Write a page that runs, checks and measures the kernels in a browser with WebGPU
    Page(PageArgs),
    /// Write the plan of a GPU call as JSON, for programs that run the kernels themselves
    Plan(Box<PlanArgs>),
    /// Write a completion script for a shell to standard output
    Completions {
        /// Shell
        shell: clap_complete::Shell,
    },
}

/// Finds the overlapping pairs of the spheres in a file: the distance of their centers is at most the sum of their radii.
/// Prints the numbers of spheres and pairs, the chosen backend and algorithm with the reason, and the time of each phase.
#[derive(Debug, clap::Args)]
#[command(after_help = "Formats:
  csv      a header with x,y,z and r, radius or diameter in any order, optionally species, id and
           group (or molecule, mol); commas, semicolons or tabs between; lines that begin with # are comments, and may hold the
           header
  npy      a NumPy array of shape (n, 4), f32 or f64: x, y, z, radius; or a structured one with such
           fields, optionally species, id and group
  xyz      plain (radii from --radius) or extended, with a radius column; a Lattice is periodic
           where pbc says T, or on all sides without pbc; triclinic boxes too
  lammps   text dumps with x y z (or xu, xs, xsu) and radius or diameter; species by type; periodic
           along the axes whose BOX BOUNDS say pp; triclinic boxes too
  smoldyn  output of listmols (radii from --radius, for acid and all its states, or for acid(solution))
Each may be compressed with gzip or Zstandard. Text is read in 64 bits, because few decimal numbers are 32-bit numbers.
Text that was written from 32-bit numbers is these numbers with --precision f32, which warns of lost digits.

Output:
  pairs.csv  rows i,j;  pairs.npy  an array of shape (n, 2), u32; zero-based, i < j, by i, then j.
  With --neighbors, near.csv has every pair twice, and near.npy becomes two files,
  near.offsets.npy (u64) and near.indices.npy (u32): the neighbors of sphere k are
  indices[offsets[k]:offsets[k+1]].
  With --ids, rows are id_i,id_j, and arrays of pairs are of type i64; spheres are taken by ascending id, so
  that frames with another order of rows can be compared. near.ids.npy has the id of each sphere.
  With -o - the summary goes to standard error.
  More pairs than --max-pairs are streamed to the file, without a list in memory.
  Files appear when they are complete, and none replaces the input; {frame} in the name stands for the number of the frame.

Examples:
  lazygrid detect pour.dump
  lazygrid detect burst.lst --radius acid=0.1 --radius base=0.15 --radius salt=0.2 -o pairs.csv
  lazygrid detect run.lammpstrj.gz --ids -o pairs-{frame}.npy
  xz -dc run.xyz.xz | lazygrid detect - --frame 3 -o - | sort | uniq -c
  lazygrid detect slab.csv --periodic 10,10,- -o pairs.npy
  lazygrid detect cell.csv --periodic 10,10,10 --tilt 2.5,0,0 -o pairs.npy
  lazygrid detect run.lammpstrj --ids --exclude bonds.csv --exclude-groups -o pairs-{frame}.csv
  lazygrid detect run.xyz --json | jq .pairs")]
pub(crate) struct Detect {
    /// File with the spheres; - for standard input
    pub(crate) file: PathBuf,
    /// Format of the file [default: by extension, else by content]
    #[arg(long, value_parser = one_of::<Format>(Format::ALL.map(Format::name)))]
    pub(crate) format: Option<Format>,
    /// Radius of a species, by name or LAMMPS type; overrides the file. May be repeated
    #[arg(long = "radius", value_name = "SPECIES=R", value_parser = species_radius, allow_hyphen_values = true)]
    pub(crate) radii: Vec<(String, f64)>,
    /// Type of the numbers that decide; auto rounds none: f32 for NumPy arrays of float32, else f64
    #[arg(long, default_value_t = Precision::Auto, value_parser = one_of::<Precision>(Precision::ALL.map(Precision::name)))]
    pub(crate) precision: Precision,
    /// Lengths of the periodic box, - for an unbounded axis; or none for unbounded space [default: the file's box]
    #[arg(long, value_name = "X,Y,Z", value_parser = periodic_space, allow_hyphen_values = true)]
    pub(crate) periodic: Option<Space>,
    /// Tilts of the box as in LAMMPS: its cell vectors are (X,0,0), (XY,Y,0) and (XZ,YZ,Z)
    #[arg(long, value_name = "XY,XZ,YZ", value_parser = tilts, allow_hyphen_values = true, requires = "periodic")]
    pub(crate) tilt: Option<[f64; 3]>,
    /// Backend of the search
    #[arg(long, default_value_t, value_parser = one_of::<Backend>(Backend::ALL.iter().map(|backend| backend.name())))]
    pub(crate) backend: Backend,
    /// GPU adapter: its index in `lazygrid devices`, or a part of its name
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) adapter: Option<AdapterId>,
    /// Search algorithm; eager-grid and lazy-grid run on a GPU only
    #[arg(long, default_value_t, value_parser = one_of::<Algorithm>(Algorithm::ALL.iter().map(|algorithm| algorithm.name())))]
    pub(crate) algorithm: Algorithm,
    /// τ of recursive-grid and lazy-grid: number of smaller spheres above which a cell is split [default: the engine's]
    #[arg(long, value_name = "N")]
    pub(crate) tau: Option<u32>,
    /// Cell size of grids, but not of cell-list, as a multiple of the largest diameter, 0.5 to 16 [default: the engine's]
    #[arg(long, value_name = "RATIO", value_parser = cell_ratio)]
    pub(crate) cell_ratio: Option<f32>,
    /// Skin of the candidate list kept between frames: off, auto or a distance, with auto and cell-list; it loses no pair
    /// [default: auto]
    #[arg(long, value_name = "off|auto|DISTANCE", value_parser = skin)]
    pub(crate) skin: Option<Skin>,
    /// Threads of the CPU [default: all]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Time limit of each submission to a GPU, in seconds; without effect if auto runs on the CPU [default: 600]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) timeout: Option<Duration>,
    /// Output file of the pairs: .csv or .npy, optionally followed by .gz or .zst; - for standard output
    #[arg(long, short, value_name = "PATH")]
    pub(crate) output: Option<PathBuf>,
    /// Format of the output [default: by its name; csv on standard output]
    #[arg(long, value_name = "FORMAT", requires = "output", value_parser = table_format())]
    pub(crate) output_format: Option<TableFormat>,
    /// Do not sort the pairs
    #[arg(long, conflicts_with_all = ["count", "neighbors"])]
    pub(crate) unordered: bool,
    /// Only count the pairs, in memory that does not depend on their number
    #[arg(long, conflicts_with_all = ["output", "neighbors"])]
    pub(crate) count: bool,
    /// Write the ids of spheres instead of their rows, from a column id (Smoldyn: serial numbers)
    #[arg(long, requires = "output")]
    pub(crate) ids: bool,
    /// File of pairs to exclude: two whole numbers per line, row indices or, with --ids, ids
    #[arg(long, value_name = "PATH")]
    pub(crate) exclude: Option<PathBuf>,
    /// Exclude pairs within a molecule, by a column group, molecule or mol; 0 is no molecule
    #[arg(long)]
    pub(crate) exclude_groups: bool,
    /// Find neighbor lists instead of pairs
    #[arg(long)]
    pub(crate) neighbors: bool,
    /// Limit of pairs in memory [default: 2^29]. More go to --output in parts; without it, or with --neighbors, more are an
    /// error
    #[arg(long, value_name = "N")]
    pub(crate) max_pairs: Option<u64>,
    /// Print one JSON object per frame, each on a line of its own
    #[arg(long)]
    pub(crate) json: bool,
    /// Index of the only frame to read, from 0 [default: all]
    #[arg(long, value_name = "K")]
    pub(crate) frame: Option<usize>,
}

/// Writes a scene, the same on every machine for the same seed.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  lazygrid generate five-sizes -n 1000000 --seed 7 --output five-sizes.npy
  lazygrid generate transceivers -n 100000 --transceivers 10 --size-ratio 1000 --output transceivers.npy")]
pub(crate) struct Generate {
    /// The scene
    #[arg(value_parser = one_of::<Scene>(Scene::ALL.map(Scene::name)))]
    pub(crate) scene: Scene,
    /// Number of spheres
    #[arg(short = 'n', long = "spheres", value_name = "N", value_parser = clap::value_parser!(u64).range(..=MAX_SPHERES))]
    pub(crate) spheres: u64,
    /// Number of transceivers among the spheres, in the scene of that name [default: 30, or all of fewer]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) transceivers: Option<u32>,
    /// Radius of a transceiver over that of a carrier [default: 100]
    #[arg(long, value_name = "R", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) size_ratio: Option<u32>,
    /// Seed of the random numbers
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Move every sphere K times, each time by a tenth of its radius in a random direction
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub(crate) steps: u32,
    /// Output file: .npy, .csv or .xyz, optionally followed by .gz or .zst
    #[arg(long, short, value_name = "PATH", value_parser = PathWith(SphereFormat::from_extension, ".npy, .csv or .xyz, optionally followed by .gz or .zst"))]
    pub(crate) output: (PathBuf, SphereFormat),
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum ArrivalsFormat {
    /// CSV files alone.
    #[default]
    Csv,
    /// CSV files and Arrow IPC files.
    Arrow,
}

/// Runs a scenario: particles are released, diffuse, react, collide and are received. The result depends on the
/// scenario and the seed alone.
#[derive(Debug, clap::Args)]
#[command(after_help = "Output, in the directory:
  series.csv          a row per interval: step, time, particles by species, reactions and decays so far,
                      counts of receivers by species, pairs and resolved overlaps of the last step
  symbols.csv         the time, transmitter and value of each symbol, if bits are sent
  frames.xyz          frames in extended XYZ, if the scenario asks for them
  frame-000000000.npy frames as structured arrays: id, species, x, y, z, r
  checkpoint          the state that --resume continues; also after Ctrl-C and SIGTERM, which end the run
  arrivals.csv        the time, receiver, species, id, transmitter and release of each arrival, and
  releases.csv        each release, if the scenario asks for arrivals; both also as arrivals.arrow
                      and releases.arrow (Arrow IPC files) with --arrivals-format arrow
  occupancy.csv       with arrivals, particles inside transparent receivers or bound to receptors, by release
  animation.html      plays the run, with --animate; animation.frames has its frames
  report.html         plots (also in plots) and tables, with --report; if bits are sent also by-symbol.csv,
                      the counts of each sent symbol, and bit-errors.csv; with a log of arrivals also
                      impulse-response.csv, and if bits are sent interference.csv
  .lock               locked while a run writes to the directory
With --replicas:
  replicas.csv        the seed of each replica
  replica-0000        the files of a replica, as of a single run with its seed, and so on
  mean.csv            the mean of each series and its standard error, of the finished replicas
With --sweep or [sweep]:
  points.csv          the values of each point
  point-0000          the files of the replicas of a point, and so on
  sweep.csv           the results of each point, with bounds

Exit code: 0 all steps are done; 1 bad input or failure; 2 wrong usage; 128 plus the signal's number, with a
checkpoint to resume, after Ctrl-C (130), SIGTERM (143) or SIGHUP (129).

Examples:
  lazygrid simulate simulator/scenarios/acid-base.toml
  lazygrid simulate burst.toml --seed 7 --steps 500 --output seed-7
  lazygrid simulate burst.toml --seed 7 --steps 1000 --output seed-7 --resume")]
pub(crate) struct Simulate {
    #[command(flatten)]
    pub(crate) options: RunArgs,
    /// Format of the log of arrivals and releases; arrow needs a build with the feature arrow
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub(crate) arrivals_format: ArrivalsFormat,
    /// Run the scenario N times with seeds drawn from --seed, each in its own directory, and average the series
    #[arg(long, value_name = "N")]
    pub(crate) replicas: Option<NonZeroU32>,
    /// Run the scenario for each value of a key, as in receiver.rx.center.x=5,10,20; several --sweep give all combinations
    #[arg(long, value_name = "KEY=VALUE,...")]
    pub(crate) sweep: Vec<String>,
    /// Write report.html: plots and tables of the series, and of channels if the scenario logs arrivals
    #[arg(long)]
    pub(crate) report: bool,
    /// Backend of the run; the statistics are the same, but a GPU may round differently
    #[arg(long, default_value_t = Backend::Cpu, value_parser = one_of::<Backend>([Backend::Cpu, Backend::Gpu].map(Backend::name)))]
    pub(crate) backend: Backend,
    /// Pair search on the CPU, refused with --backend gpu; does not change the result
    #[arg(long, default_value_t, value_parser = one_of::<Algorithm>(ON_CPU.map(Algorithm::name)))]
    pub(crate) algorithm: Algorithm,
    /// Threads of the CPU [default: all]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub(crate) threads: Option<NonZeroUsize>,
}

/// Checks every GPU kernel against a sequential function, and every algorithm of each backend against the naive search on
/// hard scenes. Then times copies, radix sort, prefix scan and every algorithm by stage. Runs predicted to take too long are
/// skipped and listed. Needs no file, and writes none unless a check fails.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Failures are written to lazygrid-check-1.csv and so on, in the working directory: the fewest
spheres that show the failure, with the result and a command that repeats it in comments.
Excluded pairs are in lazygrid-check-1-excluded.csv.

Exit code: 0 all checks passed; 1 a check failed; 2 wrong usage.

Examples:
  lazygrid check
  lazygrid check --backend gpu --adapter nvidia --full
  lazygrid check --fuzz 3600"
)]
pub(crate) struct Check {
    /// Backend to check: the GPU (also a software one), the CPU, or both
    #[arg(long, value_enum, default_value_t = Checked::All)]
    pub(crate) backend: Checked,
    /// GPU adapter: its index in `lazygrid devices`, or a part of its name
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) adapter: Option<AdapterId>,
    /// Small scenes only; takes some seconds
    #[arg(long, conflicts_with = "full")]
    pub(crate) quick: bool,
    /// More and larger scenes, up to 100 million spheres, and more time for each
    #[arg(long)]
    pub(crate) full: bool,
    /// Also check random scenes, settings and calls for this time, in seconds; prints the seed of a failure
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) fuzz: Option<Duration>,
    /// Repeat only the case of --fuzz with this seed and the same --backend
    #[arg(long, value_name = "S", conflicts_with_all = ["fuzz", "full", "quick"])]
    pub(crate) seed: Option<u64>,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

impl Check {
    pub(crate) fn effort(&self) -> Effort {
        match (self.quick, self.full) {
            (true, _) => Effort::Quick,
            (_, true) => Effort::Full,
            _ => Effort::Default,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Checked {
    Gpu,
    Cpu,
    All,
}

/// Algorithms that find pairs for a simulation.
const ON_CPU: [Algorithm; 6] = [
    Algorithm::Auto,
    Algorithm::Naive,
    Algorithm::HashGrid,
    Algorithm::ArrayGrid,
    Algorithm::RecursiveGrid,
    Algorithm::CellList,
];
