use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use lazygrid::Space;
use lazygrid_io::arguments::unused_radius;
use lazygrid_io::read::{Format, Frame, Frames, NpyRows, Species};
use lazygrid_mpi::{Error, OwnedSpheres, agree, try_reserved};
use mpi::collective::SystemOperation;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives, Root};

use super::args::Detect;
use super::rank_range::rank_range;
use super::{refused, text};

/// Replaced by the rank's index.
const RANK: &str = "{rank}";

pub(crate) struct Input {
    pub(crate) particles: OwnedSpheres,
    pub(crate) space: Space,
}

enum FileSplit {
    PerRank(PathBuf),
    Whole,
    Rows(NpyRows),
    Lines(text::TextRows),
}

pub(crate) fn read(world: &SimpleCommunicator, args: &Detect) -> Result<Input, Error> {
    let split =
        agree(world, FileSplit::from_args(args, world.rank()).map_err(|message| refused(world, message)))?;
    let (rank, ranks) = (world.rank() as u64, world.size() as u64);
    let frame = match split {
        FileSplit::PerRank(path) => whole(&path, args),
        FileSplit::Whole if rank == 0 => whole(&args.file, args),
        FileSplit::Whole => Ok((Frame::default(), None)),
        FileSplit::Rows(rows) => {
            let range = rank_range(rows.count(), rank, ranks);
            let frame = rows.read(range, args.options()).map_err(|error| error.to_string());
            frame.map(|(frame, species)| (frame, Some(species)))
        }
        // All ranks must count lines before one may fail.
        FileSplit::Lines(text) => {
            let rank_lines = agree(
                world,
                text.lines_of(&args.file, rank, ranks).map_err(|message| refused(world, message)),
            )?;
            let before = before(world, rank_lines.lines());
            rank_lines.read(&args.file, args.options(), before)
        }
    };
    let (frame, species) = agree(world, frame.map_err(|message| refused(world, message)))?;
    warn_of_radii(world, args, species.as_ref());
    let space = common_space(world, rank_input(args, world.rank()), frame.space)?;
    let count = frame.len();
    let first = before(world, count as u64);
    let mut ids = agree(world, try_reserved("ids", count as u64, rank as u32))?;
    ids.extend((first..).take(count));
    let Frame { spheres, doubles, .. } = in_common_type(world, frame)?;
    // Species only selected radii.
    Ok(Input { particles: OwnedSpheres { spheres, doubles, ids, species: None }, space })
}

/// Converts the spheres to `f64` if any rank has `f64` numbers. Collective.
fn in_common_type(world: &SimpleCommunicator, mut frame: Frame) -> Result<Frame, Error> {
    let (local, mut any) = (u8::from(frame.doubles.is_some()), 0_u8);
    world.all_reduce_into(&local, &mut any, SystemOperation::max());
    let count = if any > local { frame.spheres.len() as u64 } else { 0 };
    let mut rows = agree(world, try_reserved("spheres", count, world.rank() as u32))?;
    if any > local {
        let spheres = frame.as_spheres();
        rows.extend((0..spheres.len()).map(|k| spheres.get_f64(k)));
        (frame.spheres, frame.doubles) = (Vec::new(), Some(rows));
    }
    Ok(frame)
}

/// Returns `None` if all ranks read the same file.
pub(crate) fn rank_input(args: &Detect, rank: i32) -> Option<PathBuf> {
    let name = args.file.to_str().filter(|name| name.contains(RANK))?;
    Some(name.replace(RANK, &rank.to_string()).into())
}

impl FileSplit {
    fn from_args(args: &Detect, rank: i32) -> Result<Self, String> {
        if let Some(path) = rank_input(args, rank) {
            return Ok(Self::PerRank(path));
        }
        let path = &args.file;
        let cannot = |error| format!("{}: cannot read: {error}", path.display());
        // Several ranks cannot read a pipe.
        if !path.metadata().map_err(cannot)?.is_file() {
            return Ok(Self::Whole);
        }
        let mut head = Vec::new();
        File::open(path).and_then(|file| file.take(4096).read_to_end(&mut head)).map_err(cannot)?;
        let known =
            args.format.or_else(|| Format::from_extension(path)).or_else(|| Format::from_content(&head));
        // Compressed files cannot be read from the middle.
        let compressed = head.starts_with(b"\x1F\x8B") || head.starts_with(b"\x28\xB5\x2F\xFD");
        // Later frames and their errors need a reader of the whole file.
        let is_later = args.frame.is_some_and(|frame| frame > 0);
        let split = match known {
            _ if compressed || is_later => None,
            Some(Format::Npy) => NpyRows::open(path).map_err(|error| error.to_string())?.map(Self::Rows),
            Some(Format::Csv) => text::TextRows::open(path).map_err(cannot)?.map(Self::Lines),
            // Only a reader of a whole Smoldyn listing sees repeated serial numbers.
            _ => None,
        };
        Ok(split.unwrap_or_else(|| {
            log::info!("{}: read by one rank, as it cannot be read in parts", path.display());
            Self::Whole
        }))
    }
}

fn whole(path: &Path, args: &Detect) -> Result<(Frame, Option<Species>), String> {
    let mut frames = Frames::open(path, args.options()).map_err(|error| error.to_string())?;
    let wanted = args.frame.unwrap_or(0);
    let frame = frames.by_ref().nth(wanted).transpose().map_err(|error| error.to_string())?;
    let frame = frame.ok_or_else(|| {
        format!("{}: there is no frame {wanted}; frames are counted from 0", path.display())
    })?;
    let is_last = args.frame.is_some() || frames.next().is_none();
    match is_last {
        true => Ok((frame, Some(frames.species().clone()))),
        false => Err(format!("{}: the file has several frames; choose one with --frame", path.display())),
    }
}

/// Collective.
fn warn_of_radii(world: &SimpleCommunicator, args: &Detect, local: Option<&Species>) {
    let radii = args.options().radii;
    // Open MPI refuses to reduce two empty vectors, which have the same address.
    if radii.is_empty() {
        return;
    }
    let is_met = |name: &str| local.is_some_and(|local| local.unused_radii().all(|unused| unused != name));
    let met: Vec<u8> = radii.keys().map(|name| u8::from(is_met(name))).collect();
    let mut met_by_any = vec![0_u8; met.len()];
    world.all_reduce_into(&met[..], &mut met_by_any[..], SystemOperation::max());
    if world.rank() == 0 {
        for (species, _) in radii.keys().zip(&met_by_any).filter(|(_, met)| **met == 0) {
            log::warn!("{}", unused_radius(&args.file, species));
        }
    }
}

fn common_space(world: &SimpleCommunicator, file: Option<PathBuf>, local: Space) -> Result<Space, Error> {
    let mut vectors = local.cell_vectors().map(|vector| vector.unwrap_or([0.0; 3]));
    world.process_at_rank(0).broadcast_into(vectors.as_flattened_mut());
    let first = Space::triclinic(vectors.map(|vector| (vector != [0.0; 3]).then_some(vector)));
    let first = first.map_err(|error| refused(world, error.to_string()));
    let agreed = first.and_then(|first| match file {
        Some(path) if local != first => Err(refused(
            world,
            format!(
                "{}: the box {:?} is not that of rank 0, {:?}; give the lengths with --periodic X,Y,Z",
                path.display(),
                local.cell_vectors(),
                first.cell_vectors()
            ),
        )),
        _ => Ok(first),
    });
    agree(world, agreed)
}

fn before(world: &SimpleCommunicator, local: u64) -> u64 {
    let mut all = vec![0_u64; world.size() as usize];
    world.all_gather_into(&local, &mut all[..]);
    all.iter().take(world.rank() as usize).sum()
}
