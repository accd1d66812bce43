use std::ops::{ControlFlow, Range};
use std::sync::Mutex;
use std::sync::atomic::AtomicU64;

use lazygrid_kernels::{Algorithm, Pair};

use crate::cell_list::CellList;
use crate::choice::Structure;
use crate::compare::{Columns, Count, Output, Rule, To, Written};
use crate::finder::{PairSource, TakePairs, TakePart, ranges};
use crate::input::Input;
use crate::memory::{collect, extend};
use crate::paper::{ArrayGrid, HashGrid, RecursiveGrid};
use crate::scatter::shared;
use crate::skin::Course;
use crate::threads::Threads;
use crate::{Error, Kept, Rebuilt, Report, Settings, choice, naive};

/// All that survives between calls, apart from the pool, in which the rest of the work runs.
#[derive(Debug, Default)]
pub(crate) struct State {
    pub(crate) report: Report,
    columns: Columns,
    cell_list: CellList,
    pub(crate) course: Course,
    /// `true` if this call is served from candidates.
    from_candidates: bool,
    hash_grid: HashGrid,
    array_grid: ArrayGrid,
    recursive_grid: RecursiveGrid,
    spare: Vec<Vec<Pair>>,
}

impl State {
    /// Takes up where the spheres are now, where candidates are kept. Says why they cannot serve the call, if they
    /// cannot; [`Rebuilt::First`] if there are none.
    pub(crate) fn advance(
        &mut self,
        settings: &Settings,
        rule: &Rule<'_>,
        threads: Threads,
    ) -> Result<Option<Rebuilt>, Error> {
        if !settings.keeps_candidates() {
            return Ok(Some(Rebuilt::First));
        }
        let Self { report, course, cell_list, .. } = self;
        let is_kept = course.candidates.survey().is_some();
        let mut advance = || course.advance(settings.skin, (rule, cell_list), threads);
        match is_kept {
            true => report.time("measure", advance),
            // There is nothing to measure but a sample.
            false => advance(),
        }
    }

    /// Chooses and builds, unless candidates serve the call.
    pub(crate) fn build(&mut self, input: &mut Input<'_>, lapsed: Option<Rebuilt>) -> Result<(), Error> {
        self.from_candidates = lapsed.is_none();
        if self.from_candidates {
            self.report.algorithm = Algorithm::CellList;
        } else {
            let (algorithm, reason) = match input.split {
                None => choice::choose(input.settings.algorithm, &input.survey),
                Some(split) => choice::choose_between(input.settings.algorithm, &input.survey, split),
            };
            (self.report.algorithm, self.report.reason) = (algorithm, reason);
            self.structure(input)?;
        }
        if self.report.algorithm == Algorithm::CellList && self.cell_list.touch_decides() {
            // Candidates are those of the list as it is, and of its groups.
            input.rule.decided_by_radii();
        }
        if self.from_candidates {
            let kept = self.course.candidates.kept(lapsed);
            self.report.candidates = Some(kept);
            let Kept { count, age, .. } = kept;
            self.report.reason = match lapsed {
                None => format!("cell-list: {count} candidates of {age} calls ago"),
                Some(why) => format!("{}; {count} candidates were found: {why}", self.report.reason),
            };
        }
        log::debug!("{}", self.report.reason);
        Ok(())
    }

    /// Returns `true` if a search is expected to end before other threads would be awake.
    pub(crate) fn is_short(&self, input: &Input<'_>) -> bool {
        match self.report.algorithm {
            _ if self.from_candidates => false,
            Algorithm::Naive => Threads::is_short(naive::time(input.survey.spheres)),
            Algorithm::CellList => Threads::is_short(self.cell_list.time()),
            _ => false,
        }
    }

    /// Builds what the algorithm searches.
    fn structure(&mut self, input: &Input<'_>) -> Result<(), Error> {
        let Self {
            report,
            columns,
            cell_list,
            course,
            from_candidates,
            hash_grid,
            array_grid,
            recursive_grid,
            ..
        } = self;
        match Structure::of(report.algorithm)? {
            Structure::Naive => {
                report.time("gather", || columns.gather(&input.rule, 0..input.survey.spheres as u32))
            }
            Structure::HashGrid => hash_grid.build(input, report),
            Structure::ArrayGrid => array_grid.build(input, report),
            Structure::RecursiveGrid => recursive_grid.build(input, report),
            Structure::CellList => {
                *from_candidates = course.find(cell_list, input, report)?;
                Ok(())
            }
        }
    }

    pub(crate) fn search<'o, O: Output>(
        &mut self,
        input: &Input<'_>,
        output: &'o O,
    ) -> Result<O::Sink<'o>, Error> {
        let Self { report, columns, cell_list, course, hash_grid, array_grid, recursive_grid, .. } = self;
        if self.from_candidates {
            return report.time("test", || course.candidates.search(input, output));
        }
        let structure = Structure::of(report.algorithm)?;
        report.time("search", || match structure {
            Structure::Naive => naive::search(input, columns, output),
            Structure::HashGrid => hash_grid.search(input, output),
            Structure::ArrayGrid => array_grid.search(input, output),
            Structure::RecursiveGrid => recursive_grid.search(input, output),
            Structure::CellList => cell_list.search(input, output),
        })
    }

    /// Collects at most `limit` pairs, of those with `i` in `window` if there is one; returns how many there are and
    /// the chunks.
    fn collect(
        &mut self,
        input: &Input<'_>,
        limit: u64,
        window: Option<Range<u32>>,
    ) -> Result<(u64, Vec<Vec<Pair>>), Error> {
        let list = To::List { limit, kept: AtomicU64::new(0) };
        let output = Written { window, ..Written::new(list, std::mem::take(&mut self.spare)) };
        let found = self.search(input, &output)?.finish()?;
        self.spare = output.into_spare();
        Ok(found)
    }

    /// Hands over collected chunks and keeps their memory.
    fn hand_over(
        &mut self,
        mut chunks: Vec<Vec<Pair>>,
        take: TakePart<'_>,
    ) -> Result<ControlFlow<()>, Error> {
        let flow = take(&mut chunks);
        extend(&mut self.spare, chunks.drain(..), "chunks of pairs")?;
        Ok(flow)
    }
}

/// The structure that is built for a query.
pub(crate) struct Built<'b> {
    pub(crate) state: &'b mut State,
    pub(crate) input: &'b Input<'b>,
}

impl PairSource for Built<'_> {
    fn count(&mut self) -> Result<u64, Error> {
        Ok(self.state.search(self.input, &Count)?.0)
    }

    fn list(&mut self, limit: u64, take: TakePart<'_>) -> Result<u64, Error> {
        let (found, chunks) = self.state.collect(self.input, limit, None)?;
        if found > limit {
            self.state.spare.clear();
        } else {
            let _ = self.state.hand_over(chunks, take)?;
        }
        Ok(found)
    }

    /// As one part if there are at most `limit` pairs, else by one search for each range of consecutive `i`.
    fn ascending(&mut self, limit: u64, take: TakePart<'_>) -> Result<(), Error> {
        let Self { state, input } = self;
        let (found, chunks) = state.collect(input, limit, None)?;
        if found <= limit {
            return state.hand_over(chunks, take).map(|_| ());
        }
        drop(chunks);
        let mut counts = collect(std::iter::repeat_n(0_u32, input.survey.spheres), "pairs of each sphere")?;
        let tally = Written::new(To::Tally(shared(&mut counts)), std::mem::take(&mut state.spare));
        state.search(input, &tally)?.finish()?;
        state.spare = tally.into_spare();
        for range in ranges(&counts, limit) {
            let (_, chunks) = state.collect(input, u64::MAX, Some(range))?;
            if state.hand_over(chunks, take)?.is_break() {
                break;
            }
        }
        Ok(())
    }

    fn unordered(&mut self, take: TakePairs<'_>) -> Result<(), Error> {
        let Self { state, input } = self;
        let output = Written::new(To::Consumer(Mutex::new(take)), std::mem::take(&mut state.spare));
        state.search(input, &output)?.finish()?;
        state.spare = output.into_spare();
        Ok(())
    }
}
