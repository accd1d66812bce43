use std::ops::{ControlFlow, Range};
use std::sync::Mutex;
use std::sync::atomic::AtomicU64;

use lazygrid_kernels::{Algorithm, Pair};

use super::algorithm_choice::{self, IndexKind};
use super::finder::{ChunkConsumer, PairSource, ranges};
use crate::cell_list::CellList;
use crate::compare::{ChunkTarget, ChunkedOutput, Count, Output, PairConsumer, deliver_unordered};
use crate::disjoint_writes::shared;
use crate::executor::Executor;
use crate::grids::{ArrayGrid, HashGrid, RecursiveGrid};
use crate::input::{Division, SearchInput};
use crate::memory::{try_collect, try_extend};
use crate::naive::{self, Naive};
use crate::skin::{CallSpheres, SkinController};
use crate::{CandidateListStats, Error, RebuildReason, Report, Settings};

#[derive(Debug, Default)]
pub(crate) struct DetectorState {
    pub(crate) report: Report,
    naive: Naive,
    cell_list: CellList,
    pub(crate) skin: SkinController,
    from_candidates: bool,
    hash_grid: HashGrid,
    array_grid: ArrayGrid,
    recursive_grid: RecursiveGrid,
    free_chunks: Vec<Vec<Pair>>,
}

impl DetectorState {
    pub(crate) fn advance(
        &mut self,
        settings: &Settings,
        spheres: CallSpheres<'_>,
        executor: Executor,
    ) -> Result<Option<RebuildReason>, Error> {
        if !settings.keeps_candidates() {
            return Ok(Some(RebuildReason::NoList));
        }
        let Self { report, skin, cell_list, .. } = self;
        let has_candidate_list = skin.candidates.input_stats().is_some();
        let mut advance = || skin.advance(settings, spheres, cell_list, executor);
        match has_candidate_list {
            true => report.time("measure", advance),
            false => advance(),
        }
    }

    pub(crate) fn build(
        &mut self,
        input: &mut SearchInput<'_>,
        rebuild_reason: Option<RebuildReason>,
    ) -> Result<(), Error> {
        self.from_candidates = rebuild_reason.is_none();
        if self.from_candidates {
            self.report.algorithm = Algorithm::CellList;
        } else {
            let (requested, stats) = (input.settings.algorithm, &input.stats);
            (self.report.algorithm, self.report.reason) = match input.split {
                None => algorithm_choice::choose(requested, stats),
                Some(split) => algorithm_choice::choose_between(requested, stats, split),
            };
            self.build_index(input)?;
        }
        let is_by_radii = match self.report.algorithm {
            Algorithm::CellList => self.cell_list.touch_decides(),
            _ => input.grouping(Division::ByPartners).is_by_radii(),
        };
        if is_by_radii {
            input.test.decided_by_radii();
        }
        if self.from_candidates {
            let stats = self.skin.candidates.stats(rebuild_reason);
            self.report.candidates = Some(stats);
            let CandidateListStats { count, age, .. } = stats;
            self.report.reason = match rebuild_reason {
                None => format!("cell-list: {count} candidates of {age} calls ago"),
                Some(why) => format!("{}; {count} candidates were found: {why}", self.report.reason),
            };
        }
        log::debug!("{}", self.report.reason);
        Ok(())
    }

    pub(crate) fn is_short(&self, input: &SearchInput<'_>) -> bool {
        match self.report.algorithm {
            _ if self.from_candidates => false,
            Algorithm::Naive => Executor::is_short(naive::time(input.stats.spheres)),
            Algorithm::CellList => Executor::is_short(self.cell_list.time()),
            _ => false,
        }
    }

    fn build_index(&mut self, input: &SearchInput<'_>) -> Result<(), Error> {
        match IndexKind::from_algorithm(self.report.algorithm)? {
            IndexKind::Naive => self.report.time("gather", || self.naive.build(input)),
            IndexKind::HashGrid => self.hash_grid.build(input, &mut self.report),
            IndexKind::ArrayGrid => self.array_grid.build(input, &mut self.report),
            IndexKind::RecursiveGrid => self.recursive_grid.build(input, &mut self.report),
            IndexKind::CellList => {
                self.from_candidates = self.skin.find(&mut self.cell_list, input, &mut self.report)?;
                Ok(())
            }
        }
    }

    pub(crate) fn search<'o, O: Output>(
        &mut self,
        input: &SearchInput<'_>,
        output: &'o O,
    ) -> Result<O::Sink<'o>, Error> {
        // Searches read the flag between chunks, of which few spheres may have none.
        if input.is_stopped() {
            return Err(Error::Cancelled);
        }
        let Self { report, naive, cell_list, skin, hash_grid, array_grid, recursive_grid, .. } = self;
        if self.from_candidates {
            return report.time("test", || skin.candidates.search(input, output));
        }
        let structure = IndexKind::from_algorithm(report.algorithm)?;
        report.time("search", || match structure {
            IndexKind::Naive => naive.search(input, output),
            IndexKind::HashGrid => hash_grid.search(input, output),
            IndexKind::ArrayGrid => array_grid.search(input, output),
            IndexKind::RecursiveGrid => recursive_grid.search(input, output),
            IndexKind::CellList => cell_list.search(input, output),
        })
    }

    fn collect(
        &mut self,
        input: &SearchInput<'_>,
        limit: u64,
        window: Option<Range<u32>>,
    ) -> Result<(u64, Vec<Vec<Pair>>), Error> {
        let list = ChunkTarget::List { limit, collected: AtomicU64::new(0) };
        let output =
            ChunkedOutput { window, ..ChunkedOutput::new(list, std::mem::take(&mut self.free_chunks)) };
        let found = self.search(input, &output)?.finish()?;
        self.free_chunks = output.into_free_chunks();
        Ok(found)
    }

    fn deliver_chunks(
        &mut self,
        mut chunks: Vec<Vec<Pair>>,
        take: ChunkConsumer<'_>,
    ) -> Result<ControlFlow<()>, Error> {
        let flow = take(&mut chunks);
        try_extend(&mut self.free_chunks, chunks.drain(..), "chunks of pairs")?;
        Ok(flow)
    }
}

pub(crate) struct BuiltSearch<'b> {
    pub(crate) state: &'b mut DetectorState,
    pub(crate) input: &'b SearchInput<'b>,
}

impl PairSource for BuiltSearch<'_> {
    fn count(&mut self) -> Result<u64, Error> {
        Ok(self.state.search(self.input, &Count)?.0)
    }

    fn list(&mut self, limit: u64, take: ChunkConsumer<'_>) -> Result<u64, Error> {
        let (found, chunks) = self.state.collect(self.input, limit, None)?;
        if found > limit {
            self.state.free_chunks.clear();
        } else {
            let _ = self.state.deliver_chunks(chunks, take)?;
        }
        Ok(found)
    }

    /// Searches again for each range of `i` if more than `limit` pairs exist.
    fn ascending(&mut self, limit: u64, take: ChunkConsumer<'_>) -> Result<(), Error> {
        let Self { state, input } = self;
        let (found, chunks) = state.collect(input, limit, None)?;
        if found <= limit {
            return state.deliver_chunks(chunks, take).map(|_| ());
        }
        drop(chunks);
        let mut counts =
            try_collect(std::iter::repeat_n(0_u32, input.stats.spheres), "pairs of each sphere")?;
        let to = ChunkTarget::Tally(shared(&mut counts));
        let tally = ChunkedOutput::new(to, std::mem::take(&mut state.free_chunks));
        state.search(input, &tally)?.finish()?;
        state.free_chunks = tally.into_free_chunks();
        for range in ranges(&counts, limit) {
            let (_, chunks) = state.collect(input, u64::MAX, Some(range))?;
            if state.deliver_chunks(chunks, take)?.is_break() {
                break;
            }
        }
        Ok(())
    }

    fn unordered(&mut self, take: PairConsumer<'_>) -> Result<(), Error> {
        let Self { state, input } = self;
        let mut free_chunks = std::mem::take(&mut state.free_chunks);
        if input.executor == Executor::Pool {
            let delivered = deliver_unordered(take, &mut free_chunks, |output| {
                state.search(input, output)?.finish().map(drop)
            });
            state.free_chunks = free_chunks;
            return delivered;
        }
        let output = ChunkedOutput::new(ChunkTarget::Consumer(Mutex::new(take)), free_chunks);
        state.search(input, &output)?.finish()?;
        state.free_chunks = output.into_free_chunks();
        Ok(())
    }
}
