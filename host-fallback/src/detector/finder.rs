use std::ops::{ControlFlow, Range};
use std::sync::Arc;
use std::time::Instant;

use lazygrid_kernels::{Pair, Query};

use crate::compare::PairConsumer;
use crate::disjoint_writes::split_at;
use crate::executor::{MIN_PARALLEL_SPHERES, Team};
use crate::memory::{try_collect, try_resize};
use crate::output::{NeighborsBuilder, PairSorter};
use crate::{Error, Neighbors, Order, PhaseTime, Settings};

/// Maximum pairs of a streamed, copied chunk of two sets: 8 MiB.
const MAX_STREAM_CHUNK: usize = 1 << 20;
/// Searches for a sorted stream above which its parts may exceed the limit of a list.
const MAX_RANGES: u64 = 16;
/// Tiles among which threads divide the sort of pairs.
const ORDER_TILES: usize = 128;

/// Receives chunks that form one part of the result.
pub type ChunkConsumer<'t> = &'t mut (dyn FnMut(&mut [Vec<Pair>]) -> ControlFlow<()> + Send);
/// Searches in the index that a backend has built for a query.
pub type Work<'w> = &'w mut (dyn FnMut(&mut dyn PairSource) -> Result<(), Error> + Send);

/// The index of one query. Indices of a second set follow the first.
pub trait PairSource {
    fn count(&mut self) -> Result<u64, Error>;

    /// Passes all pairs as one part, unless they exceed `limit`, and returns their number.
    fn list(&mut self, limit: u64, take: ChunkConsumer<'_>) -> Result<u64, Error>;

    /// Passes parts with ascending first indices, of at most `limit` pairs unless a single sphere, the output of a
    /// device, or a range of [`ranges`] has more.
    fn ascending(&mut self, limit: u64, take: ChunkConsumer<'_>) -> Result<(), Error>;

    fn unordered(&mut self, take: PairConsumer<'_>) -> Result<(), Error>;
}

pub trait SearchBackend {
    fn settings(&self) -> &Settings;

    fn team(&self) -> &Arc<Team>;

    fn report_mut(&mut self) -> (&mut u64, &mut Vec<PhaseTime>);

    /// Checks a query, chooses an algorithm, builds its index, and lets `work` search.
    fn search(&mut self, query: &Query<'_>, work: Work<'_>) -> Result<(), Error>;
}

impl<B: SearchBackend + ?Sized> SearchBackend for Box<B> {
    fn settings(&self) -> &Settings {
        (**self).settings()
    }

    fn team(&self) -> &Arc<Team> {
        (**self).team()
    }

    fn report_mut(&mut self) -> (&mut u64, &mut Vec<PhaseTime>) {
        (**self).report_mut()
    }

    fn search(&mut self, query: &Query<'_>, work: Work<'_>) -> Result<(), Error> {
        (**self).search(query, work)
    }
}

/// Finds overlapping pairs on a backend, in reused buffers.
#[derive(Debug)]
pub struct PairFinder<B> {
    backend: B,
    sorter: PairSorter,
    lists: NeighborsBuilder,
    pairs: Vec<Pair>,
    numbering: Numbering,
}

impl<B: SearchBackend> PairFinder<B> {
    pub fn on(backend: B) -> Self {
        let (sorter, lists, pairs, numbering) = Default::default();
        Self { backend, sorter, lists, pairs, numbering }
    }

    /// Returns the overlapping pairs, each once, in the order of the settings.
    ///
    /// # Errors
    /// [`Error::Input`], [`Error::TooManyPairs`] above the limit, [`Error::OutOfMemory`], and errors of the backend.
    pub fn pairs<'a>(&mut self, query: impl Into<Query<'a>>) -> Result<&[Pair], Error> {
        self.list(&query.into(), self.backend.settings().order)?;
        Ok(&self.pairs)
    }

    /// Finds the pairs in this order, for [`last_pairs`](Self::last_pairs).
    ///
    /// # Errors
    /// See [`pairs`](Self::pairs).
    pub fn list(&mut self, query: &Query<'_>, order: Order) -> Result<(), Error> {
        let listed = self.find_list(query, order);
        // A failed search must not leave an earlier list. Clearing it before would cost each call a refill.
        if listed.is_err() {
            self.pairs.clear();
        }
        listed
    }

    fn find_list(&mut self, query: &Query<'_>, order: Order) -> Result<(), Error> {
        let Self { backend, sorter, pairs, .. } = self;
        let (limit, team) = (backend.settings().max_pairs, backend.team().clone());
        let (mut found, mut ordering) = (0, None);
        backend.search(query, &mut |source| {
            let mut arranged = Ok(());
            found = source.list(limit, &mut |chunks| {
                let start = Instant::now();
                arranged = match order {
                    Order::Canonical => put_in_order(sorter, chunks, query.len(), &team, pairs),
                    Order::Unordered => join(chunks, &team, pairs),
                };
                ordering = Some(start.elapsed());
                ControlFlow::Continue(())
            })?;
            arranged
        })?;
        let (count, phases) = backend.report_mut();
        *count = found;
        if let Some(time) = ordering {
            PhaseTime::add(phases, "order", time);
        }
        if found > limit {
            return Err(Error::TooManyPairs { found, limit });
        }
        if let Some(split) = query.split() {
            pairs.iter_mut().for_each(|pair| pair.j -= split as u32);
        }
        Ok(())
    }

    pub fn last_pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// Returns the last list, without a copy; no pairs after a failed search.
    pub fn into_pairs(self) -> Vec<Pair> {
        self.pairs
    }

    pub fn backend(&self) -> &B {
        &self.backend
    }

    /// Returns the phases of the last call. The caller may add phases.
    pub fn phases_mut(&mut self) -> &mut Vec<PhaseTime> {
        self.backend.report_mut().1
    }

    /// # Errors
    /// See [`pairs`](Self::pairs).
    pub fn neighbors<'a>(&mut self, query: impl Into<Query<'a>>) -> Result<Neighbors<'_>, Error> {
        let query = query.into();
        self.list(&query, Order::Canonical)?;
        let start = Instant::now();
        let neighbors = self.lists.fill_query(&self.pairs, &query)?;
        PhaseTime::add(self.backend.report_mut().1, "neighbors", start.elapsed());
        Ok(neighbors)
    }

    /// # Errors
    /// See [`pairs`](Self::pairs), except [`Error::TooManyPairs`].
    pub fn count<'a>(&mut self, query: impl Into<Query<'a>>) -> Result<u64, Error> {
        let mut found = 0;
        self.backend.search(&query.into(), &mut |source| {
            found = source.count()?;
            Ok(())
        })?;
        *self.backend.report_mut().0 = found;
        Ok(found)
    }

    /// Passes the pairs to `consume` in chunks of at most `chunk` and returns their number.
    ///
    /// # Errors
    /// See [`count`](Self::count).
    pub fn stream<'a, F>(
        &mut self,
        query: impl Into<Query<'a>>,
        chunk: usize,
        mut consume: F,
    ) -> Result<u64, Error>
    where
        F: FnMut(&[Pair]) -> ControlFlow<()> + Send,
    {
        let query = query.into();
        let Self { backend, sorter, pairs: ordered, numbering, .. } = self;
        let Settings { order, max_pairs: limit, .. } = *backend.settings();
        let team = backend.team().clone();
        let chunk = numbering.begin(chunk, query.split())?;
        let mut handed = 0;
        let mut hand_over = |pairs: &[Pair]| {
            pairs.chunks(chunk).try_for_each(|slice| {
                handed += slice.len() as u64;
                consume(numbering.renumber(slice))
            })
        };
        backend.search(&query, &mut |source| {
            if order == Order::Unordered {
                return source.unordered(&mut hand_over);
            }
            let mut arranged = Ok(());
            source.ascending(limit, &mut |chunks| {
                arranged = put_in_order(sorter, chunks, query.len(), &team, ordered);
                if arranged.is_ok() { hand_over(ordered) } else { ControlFlow::Break(()) }
            })?;
            arranged
        })?;
        *backend.report_mut().0 = handed;
        Ok(handed)
    }
}

fn put_in_order(
    sorter: &mut PairSorter,
    chunks: &[Vec<Pair>],
    spheres: usize,
    team: &Team,
    pairs: &mut Vec<Pair>,
) -> Result<(), Error> {
    let found: usize = chunks.iter().map(Vec::len).sum();
    let tile = found.div_ceil(ORDER_TILES).max(MIN_PARALLEL_SPHERES);
    let tiles = chunks.iter().map(|chunk| chunk.len().div_ceil(tile)).sum();
    let mut tiled = chunks.iter().flat_map(|chunk| chunk.chunks(tile));
    let tiled = try_collect((0..tiles).map(|_| tiled.next().unwrap_or_default()), "chunks of pairs")?;
    team.pass(found, |executor| sorter.order(executor, &tiled, spheres, pairs))
}

fn join(chunks: &mut [Vec<Pair>], team: &Team, pairs: &mut Vec<Pair>) -> Result<(), Error> {
    if let [only] = chunks
        && only.len() > MIN_PARALLEL_SPHERES
    {
        // A device's list. Chunks of the CPU are short and keep their memory.
        std::mem::swap(only, pairs);
        return Ok(());
    }
    let mut end = 0;
    let ends = chunks.iter().map(|chunk| {
        end += chunk.len();
        end
    });
    let ends = try_collect(ends, "chunks of pairs")?;
    try_resize(pairs, end, "pairs")?;
    let mut targets = split_at(pairs, ends.into_iter())?;
    team.pass(end, |executor| {
        executor.for_each(&mut targets, |k, target| target.copy_from_slice(&chunks[k]));
        Ok(())
    })
}

/// Returns the largest consecutive index ranges of at most `most` pairs by `counts`, or of a single index. Instead of
/// more than 16 ranges, they have more pairs, up to a quarter of the number of spheres. This takes less memory than an
/// index, and bounds the searches by the pairs per sphere.
pub fn ranges(counts: &[u32], most: u64) -> impl Iterator<Item = Range<u32>> {
    let found: u64 = counts.iter().map(|&count| u64::from(count)).sum();
    let most = most.max((found / MAX_RANGES).min(counts.len() as u64 / 4));
    let mut from = 0;
    std::iter::from_fn(move || {
        let mut total = 0;
        let fits = |count: &&u32| {
            total += u64::from(**count);
            total <= most
        };
        let to = from + counts.get(from..)?.iter().take_while(fits).count().max(1);
        let range = (from < counts.len()).then_some(from as u32..to as u32);
        from = to;
        range
    })
}

/// Gives spheres of the second set their index in that set.
#[derive(Debug, Default)]
struct Numbering {
    split: Option<u32>,
    renumbered: Vec<Pair>,
}

impl Numbering {
    fn begin(&mut self, chunk: usize, split: Option<usize>) -> Result<usize, Error> {
        self.split = split.map(|split| split as u32);
        if split.is_none() {
            return Ok(chunk.max(1));
        }
        let chunk = chunk.clamp(1, MAX_STREAM_CHUNK);
        try_resize(&mut self.renumbered, chunk, "a chunk of pairs")?;
        Ok(chunk)
    }

    fn renumber<'p>(&'p mut self, pairs: &'p [Pair]) -> &'p [Pair] {
        let Some(split) = self.split else { return pairs };
        let renumbered = &mut self.renumbered[..pairs.len()];
        renumbered.iter_mut().zip(pairs).for_each(|(own, pair)| *own = Pair { i: pair.i, j: pair.j - split });
        renumbered
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_at_most_the_limit_or_one_index() {
        let collected = |counts: &[u32], most| ranges(counts, most).collect::<Vec<_>>();
        assert_eq!(collected(&[], 3), []);
        assert_eq!(collected(&[1, 1, 1, 1], 2), [0..2, 2..4]);
        assert_eq!(collected(&[5, 0, 0, 3, 9, 1], 3), [0..1, 1..4, 4..5, 5..6]);
        assert_eq!(collected(&[0, 0, 1], 0), [0..2, 2..3]);
        assert_eq!(collected(&[1; 400], 3).len(), 16);
        assert_eq!(collected(&[100; 400], 3).len(), 400);
    }
}
