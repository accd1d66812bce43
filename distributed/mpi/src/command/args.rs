use std::fmt::Display;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand};
use lazygrid::{Backend, Space};
use lazygrid_io::arguments::{periodic_space, radii_by_species, species_radius};
use lazygrid_io::read::{Format, Options, Precision};
use lazygrid_mpi::{Ownership, Settings};
use lazygrid_sim::run::run_args::RunArgs;

/// All pairs of overlapping spheres, by many ranks.
#[derive(Debug, Parser)]
#[command(name = "lazygrid-mpi", version, arg_required_else_help = true)]
#[command(
    after_help = "Exit code: 0 done; 1 bad input or failure; 2 wrong usage; 101 a rank panicked; 128 plus the \
                        number of a signal that stopped simulate. \
                        RUST_LOG=info says more on standard error."
)]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Find the overlapping pairs of the spheres in a file
    Detect(Box<Detect>),
    /// Run a scenario of the simulator
    Simulate(Simulate),
    /// Time steps in which every sphere moves, on all ranks
    BenchScaling(BenchScaling),
}

/// Finds the overlapping pairs of the spheres in a file: the distance of their centers is at most the sum of their radii.
#[derive(Debug, clap::Args)]
#[command(after_help = "Input:
  npy, csv            each rank reads its own part of the file: rows of arrays, whole lines of text
  all others          one rank reads the file: xyz, lammps, smoldyn, Fortran order, and what is compressed
  part-{rank}.npy     each rank reads a file of its own, in any of the formats
Formats are those of `lazygrid detect`. Spheres are numbered from 0 in the order of the file, or of the files.

Output:
  -o pairs.npy        pairs.0.npy, pairs.1.npy and so on, one file per rank, and pairs.manifest.json
  -o pairs.csv --gather   pairs.csv alone: what `lazygrid detect` writes, brought together on one rank
Rows are i,j with i < j, in order within each file; arrays are of type u32, or u64 for 2^32 spheres or more.

Examples:
  mpirun -n 8 lazygrid-mpi detect run.npy
  mpirun -n 64 lazygrid-mpi detect 'part-{rank}.npy' --periodic 100,100,100 -o pairs.npy")]
pub(crate) struct Detect {
    /// File with the spheres; {rank} in it is replaced by the index of the rank, from 0
    pub(crate) file: PathBuf,
    /// Format of the file [default: by extension, else by content]
    #[arg(long, value_parser = PossibleValuesParser::new(Format::ALL.map(Format::name)).try_map(|name| name.parse::<Format>()))]
    pub(crate) format: Option<Format>,
    /// Index of the frame in a file with several, from 0
    #[arg(long, value_name = "N")]
    pub(crate) frame: Option<usize>,
    /// Radius of a species; overrides the file. May be repeated
    #[arg(long = "radius", value_name = "SPECIES=R", value_parser = species_radius)]
    pub(crate) radii: Vec<(String, f64)>,
    /// Type of the numbers that decide; auto rounds none: f32 for NumPy arrays of float32, else f64
    #[arg(long, default_value_t = Precision::Auto, value_parser = PossibleValuesParser::new(Precision::ALL.map(Precision::name)).try_map(|name| name.parse::<Precision>()))]
    pub(crate) precision: Precision,
    /// Lengths of the periodic box, - for an unbounded axis; or none [default: the file's box]
    #[arg(long, value_name = "X,Y,Z", value_parser = periodic_space, allow_hyphen_values = true)]
    pub(crate) periodic: Option<Space>,
    /// Let each rank own the spheres that it read, instead of those of its domain
    #[arg(long)]
    no_rebalance: bool,
    /// Backend of each rank
    #[arg(long, default_value_t, value_parser = backend())]
    pub(crate) backend: Backend,
    /// Threads of each rank [default: its share of the cores of its node]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Output file of the pairs: .csv or .npy, optionally followed by .gz or .zst [default: count only]
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Write all pairs to one file
    #[arg(long, requires = "output")]
    pub(crate) gather: bool,
    /// Limit of pairs of a rank in memory, 32 bytes each
    #[arg(long, value_name = "N", default_value_t = 1 << 27)]
    pub(crate) max_pairs: u64,
    /// Print the summary as a line of JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Runs a scenario on all ranks, with the results and files of `lazygrid simulate`. All ranks have to see the scenario and the
/// output directory.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Files are those of `lazygrid simulate`, and checkpoint.STEP.RANK, the particles of each
rank. Any number of ranks and `lazygrid simulate` resume from them, and ranks resume from its
checkpoint. Collisions (contact = \"separate\" and \"elastic\") cost rounds of messages in each
step. SIGTERM stops a run with a checkpoint, and exit code 143.

Examples:
  mpirun -n 8 lazygrid-mpi simulate acid-base.toml
  mpirun -n 64 lazygrid-mpi simulate acid-base.toml --resume --steps 100000"
)]
pub(crate) struct Simulate {
    #[command(flatten)]
    pub(crate) options: RunArgs,
    /// Backend of each rank; GPUs move the particles of models without reactions and contacts, and find the pairs of others
    #[arg(long, default_value_t = Backend::Cpu, value_parser = backend())]
    pub(crate) backend: Backend,
    /// Threads of each rank [default: its share of the cores of its node]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub(crate) threads: Option<NonZeroUsize>,
}

/// Times steps of a simulation in which every sphere moves by up to a tenth of its radius, and prints a line of JSON. The
/// script `distributed/scaling.sh` runs it on 1, 2, 4 and more ranks.
#[derive(Debug, clap::Args)]
pub(crate) struct BenchScaling {
    /// Distribution of the spheres
    #[arg(long, value_enum, default_value_t = Scene::Uniform)]
    pub(crate) scene: Scene,
    /// Number of spheres per rank, for weak scaling
    #[arg(long, value_name = "N", default_value_t = 1_000_000)]
    pub(crate) per_rank: u64,
    /// Number of spheres on all ranks, for strong scaling; overrides --per-rank
    #[arg(long, value_name = "N")]
    pub(crate) spheres: Option<u64>,
    /// Number of timed steps, after a first one
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub(crate) steps: u32,
    /// Backend of each rank
    #[arg(long, default_value_t, value_parser = backend())]
    pub(crate) backend: Backend,
    /// Threads of each rank [default: its share of the cores of its node]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub(crate) threads: Option<NonZeroUsize>,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(crate) enum Scene {
    /// Equal spheres in a cube
    Uniform,
    /// Five sizes in a cube, each half as large as the one before
    FiveSizes,
    /// Equal spheres in a cloud that is dense in the middle
    Gaussian,
    /// All at one point: as many pairs as there can be
    Point,
}

impl Scene {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::FiveSizes => "five-sizes",
            Self::Gaussian => "gaussian",
            Self::Point => "point",
        }
    }
}

fn threads(text: &str) -> Result<NonZeroUsize, String> {
    let expected = "expected a whole number above zero; leave it out to use the rank's share of the cores";
    text.parse().map_err(|_| expected.to_owned())
}

fn backend() -> impl TypedValueParser<Value = Backend> {
    let names = Backend::ALL.iter().map(|backend| backend.name());
    PossibleValuesParser::new(names).try_map(|name| name.parse::<Backend>())
}

impl Args {
    pub(crate) fn checked(self) -> Result<Self, clap::Error> {
        if let Command::Detect(args) = &self.command {
            let twice = |message| Self::command().error(ErrorKind::ArgumentConflict, message);
            radii_by_species(&args.radii).map_err(twice)?;
        }
        Ok(self)
    }
}

impl Command {
    /// Returns the options that ranks must share, without those of runs, which are compared with scenarios.
    pub(crate) fn shared(&self) -> Settings {
        let settings = Settings::new(env!("CARGO_PKG_VERSION"));
        match self {
            Self::Detect(args) => args.shared(settings.with("command", "detect")),
            Self::Simulate(_) => settings.with("command", "simulate"),
            Self::BenchScaling(args) => args.shared(settings.with("command", "bench-scaling")),
        }
    }
}

impl BenchScaling {
    fn shared(&self, settings: Settings) -> Settings {
        settings
            .with("--scene", self.scene.name())
            .with("--per-rank", self.per_rank)
            .with("--spheres", option(self.spheres))
            .with("--steps", self.steps)
    }
}

impl Detect {
    /// Omits options that may differ between ranks.
    fn shared(&self, settings: Settings) -> Settings {
        let radii: Vec<_> =
            self.radii.iter().map(|(species, radius)| format!("{species}={radius}")).collect();
        // Without this option, the file may declare a box.
        let periodic = self.periodic.map(|space| {
            space
                .lengths()
                .map(|length| length.map_or_else(|| "-".to_owned(), |length| length.to_string()))
                .join(",")
        });
        settings
            .with("FILE", self.file.display())
            .with("--format", option(self.format.map(Format::name)))
            .with("--frame", option(self.frame))
            .with("--radius", option((!radii.is_empty()).then(|| radii.join(" "))))
            .with("--precision", self.precision)
            .with("--periodic", option(periodic))
            .with("--no-rebalance", self.no_rebalance)
            .with("--output", option(self.output.as_ref().map(|path| path.display())))
            .with("--gather", self.gather)
    }

    pub(crate) fn ownership(&self) -> Ownership {
        if self.no_rebalance { Ownership::Keep } else { Ownership::BALANCE }
    }

    pub(crate) fn options(&self) -> Options {
        let radii = self.radii.iter().cloned().collect();
        let (format, space, precision) = (self.format, self.periodic, self.precision);
        Options { format, radii, space, precision, ..Options::default() }
    }
}

fn option(value: Option<impl Display>) -> String {
    value.map_or_else(|| "not given".to_owned(), |value| value.to_string())
}
