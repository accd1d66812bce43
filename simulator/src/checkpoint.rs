//! A run on disk, to go on from.

use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::binding::Bound;
use crate::ranks::Share;
use crate::{Error, Particles, State, output};

/// Everything that is needed to continue a run bit for bit.
///
/// A run over several ranks has a file of each beside it, with the particles of that rank.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The scenario as it was read; another one cannot go on from here.
    pub scenario: String,
    /// The seed.
    pub seed: u64,
    /// The name of the back end that computed it.
    pub backend: String,
    /// Steps between rows, between frames, and between those of the animation, 0 where there is none.
    pub every: [u32; 3],
    /// The length of each file that the run appends to.
    pub lengths: Vec<u64>,
    /// How many particles, and how many that receptors hold, are in the file of each rank; nothing where the state has them
    /// itself.
    pub parts: Vec<[u64; 2]>,
    /// Where the run stands.
    pub state: State,
}

/// What a rank has of a checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Part {
    seed: u64,
    step: u32,
    rank: u32,
    ranks: u32,
    particles: Particles,
    bound: Vec<Bound>,
}

/// The first bytes of a file: what it is, and the version of its layout.
const MAGIC: &[u8] = b"lazygrid checkpoint 4\n";
const MAGIC_OF_PART: &[u8] = b"lazygrid checkpoint 4, part\n";

impl Checkpoint {
    /// Writes a checkpoint in place of the one before, which is untouched until this one is complete. Parts are to be there
    /// already; those of other checkpoints are taken away then.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        write(path, MAGIC, self)?;
        forget_parts(path, (self.state.step, self.parts.len() as u32));
        Ok(())
    }

    /// Writes what a rank, of so many, has of the checkpoint at `path`, and returns how many particles that are and how many
    /// are bound. `state` is that of the rank.
    pub(crate) fn write_part(
        path: &Path,
        seed: u64,
        (rank, ranks): (u32, u32),
        state: &State,
    ) -> Result<[u64; 2], Error> {
        let State { particles, bound, step, .. } = state;
        let counts = [particles.len() as u64, bound.len() as u64];
        let (particles, bound) = (particles.clone(), bound.clone());
        let part = Part { seed, step: *step, rank, ranks, particles, bound };
        write(&part_of(path, *step, rank), MAGIC_OF_PART, &part).map(|()| counts)
    }

    /// Reads a checkpoint; where it is in parts, without them.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::Checkpoint`] for a file that is not a whole checkpoint of this version.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let checkpoint: Self = read(path, MAGIC)?;
        if !is_whole(&checkpoint.state.particles) {
            return Err(damaged(path));
        }
        Ok(checkpoint)
    }

    /// Where the run stands, with all particles, from the parts of the checkpoint at `path` where it is in parts.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn into_state(self, path: &Path) -> Result<State, Error> {
        self.into_share(path, Share::WHOLE)
    }

    /// The same with a share of the particles and of what is bound.
    pub(crate) fn into_share(self, path: &Path, share: Share) -> Result<State, Error> {
        let Self { seed, parts, mut state, .. } = self;
        let wanted = |k: usize| {
            let own = if k == 0 { state.particles.len() } else { state.bound.len() };
            share.of(if parts.is_empty() { own as u64 } else { parts.iter().map(|part| part[k]).sum() })
        };
        let wanted = [0, 1].map(wanted);
        if parts.is_empty() {
            let [particles, bound] = wanted.map(|range| range.start as usize..range.end as usize);
            state.particles = state.particles.range(particles);
            state.bound = state.bound[bound].to_vec();
            return Ok(state);
        }
        let (ranks, mut before) = (parts.len() as u32, [0; 2]);
        for (rank, counts) in (0..).zip(parts) {
            let ranges = [0, 1].map(|k| within(&wanted[k], before[k], counts[k]));
            before = [0, 1].map(|k| before[k] + counts[k]);
            if ranges.iter().all(Range::is_empty) {
                continue;
            }
            let path = part_of(path, state.step, rank);
            let part: Part = read(&path, MAGIC_OF_PART)?;
            let is_it = (part.seed, part.step, part.rank, part.ranks) == (seed, state.step, rank, ranks)
                && [part.particles.len() as u64, part.bound.len() as u64] == counts;
            if !is_it || !is_whole(&part.particles) {
                return Err(damaged(&path));
            }
            let [particles, bound] = ranges;
            state.particles.append(part.particles.range(particles));
            state.bound.extend(&part.bound[bound]);
        }
        Ok(state)
    }
}

/// Which of so many elements, before which there are others, are in a range of all.
fn within(range: &Range<u64>, before: u64, count: u64) -> Range<usize> {
    let at = |place: u64| place.saturating_sub(before).min(count) as usize;
    at(range.start)..at(range.end)
}

/// The file of a rank beside a checkpoint.
fn part_of(path: &Path, step: u32, rank: u32) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{step:09}.{rank}"));
    name.into()
}

/// Takes away the files of ranks that belong to other checkpoints than that of this step and so many parts.
fn forget_parts(path: &Path, (step, parts): (u32, u32)) {
    let directory = path.parent().filter(|parent| *parent != Path::new("")).unwrap_or(Path::new("."));
    let (Ok(entries), Some(name)) = (std::fs::read_dir(directory), path.file_name()) else { return };
    let prefix = format!("{}.", name.to_string_lossy());
    for entry in entries.flatten() {
        let file = entry.file_name();
        let numbers = file.to_str().and_then(|file| file.strip_prefix(&prefix)?.split_once('.'));
        let numbers = numbers.and_then(|(of, rank)| Some((of.parse().ok()?, rank.parse().ok()?)));
        let belongs = |(of, rank): (u32, u32)| of == step && rank < parts;
        if numbers.is_some_and(|numbers| !belongs(numbers)) {
            // Left behind, it is in nobody's way.
            drop::<std::io::Result<()>>(std::fs::remove_file(entry.path()));
        }
    }
}

fn write(path: &Path, magic: &[u8], content: &impl Serialize) -> Result<(), Error> {
    output::replace(path, |out| {
        let bytes = postcard::to_extend(content, magic.to_vec()).map_err(std::io::Error::other)?;
        out.write_all(&bytes)
    })
}

fn read<T: DeserializeOwned>(path: &Path, magic: &[u8]) -> Result<T, Error> {
    let bytes = std::fs::read(path).map_err(|source| Error::Read { path: path.to_owned(), source })?;
    let refused = |message: String| Error::Checkpoint { path: path.to_owned(), message };
    let Some(body) = bytes.strip_prefix(magic) else {
        return Err(refused("this is no checkpoint of this version; start the run anew".to_owned()));
    };
    let (content, rest) = postcard::take_from_bytes::<T>(body)
        .map_err(|error| refused(format!("the checkpoint is damaged ({error}); start the run anew")))?;
    if rest.is_empty() { Ok(content) } else { Err(damaged(path)) }
}

fn damaged(path: &Path) -> Error {
    let message = "the checkpoint is damaged; start the run anew".to_owned();
    Error::Checkpoint { path: path.to_owned(), message }
}

/// Whether all columns are of one length.
fn is_whole(particles: &Particles) -> bool {
    let n = particles.len();
    let velocities = particles.velocity.each_ref().map(Vec::len);
    particles.position.iter().all(|column| column.len() == n)
        && (velocities == [n; 3] || velocities == [0; 3])
        && particles.radius.len() == n
        && particles.species.len() == n
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Particle, Totals};

    /// Ranks take what comes in a row, whoever wrote it, and equally much of it.
    #[test]
    fn shares_of_parts_are_in_order_and_even() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("checkpoint");
        let counts = [7, 0, 2, 4];
        let mut next = 0..;
        let mut parts = Vec::new();
        for (rank, count) in (0..).zip(counts) {
            let mut state = State { step: 3, ..State::default() };
            for id in next.by_ref().take(count) {
                state.particles.push(Particle { id, ..Particle::default() }, true);
                state.bound.push(Bound { id: 100 + id, species: 0, receiver: 0, direction: [0.0; 3] });
            }
            let counts = Checkpoint::write_part(&path, 5, (rank, 4), &state).expect("is written");
            assert_eq!(counts, [count as u64; 2]);
            parts.push(counts);
        }
        let checkpoint = Checkpoint {
            scenario: String::new(),
            seed: 5,
            backend: "cpu".to_owned(),
            every: [1, 1, 0],
            lengths: Vec::new(),
            parts,
            state: State { step: 3, totals: Totals::default(), ..State::default() },
        };
        checkpoint.write(&path).expect("is written");
        let read = Checkpoint::read(&path).expect("is read");
        assert_eq!(read, checkpoint);
        for ranks in [1, 2, 3, 5] {
            let shares: Vec<State> = (0..ranks)
                .map(|rank| read.clone().into_share(&path, Share::new(rank, ranks)).expect("is read"))
                .collect();
            let ids = shares.iter().flat_map(|share| share.particles.id.clone());
            assert!(ids.eq(0..13));
            assert!(shares.iter().flat_map(|share| &share.bound).map(|bound| bound.id).eq(100..113));
            let even = |share: &State| share.particles.len().abs_diff(13 / ranks as usize) <= 1;
            assert!(shares.iter().all(even), "{ranks}");
        }
        // A checkpoint without parts takes those of this one away.
        Checkpoint { parts: Vec::new(), ..checkpoint }.write(&path).expect("is written");
        assert_eq!(std::fs::read_dir(directory.path()).expect("is there").count(), 1);
    }
}
