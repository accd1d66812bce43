use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::AtomicU64;

use lazygrid_kernels::{Algorithm, Pair};

use crate::canonical::Canonical;
use crate::cell_list::CellList;
use crate::choice::Structure;
use crate::compare::{Columns, Consume, Output, Rule, To, Written};
use crate::input::Input;
use crate::memory::{collect, extend, resize};
use crate::neighbors::Lists;
use crate::paper::{ArrayGrid, HashGrid, RecursiveGrid};
use crate::scatter::{shared, split_at};
use crate::skin::Course;
use crate::threads::Threads;
use crate::{Error, Kept, Order, Rebuilt, Report, Settings, choice, naive};

/// All that survives between calls, apart from the pool, in which the rest of the work runs.
#[derive(Debug, Default)]
pub(crate) struct State {
    pub(crate) report: Report,
    columns: Columns,
    cell_list: CellList,
    pub(crate) course: Course,
    /// Whether this call is served from candidates.
    from_candidates: bool,
    hash_grid: HashGrid,
    array_grid: ArrayGrid,
    recursive_grid: RecursiveGrid,
    canonical: Canonical,
    spare: Vec<Vec<Pair>>,
    pub(crate) pairs: Vec<Pair>,
    pub(crate) lists: Lists,
}

impl State {
    /// Takes up where the spheres are now, where candidates are kept. Says why they cannot serve the call, if they
    /// cannot; [`Rebuilt::First`] where there are none.
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

    /// Whether a search is expected to end before other threads would be awake.
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

    /// Collects at most `limit` pairs, of those with `i` in `window` where there is one; returns how many there are and
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

    /// Moves collected chunks into `pairs` and keeps their memory.
    fn arrange(&mut self, mut chunks: Vec<Vec<Pair>>, order: Order, input: &Input<'_>) -> Result<(), Error> {
        let Self { report, canonical, pairs, .. } = self;
        report.time("order", || match order {
            Order::Canonical => {
                let chunks = collect(chunks.iter().map(Vec::as_slice), "chunks of pairs")?;
                canonical.order(input.threads, &chunks, input.survey.spheres, pairs)
            }
            Order::Unordered => {
                let mut end = 0;
                let ends = chunks.iter().map(|chunk| {
                    end += chunk.len();
                    end
                });
                let ends = collect(ends, "chunks of pairs")?;
                resize(pairs, end, "pairs")?;
                let mut targets = split_at(pairs, ends.into_iter())?;
                input.threads.each(&mut targets, |k, target| {
                    target.copy_from_slice(&chunks[k]);
                });
                Ok(())
            }
        })?;
        extend(&mut self.spare, chunks.drain(..), "chunks of pairs")
    }

    pub(crate) fn list(&mut self, input: &Input<'_>, order: Order) -> Result<(), Error> {
        let limit = input.settings.max_pairs;
        let (found, chunks) = self.collect(input, limit, None)?;
        self.report.pairs = found;
        if found > limit {
            self.spare.clear();
            return Err(Error::TooManyPairs { found, limit });
        }
        self.arrange(chunks, order, input)?;
        if let Some(split) = input.split {
            self.pairs.iter_mut().for_each(|pair| pair.j -= split as u32);
        }
        Ok(())
    }

    /// Streams as the threads find.
    pub(crate) fn hand_over(&mut self, input: &Input<'_>, consume: Consume<'_>) -> Result<(), Error> {
        let output = Written::new(To::Consumer(Mutex::new(consume)), std::mem::take(&mut self.spare));
        self.search(input, &output)?.finish()?;
        self.spare = output.into_spare();
        Ok(())
    }

    /// Streams in canonical order: from one list where that is within the limit, else from as many lists of
    /// consecutive `i` as it takes, one search for each.
    pub(crate) fn stream_in_order(
        &mut self,
        input: &Input<'_>,
        limit: u64,
        consume: Consume<'_>,
    ) -> Result<(), Error> {
        let (found, chunks) = self.collect(input, limit, None)?;
        let spheres = input.survey.spheres;
        if found <= limit {
            self.arrange(chunks, Order::Canonical, input)?;
            let _ = consume(&self.pairs);
            return Ok(());
        }
        drop(chunks);
        let mut counts = collect(std::iter::repeat_n(0_u32, spheres), "pairs of each sphere")?;
        let tally = Written::new(To::Tally(shared(&mut counts)), std::mem::take(&mut self.spare));
        self.search(input, &tally)?.finish()?;
        self.spare = tally.into_spare();

        let mut from = 0;
        while from < spheres {
            let mut total = 0;
            let fits = |count: &&u32| {
                total += u64::from(**count);
                total <= limit
            };
            let to = from + counts[from..].iter().take_while(fits).count().max(1);
            let (_, chunks) = self.collect(input, u64::MAX, Some(from as u32..to as u32))?;
            self.arrange(chunks, Order::Canonical, input)?;
            if consume(&self.pairs).is_break() {
                break;
            }
            from = to;
        }
        Ok(())
    }
}
