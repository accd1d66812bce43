//! # Correctness
//!
//! A resumed run equals the uninterrupted one, or is refused with [`Error::Damaged`]:
//!
//! 1. The header of `checkpoint` has its length and checksum (`sealed.rs`), checked before decoding.
//! 2. `checkpoint` has the checksum of each rank's part ([`PartRecord`]). A part is checked against its header and
//!    that record, so parts of different checkpoints do not mix.
//! 3. `checkpoint` has the length and checksum of each appended file ([`FileRecord`]), all checked before any is cut.

use std::ops::Range;
use std::path::{Path, PathBuf};

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

use crate::error::Damage;
use crate::motion::binding::Bound;
pub use crate::output::append_file::FileRecord;
use crate::release::rank_slice::RankSlice;
use crate::run::sealed::{self, FileKind};
use crate::{Error, Model, Particles, State};

/// All data to continue a run bit for bit, except particles of ranks, which have files of their own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Text of the scenario; another one is refused.
    pub scenario: String,
    pub seed: u64,
    /// Checksum of a flow field, compared by [`check_flow_field`](Self::check_flow_field).
    pub flow_field: Option<u64>,
    pub backend: String,
    /// Steps between rows, frames, and frames of the animation (0 without one).
    pub every: [u32; 3],
    pub files: Vec<FileRecord>,
    /// Files of ranks; empty if `state` has the particles.
    pub parts: Vec<PartRecord>,
    pub state: State,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, Serialize, Deserialize)]
#[repr(C)]
pub struct PartRecord {
    pub particles: u64,
    pub bound: u64,
    /// In its header.
    pub checksum: u64,
}

/// The first four fields differ between any two ranks or steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Part {
    seed: u64,
    step: u32,
    rank: u32,
    ranks: u32,
    particles: Particles,
    bound: Vec<Bound>,
}

impl PartRecord {
    fn counts(self) -> [u64; 2] {
        [self.particles, self.bound]
    }
}

impl Checkpoint {
    /// Writes a checkpoint, which replaces the former one once complete. Its parts must exist; others are removed.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        sealed::write(path, FileKind::Whole, self)?;
        forget_parts(path, self.state.step, self.parts.len() as u32);
        Ok(())
    }

    pub(crate) fn write_part(
        path: &Path,
        seed: u64,
        rank: u32,
        ranks: u32,
        state: &State,
    ) -> Result<PartRecord, Error> {
        let State { particles, bound, step, .. } = state;
        let counts = [particles.len() as u64, bound.len() as u64];
        let (particles, bound) = (particles.clone(), bound.clone());
        let part = Part { seed, step: *step, rank, ranks, particles, bound };
        let checksum = sealed::write(&part_of(path, *step, rank), FileKind::Part, &part)?;
        Ok(PartRecord { particles: counts[0], bound: counts[1], checksum })
    }

    /// Reads a checkpoint, without its parts.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::CheckpointVersion`] and [`Error::Damaged`].
    pub fn read(path: &Path) -> Result<Self, Error> {
        let (checkpoint, _): (Self, _) = sealed::read(path, FileKind::Whole)?;
        check_columns(path, &checkpoint.state.particles)?;
        Ok(checkpoint)
    }

    /// Checks that the model has the flow field of the run.
    ///
    /// # Errors
    /// [`Error::Checkpoint`] if the flow field has other contents now.
    pub fn check_flow_field(&self, path: &Path, model: &Model) -> Result<(), Error> {
        let now = model.flow_field().map(|field| field.checksum());
        let shown = |checksum: Option<u64>| checksum.map_or("none".to_owned(), |sum| format!("{sum:016x}"));
        if self.flow_field == now {
            return Ok(());
        }
        let (before, now) = (shown(self.flow_field), shown(now));
        let message = format!(
            "the flow field has the checksum {before} there and {now} now, since 'flow.file' has other contents; restore \
             that file, or start again with --overwrite"
        );
        Err(Error::Checkpoint { path: path.to_owned(), message })
    }

    /// Returns the state, with the parts of the checkpoint at `path`.
    ///
    /// # Errors
    /// See [`read`](Self::read).
    pub fn into_state(self, path: &Path) -> Result<State, Error> {
        self.into_slice(path, RankSlice::WHOLE)
    }

    pub(crate) fn into_slice(self, path: &Path, slice: RankSlice) -> Result<State, Error> {
        let Self { parts, mut state, .. } = self;
        let wanted = |k: usize| {
            let len = if k == 0 { state.particles.len() } else { state.bound.len() };
            let all = parts.iter().map(|part| part.counts()[k]).sum();
            slice.range(if parts.is_empty() { len as u64 } else { all }, 0)
        };
        let wanted = [0, 1].map(wanted);
        if parts.is_empty() {
            let [particles, bound] = wanted.map(|range| range.start as usize..range.end as usize);
            state.particles = state.particles.range(particles);
            state.bound = state.bound[bound].to_vec();
            return Ok(state);
        }
        let mut before = [0; 2];
        for (rank, record) in (0..).zip(parts) {
            let counts = record.counts();
            let ranges = [0, 1].map(|k| clamp_range(&wanted[k], before[k], counts[k]));
            before = [0, 1].map(|k| before[k] + counts[k]);
            let is_idle = slice.is_first() && counts == [0; 2];
            if ranges.iter().all(Range::is_empty) && !is_idle {
                continue;
            }
            let part = read_part(&part_of(path, state.step, rank), record)?;
            let [particles, bound] = ranges;
            state.particles.append(part.particles.range(particles));
            state.bound.extend(&part.bound[bound]);
        }
        Ok(state)
    }
}

fn read_part(path: &Path, record: PartRecord) -> Result<Part, Error> {
    let (part, found): (Part, _) = sealed::read(path, FileKind::Part)?;
    let damaged = |damage| Err(Error::Damaged { path: path.to_owned(), damage });
    let expected = record.checksum;
    if found != expected {
        return damaged(Damage::Foreign { found, expected });
    }
    check_columns(path, &part.particles)?;
    match [part.particles.len() as u64, part.bound.len() as u64] == record.counts() {
        true => Ok(part),
        false => {
            damaged(Damage::Content("it has another number of particles than the checkpoint says".to_owned()))
        }
    }
}

fn clamp_range(range: &Range<u64>, before: u64, count: u64) -> Range<usize> {
    let at = |index: u64| index.saturating_sub(before).min(count) as usize;
    at(range.start)..at(range.end)
}

fn part_of(path: &Path, step: u32, rank: u32) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{step:09}.{rank}"));
    name.into()
}

fn forget_parts(path: &Path, step: u32, parts: u32) {
    let directory = path.parent().filter(|parent| *parent != Path::new("")).unwrap_or(Path::new("."));
    let (Ok(entries), Some(name)) = (std::fs::read_dir(directory), path.file_name()) else { return };
    let prefix = format!("{}.", name.to_string_lossy());
    for entry in entries.flatten() {
        let file = entry.file_name();
        let numbers = file.to_str().and_then(|file| file.strip_prefix(&prefix)?.split_once('.'));
        let numbers =
            numbers.and_then(|(part_step, rank)| Some((part_step.parse().ok()?, rank.parse().ok()?)));
        let Some((part_step, rank)) = numbers else { continue };
        let belongs = part_step == step && rank < parts;
        // Other programs may number their backups.
        let is_part = part_of(path, part_step, rank).file_name() == Some(&file)
            && sealed::has_kind(&entry.path(), FileKind::Part);
        if is_part && !belongs {
            drop::<std::io::Result<()>>(std::fs::remove_file(entry.path()));
        }
    }
}

fn check_columns(path: &Path, particles: &Particles) -> Result<(), Error> {
    if particles.has_whole_columns() {
        return Ok(());
    }
    let damage = Damage::Content("its columns have different lengths".to_owned());
    Err(Error::Damaged { path: path.to_owned(), damage })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Particle, Totals};

    #[test]
    fn slices_of_parts_are_in_order_and_even() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("checkpoint");
        let counts = [7, 0, 2, 4];
        let mut next = 0..;
        let mut parts = Vec::new();
        for (rank, count) in (0..).zip(counts) {
            let mut state = State { step: 3, ..State::default() };
            for id in next.by_ref().take(count) {
                state.particles.push(Particle { id, ..Particle::default() }, true);
                state.bound.push(Bound { id: 100 + id, ..Bound::default() });
            }
            let record = Checkpoint::write_part(&path, 5, rank, 4, &state).expect("is written");
            assert_eq!(record.counts(), [count as u64; 2]);
            parts.push(record);
        }
        let checkpoint = Checkpoint {
            scenario: String::new(),
            seed: 5,
            flow_field: None,
            backend: "cpu".to_owned(),
            every: [1, 1, 0],
            files: Vec::new(),
            parts,
            state: State { step: 3, totals: Totals::default(), ..State::default() },
        };
        checkpoint.write(&path).expect("is written");
        let read = Checkpoint::read(&path).expect("is read");
        assert_eq!(read, checkpoint);
        for ranks in [1, 2, 3, 5] {
            let slices: Vec<State> = (0..ranks)
                .map(|rank| read.clone().into_slice(&path, RankSlice::new(rank, ranks)).expect("is read"))
                .collect();
            let ids = slices.iter().flat_map(|slice| slice.particles.id.clone());
            assert!(ids.eq(0..13));
            assert!(slices.iter().flat_map(|slice| &slice.bound).map(|bound| bound.id).eq(100..113));
            let even = |slice: &State| slice.particles.len().abs_diff(13 / ranks as usize) <= 1;
            assert!(slices.iter().all(even), "{ranks}");
        }
        let idle = part_of(&path, 3, 1);
        let whole = std::fs::read(&idle).expect("is there");
        std::fs::write(&idle, &whole[1..]).expect("is written");
        let refused = |rank| read.clone().into_slice(&path, RankSlice::new(rank, 2)).is_err();
        assert_eq!([0, 1].map(refused), [true, false]);
        std::fs::write(&idle, whole).expect("is written");
        let retained =
            ["checkpoint.2024.11", "checkpoint.000000003.7"].map(|name| directory.path().join(name));
        retained.iter().for_each(|path| std::fs::write(path, "the work of years").expect("is written"));
        let unnamed = directory.path().join("checkpoint.3.2");
        std::fs::copy(part_of(&path, 3, 2), &unnamed).expect("is copied");
        Checkpoint { parts: Vec::new(), ..checkpoint }.write(&path).expect("is written");
        assert!(retained.iter().chain([&unnamed]).all(|path| path.exists()));
        assert_eq!(std::fs::read_dir(directory.path()).expect("is there").count(), 4);
    }
}
