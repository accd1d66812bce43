mod detect;
mod page;
mod parsers;

use std::num::{NonZeroU32, NonZeroUsize};
use std::path::PathBuf;
use std::time::Duration;

use clap::builder::TypedValueParser;
use clap::{Parser, Subcommand};
use lazygrid::gpu::AdapterId;
use lazygrid::{Algorithm, Backend, MAX_SPHERES, Skin, Space};
use lazygrid_check::Effort;
use lazygrid_io::read::Format;
use lazygrid_io::scenes::Scene;
use lazygrid_io::write::{SphereFormat, TableFormat};
use lazygrid_sim::run::run_args::RunArgs;

pub(crate) use page::{PageArgs, PlanArgs};
use parsers::{PathWith, cell_ratio, one_of, radius, seconds, skin, space, table_format, threads, tilts};

/// All pairs of overlapping spheres.
#[derive(Debug, Parser)]
#[command(name = "lazygrid", version, arg_required_else_help = true)]
#[command(after_help = "Exit code: 0 done; 1 bad input or failure; 2 wrong usage. \
                        RUST_LOG=info says more on standard error.")]
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
    /// List what can run here
    Devices,
    /// Measure on the GPU what `detect` chooses by: the number of spheres at which a grid overtakes all pairs, and what skins cost
    #[command(
        after_help = "The result is kept in the user's cache directory, as lazygrid/calibration.json, for the \
                            adapter, its driver and this version; --json of `detect` says whether it was used."
    )]
    Calibrate {
        /// On which GPU: its index among those that `lazygrid devices` lists, or a part of its name
        #[arg(long, value_name = "NAME|INDEX")]
        adapter: Option<AdapterId>,
    },
    /// See whether all is right on this machine, and how fast it is
    Check(Check),
    /// Write a page that runs, checks and measures the kernels in a browser with WebGPU
    Page(PageArgs),
    /// Write the plan of a GPU call as JSON, for programs that run the kernels themselves
    Plan(PlanArgs),
    /// Write a completion script for a shell to standard output
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

/// Finds the overlapping pairs of the spheres in a file: those whose centres are at most the sum of their radii
/// apart. Prints how many spheres and pairs there are, what was chosen and why, and the time of each phase.
#[derive(Debug, clap::Args)]
#[command(after_help = "Formats:
  csv      a header with x,y,z and r, radius or diameter in any order, optionally species and id;
           commas, semicolons or tabs between; lines that begin with # are comments, and may hold the
           header
  npy      a NumPy array of shape (n, 4), f32 or f64: x, y, z, radius; or a structured one with such
           fields, optionally species and id
  xyz      plain (radii from --radius) or extended, with a radius column; a Lattice is periodic
           where pbc says T, or on all sides without pbc, also where it leans
  lammps   text dumps with x y z (or xu, xs, xsu) and radius or diameter; species by type; periodic
           along the edges whose BOX BOUNDS say pp, also where they lean
  smoldyn  output of listmols (radii from --radius, for acid and all its states, or for acid(solution))
Each may be compressed with gzip or Zstandard.

Output:
  pairs.csv  rows i,j;  pairs.npy  an array of shape (n, 2), u32; zero-based, i < j, by i, then j.
  With --neighbors, every pair stands twice in near.csv, and near.npy becomes two files,
  near.offsets.npy (u64) and near.indices.npy (u32): the neighbours of sphere k are
  indices[offsets[k]:offsets[k+1]].
  With --ids, rows are id_i,id_j, and arrays of pairs are of type i64; spheres are taken by ascending id, so
  that frames can be compared whatever the order of their rows. near.ids.npy has the id of each sphere.
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
    /// The file with the spheres; - for standard input
    pub(crate) file: PathBuf,
    /// Its format [default: by extension, else by content]
    #[arg(long, value_parser = one_of(Format::ALL.map(Format::name)).try_map(|name| name.parse::<Format>()))]
    pub(crate) format: Option<Format>,
    /// The radius of a species, by name or by LAMMPS type; wins over a radius in the file. May be repeated
    #[arg(long = "radius", value_name = "SPECIES=R", value_parser = radius)]
    pub(crate) radii: Vec<(String, f32)>,
    /// The lengths of a periodic box, - for an axis that is unbounded; or none, for unbounded space whatever the file
    /// says. Where the box begins makes no difference [default: the file's box where it declares one]
    #[arg(long, value_name = "X,Y,Z", value_parser = space, allow_hyphen_values = true)]
    pub(crate) periodic: Option<Space>,
    /// How far the box of --periodic leans, as LAMMPS has it: the edges along which space repeats are (X,0,0), (XY,Y,0) and
    /// (XZ,YZ,Z)
    #[arg(long, value_name = "XY,XZ,YZ", value_parser = tilts, allow_hyphen_values = true, requires = "periodic")]
    pub(crate) tilt: Option<[f32; 3]>,
    /// Where to run
    #[arg(long, default_value_t, value_parser = one_of(Backend::ALL.map(Backend::name)).try_map(|name| name.parse::<Backend>()))]
    pub(crate) backend: Backend,
    /// On which GPU: its index among those that `lazygrid devices` lists, or a part of its name
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) adapter: Option<AdapterId>,
    /// How to search; eager-grid and lazy-grid are GPU algorithms
    #[arg(long, default_value_t, value_parser = one_of(Algorithm::ALL.iter().map(|algorithm| algorithm.name())).try_map(|name| name.parse::<Algorithm>()))]
    pub(crate) algorithm: Algorithm,
    /// Split a cell when it holds more smaller spheres than this [default: the engine's]
    #[arg(long, value_name = "N")]
    pub(crate) tau: Option<u32>,
    /// Cell edge as a multiple of the largest diameter, 0.5 to 16 [default: the engine's]
    #[arg(long, value_name = "RATIO", value_parser = cell_ratio)]
    pub(crate) cell_ratio: Option<f32>,
    /// Skin of the candidate list kept between frames: off, auto or a distance; it loses no pair
    #[arg(long, value_name = "off|auto|DISTANCE", value_parser = skin)]
    pub(crate) skin: Option<Skin>,
    /// Threads of the CPU [default: all]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub(crate) threads: Option<NonZeroUsize>,
    /// The most seconds that a frame may take on a GPU [default: 600]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) timeout: Option<Duration>,
    /// Write the pairs to this file, .csv or .npy, compressed with .gz or .zst behind that; - for standard output
    #[arg(long, short, value_name = "PATH")]
    pub(crate) output: Option<PathBuf>,
    /// The format of the output [default: by its name; csv on standard output]
    #[arg(long, value_name = "FORMAT", requires = "output", value_parser = one_of(["csv", "npy"]).map(table_format))]
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
    /// Leave out the pairs that this file names: two whole numbers on a line, rows from 0 on, or with --ids ids, of which
    /// those that no sphere of the frame has are passed over
    #[arg(long, value_name = "PATH")]
    pub(crate) exclude: Option<PathBuf>,
    /// Leave out pairs within a molecule, by a column group, molecule or mol; 0 is no molecule
    #[arg(long)]
    pub(crate) exclude_groups: bool,
    /// Find neighbour lists instead of pairs
    #[arg(long)]
    pub(crate) neighbors: bool,
    /// The most pairs to hold in memory [default: 2^29]
    #[arg(long, value_name = "N")]
    pub(crate) max_pairs: Option<u64>,
    /// Print one JSON object per frame, each on a line of its own
    #[arg(long)]
    pub(crate) json: bool,
    /// Only this frame of the file; the first is 0 [default: all]
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
    #[arg(value_parser = one_of(Scene::ALL.map(Scene::name)).try_map(|name| name.parse::<Scene>()))]
    pub(crate) scene: Scene,
    /// How many spheres
    #[arg(short = 'n', long = "spheres", value_name = "N", value_parser = clap::value_parser!(u64).range(..=MAX_SPHERES))]
    pub(crate) spheres: u64,
    /// How many of them are transceivers, in the scene of that name; the others are carriers [default: 30, or all of fewer]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) transceivers: Option<u32>,
    /// How many times as large as a carrier a transceiver is [default: 100]
    #[arg(long, value_name = "R", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) size_ratio: Option<u32>,
    /// The seed of the random numbers
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Move every sphere K times, each time by a tenth of its radius in a random direction
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub(crate) steps: u32,
    /// The file to write, .npy, .csv or .xyz, compressed with .gz or .zst behind that
    #[arg(long, short, value_name = "PATH", value_parser = PathWith(SphereFormat::from_extension, ".npy, .csv or .xyz, with or without .gz or .zst behind it"))]
    pub(crate) output: (PathBuf, SphereFormat),
}

/// How arrivals are logged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum ArrivalsFormat {
    /// CSV files alone.
    #[default]
    Csv,
    /// Arrow IPC files beside them.
    Arrow,
}

/// Runs a scenario: particles are released, diffuse, react, collide and are received. The result depends on the
/// scenario and the seed alone.
#[derive(Debug, clap::Args)]
#[command(after_help = "Output, in the directory:
  series.csv          a row after every so many steps: step, time, particles by species, reactions and decays so
                      far, what receivers say by species, pairs and settled overlaps of the last step
  symbols.csv         the time, transmitter and value of each symbol, where bits are sent
  frames.xyz          frames in extended XYZ, where the scenario asks for them
  frame-000000000.npy frames as structured arrays: id, species, x, y, z, r
  checkpoint          what --resume goes on from; also after Ctrl-C and SIGTERM, which end the run
  arrivals.csv        the time, receiver, species, id, transmitter and release of each arrival, and
  releases.csv        what transmitters released, where the scenario asks for arrivals; both also as arrivals.arrow
                      and releases.arrow (Arrow IPC files) with --arrivals-format arrow
  animation.html      plays the run, where --animate asks for it; animation.frames is what it is made of
  report.html         plots (also in plots) and tables, where --report asks for it; with a log of arrivals also
                      impulse-response.csv, and where bits are sent interference.csv and bit-errors.csv
  .lock               locked while a run writes to the directory
With --replicas:
  replicas.csv        the seed of each replica
  replica-0000        the files of a replica, as of a run by itself with that seed, and so on
  mean.csv            the mean of each series and its standard error, of the replicas that are done

Exit code: 0 all steps are done; 1 bad input or failure; 2 wrong usage; 128 and the signal's number, with a checkpoint
to go on from, after Ctrl-C (130), SIGTERM (143) or SIGHUP (129).

Examples:
  lazygrid simulate simulator/scenarios/acid-base.toml
  lazygrid simulate burst.toml --seed 7 --steps 500 --output seed-7
  lazygrid simulate burst.toml --seed 7 --steps 1000 --output seed-7 --resume")]
pub(crate) struct Simulate {
    #[command(flatten)]
    pub(crate) options: RunArgs,
    /// Write the log of arrivals and releases as this besides CSV; arrow takes a build with the feature arrow
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub(crate) arrivals_format: ArrivalsFormat,
    /// Do the scenario N times with seeds that are drawn by --seed, each in a directory of its own, and average the series;
    /// --resume goes on from the checkpoints of all
    #[arg(long, value_name = "N")]
    pub(crate) replicas: Option<NonZeroU32>,
    /// Write report.html with plots and tables of the series, and of channels where the scenario logs arrivals
    #[arg(long)]
    pub(crate) report: bool,
    /// Where it runs, cpu or gpu; the statistics are the same, and a GPU may round differently
    #[arg(long, default_value_t = Backend::Cpu, value_parser = one_of([Backend::Cpu, Backend::Gpu].map(Backend::name)).try_map(|name| name.parse::<Backend>()))]
    pub(crate) backend: Backend,
    /// How pairs are found, on the CPU; it does not change the result
    #[arg(long, default_value_t, value_parser = one_of(ON_CPU.map(Algorithm::name)).try_map(|name| name.parse::<Algorithm>()))]
    pub(crate) algorithm: Algorithm,
    /// Threads of the CPU [default: all]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub(crate) threads: Option<NonZeroUsize>,
}

/// Holds every GPU kernel against a sequential function, and every algorithm of each backend against the definition of
/// pairs on scenes that are hard on it; then measures copies, radix sort, prefix scan and every algorithm, stage by stage.
/// What would take too long on this machine is left out, and said. Needs no file and writes none unless something is wrong.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "What is wrong is written to lazygrid-check-1.csv and so on, in the present directory: as few
spheres as show it, with what happened and a command that repeats it in comments. Pairs that
are to be left out are beside it, in lazygrid-check-1-excluded.csv.

Exit code: 0 all is right; 1 something is wrong; 2 wrong usage.

Examples:
  lazygrid check
  lazygrid check --backend gpu --adapter nvidia --full
  lazygrid check --fuzz 3600"
)]
pub(crate) struct Check {
    /// The checked backend: the GPU, the CPU, or both if a GPU exists, a software one included
    #[arg(long, value_enum, default_value_t = Checked::All)]
    pub(crate) backend: Checked,
    /// Which GPU: its index among those that `lazygrid devices` lists, or a part of its name
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) adapter: Option<AdapterId>,
    /// Small scenes and sizes only: some seconds
    #[arg(long, conflicts_with = "full")]
    pub(crate) quick: bool,
    /// More and larger scenes, up to 100 million spheres, and more time for each
    #[arg(long)]
    pub(crate) full: bool,
    /// Besides, draw scenes, settings and calls at random for so long; the seed of what fails is printed
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) fuzz: Option<Duration>,
    /// Only repeat what --fuzz drew for this seed, with the same --backend
    #[arg(long, value_name = "S", conflicts_with_all = ["fuzz", "full", "quick"])]
    pub(crate) seed: Option<u64>,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

impl Check {
    /// How much is checked.
    pub(crate) fn effort(&self) -> Effort {
        match (self.quick, self.full) {
            (true, _) => Effort::Quick,
            (_, true) => Effort::Full,
            _ => Effort::Default,
        }
    }
}

/// What `lazygrid check` looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Checked {
    Gpu,
    Cpu,
    All,
}

/// What can find pairs for a simulation.
const ON_CPU: [Algorithm; 6] = [
    Algorithm::Auto,
    Algorithm::Naive,
    Algorithm::HashGrid,
    Algorithm::ArrayGrid,
    Algorithm::RecursiveGrid,
    Algorithm::CellList,
];
