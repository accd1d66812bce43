use std::ops::{ControlFlow, Range};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use lazygrid_kernels::{Algorithm, Pair, Space, Sphere, Spheres};
use rayon::ThreadPool;

use crate::array_grid::ArrayGrid;
use crate::canonical::Canonical;
use crate::cell_list::CellList;
use crate::columns::Columns;
use crate::contact::Rule;
use crate::hash_grid::HashGrid;
use crate::memory::{collect, extend, resize, with_growth};
use crate::neighbors::Lists;
use crate::recursive_grid::RecursiveGrid;
use crate::scatter::{shared, split_at};
use crate::simd::Task;
use crate::sink::{Consume, Count, Output, To, Written};
use crate::survey::{Survey, check, check_species};
use crate::threads::{self, Threads};
use crate::{Error, Neighbors, Order, Report, Settings, Simd, choice, naive};

/// Spheres per piece of wrapping.
const WRAPPED: usize = 1 << 14;

/// Finds overlapping pairs on the CPU, call after call, reusing its buffers.
#[derive(Debug)]
pub struct HostDetector {
    settings: Settings,
    pool: Option<ThreadPool>,
    state: State,
}

/// All that survives between calls, apart from the pool, in which the rest of the work runs.
#[derive(Debug)]
struct State {
    report: Report,
    /// The spheres' images nearest to the origin, where space is periodic.
    wrapped: Vec<Sphere>,
    columns: Columns,
    cell_list: CellList,
    hash_grid: HashGrid,
    array_grid: ArrayGrid,
    recursive_grid: RecursiveGrid,
    canonical: Canonical,
    spare: Vec<Vec<Pair>>,
    pairs: Vec<Pair>,
    lists: Lists,
}

/// What a detector works on: spheres that were checked and surveyed.
pub(crate) struct Input<'a> {
    pub(crate) rule: Rule<'a>,
    pub(crate) survey: Survey,
    pub(crate) settings: &'a Settings,
    pub(crate) simd: Simd,
    pub(crate) threads: Threads,
}

impl Input<'_> {
    /// Runs comparisons in the vector code of the settings, between nearest images where space is periodic.
    pub(crate) fn run<T: Task>(&self, task: T) -> T::Result {
        self.simd.run(task, self.rule.images())
    }

    /// Whether the caller wants the search to end; asked before each piece of work.
    pub(crate) fn is_stopped(&self) -> bool {
        self.settings.stop.as_ref().is_some_and(|stop| stop.load(Relaxed))
    }

    pub(crate) fn is_periodic(&self) -> bool {
        self.settings.space.is_periodic()
    }
}

impl HostDetector {
    /// A detector with these settings.
    ///
    /// # Errors
    /// [`Error::Setting`] for a setting outside its range, [`Error::NotOnBackend`] for a GPU algorithm,
    /// [`Error::Threads`] where the system refuses the threads.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        settings.check()?;
        let pool = match settings.threads {
            // One thread is the calling one.
            None | Some(1) => None,
            Some(threads) => Some(threads::pool(threads)?),
        };
        log::debug!("vector code: {:?}", settings.simd);
        let report = Report { algorithm: settings.algorithm, ..Report::default() };
        let state = State {
            report,
            wrapped: Vec::new(),
            columns: Columns::default(),
            cell_list: CellList::default(),
            hash_grid: HashGrid::default(),
            array_grid: ArrayGrid::default(),
            recursive_grid: RecursiveGrid::default(),
            canonical: Canonical::default(),
            spare: Vec::new(),
            pairs: Vec::new(),
            lists: Lists::default(),
        };
        Ok(Self { settings, pool, state })
    }

    /// The overlapping pairs, each once, in the order of the settings.
    ///
    /// # Errors
    /// [`Error::Input`] for a bad input, [`Error::TooManyPairs`] above the limit, [`Error::OutOfMemory`].
    pub fn pairs(&mut self, spheres: Spheres<'_>) -> Result<&[Pair], Error> {
        let order = self.settings.order;
        self.run(spheres, |state, input| state.list(input, order))?;
        Ok(&self.state.pairs)
    }

    /// The pairs as neighbour lists.
    ///
    /// # Errors
    /// As [`pairs`](Self::pairs).
    pub fn neighbors(&mut self, spheres: Spheres<'_>) -> Result<Neighbors<'_>, Error> {
        self.run(spheres, |state, input| state.list(input, Order::Canonical))?;
        let State { report, lists, pairs, .. } = &mut self.state;
        report.time("neighbors", || lists.fill(pairs, spheres.len()))
    }

    /// How many pairs there are.
    ///
    /// # Errors
    /// [`Error::Input`] for a bad input, [`Error::OutOfMemory`].
    pub fn count(&mut self, spheres: Spheres<'_>) -> Result<u64, Error> {
        self.run(spheres, |state, input| {
            state.report.pairs = state.search(input, &Count)?.0;
            Ok(())
        })?;
        Ok(self.state.report.pairs)
    }

    /// Hands the pairs over in chunks of at most `chunk` and returns how many there were.
    ///
    /// # Errors
    /// As [`count`](Self::count).
    pub fn stream<F>(&mut self, spheres: Spheres<'_>, chunk: usize, mut consume: F) -> Result<u64, Error>
    where
        F: FnMut(&[Pair]) -> ControlFlow<()> + Send,
    {
        let (order, limit, chunk) = (self.settings.order, self.settings.max_pairs, chunk.max(1));
        let mut handed = 0;
        let mut consume = |pairs: &[Pair]| {
            for part in pairs.chunks(chunk) {
                handed += part.len() as u64;
                consume(part)?;
            }
            ControlFlow::Continue(())
        };
        self.run(spheres, |state, input| match order {
            Order::Unordered => state.hand_over(input, &mut consume),
            Order::Canonical => state.stream_in_order(input, limit, &mut consume),
        })?;
        self.state.report.pairs = handed;
        Ok(handed)
    }

    /// What the last call did and why.
    pub fn report(&self) -> &Report {
        &self.state.report
    }

    /// The most bytes held for `spheres` spheres, besides the result and what threads write it to.
    ///
    /// For the paper's grids that is the most where space has up to 2²⁹ of their cells, else up to four times as much;
    /// where periodic axes are shorter than three cells there may be up to four times as many entries too. For the
    /// recursive grid there is room for one crowd of all spheres, and none inside another: each that is adds up to 150
    /// bytes for each of its spheres.
    pub fn memory_for(&self, spheres: u64) -> u64 {
        let (ratio, threads) = (self.settings.raster_ratio, self.threads() as u64);
        let wrapped = match self.settings.space.is_periodic() {
            true => with_growth(spheres * size_of::<Sphere>() as u64),
            false => 0,
        };
        let own = match self.settings.algorithm {
            Algorithm::Naive => with_growth(spheres * Columns::BYTES_PER_SPHERE),
            Algorithm::HashGrid => HashGrid::memory_for(spheres, ratio, threads),
            Algorithm::ArrayGrid => ArrayGrid::memory_for(spheres, ratio, threads),
            Algorithm::RecursiveGrid => RecursiveGrid::memory_for(spheres, ratio, threads),
            _ => CellList::memory_for(spheres),
        };
        own + wrapped
    }

    /// How many threads a call from here has.
    fn threads(&self) -> usize {
        match (&self.pool, self.settings.threads) {
            (Some(pool), _) => pool.current_num_threads(),
            (None, Some(threads)) => threads,
            (None, None) => threads::count(),
        }
    }

    /// The pairs of the last list, without a copy.
    pub fn into_pairs(self) -> Vec<Pair> {
        self.state.pairs
    }

    /// Checks and surveys the input, chooses, builds, and leaves the rest to `work`, all in the detector's pool.
    fn run(
        &mut self,
        spheres: Spheres<'_>,
        work: impl FnOnce(&mut State, &Input<'_>) -> Result<(), Error> + Send,
    ) -> Result<(), Error> {
        let Self { settings, pool, state } = self;
        let task = || {
            state.report = Report { spheres: spheres.len() as u64, ..Report::default() };
            let threads = match settings.threads {
                Some(1) => Threads::Calling,
                _ => Threads::here()?,
            };
            let interactions = settings.interactions.as_ref();
            check_species(spheres, interactions, threads)?;
            let mut wrapped = std::mem::take(&mut state.wrapped);
            let near = match settings.space.is_periodic() {
                true => {
                    state.report.time("wrap", || wrap(spheres, &settings.space, &mut wrapped, threads))?
                }
                false => spheres,
            };
            let rule = Rule::new(near, interactions).in_space(settings.space);
            let survey = state.report.time("survey", || Survey::of(&rule, threads));
            // What is wrong is said of the spheres as they were given.
            let survey = survey.or_else(|error| check(spheres, threads).and(Err(error)))?;
            let (algorithm, reason) = choice::choose(settings.algorithm, &survey);
            log::debug!("{reason}");
            (state.report.algorithm, state.report.reason) = (algorithm, reason);
            let input = Input { rule, survey, settings, simd: settings.simd, threads };
            state.build(&input)?;
            work(state, &input)?;
            state.wrapped = wrapped;
            Ok(())
        };
        match pool {
            Some(pool) => pool.install(task),
            None => task(),
        }
    }
}

/// Writes the spheres' images nearest to the origin.
fn wrap<'w>(
    spheres: Spheres<'w>,
    space: &Space,
    wrapped: &'w mut Vec<Sphere>,
    threads: Threads,
) -> Result<Spheres<'w>, Error> {
    resize(wrapped, spheres.len(), "wrapped spheres")?;
    threads.each_stretch(wrapped, WRAPPED, |piece, targets| {
        for (k, target) in targets.iter_mut().enumerate() {
            let Sphere { center, radius } = spheres.get(piece * WRAPPED + k);
            *target = Sphere { center: space.wrap(center), radius };
        }
    });
    let near = Spheres::from(&*wrapped);
    Ok(spheres.species().map_or(Ok(near), |ids| near.with_species(ids))?)
}

impl State {
    fn build(&mut self, input: &Input<'_>) -> Result<(), Error> {
        let Self { report, columns, cell_list, hash_grid, array_grid, recursive_grid, .. } = self;
        match report.algorithm {
            Algorithm::Naive => {
                report.time("gather", || columns.gather(&input.rule, 0..input.survey.spheres as u32))
            }
            Algorithm::HashGrid => hash_grid.build(input, report),
            Algorithm::ArrayGrid => array_grid.build(input, report),
            Algorithm::RecursiveGrid => recursive_grid.build(input, report),
            _ => cell_list.build(input, report),
        }
    }

    fn search<'o, O: Output>(&mut self, input: &Input<'_>, output: &'o O) -> Result<O::Sink<'o>, Error> {
        let Self { report, columns, cell_list, hash_grid, array_grid, recursive_grid, .. } = self;
        match report.algorithm {
            Algorithm::Naive => report.time("search", || naive::search(input, columns, output)),
            Algorithm::HashGrid => report.time("search", || hash_grid.search(input, output)),
            Algorithm::ArrayGrid => report.time("search", || array_grid.search(input, output)),
            Algorithm::RecursiveGrid => report.time("search", || recursive_grid.search(input, output)),
            _ => report.time("search", || cell_list.search(input, output)),
        }
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
                canonical.order_with(input.threads, &chunks, input.survey.spheres, pairs)
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
        chunks.iter_mut().for_each(Vec::clear);
        extend(&mut self.spare, chunks.drain(..), "chunks of pairs")
    }

    fn list(&mut self, input: &Input<'_>, order: Order) -> Result<(), Error> {
        let limit = input.settings.max_pairs;
        let (found, chunks) = self.collect(input, limit, None)?;
        self.report.pairs = found;
        if found > limit {
            self.spare.clear();
            return Err(Error::TooManyPairs { found, limit });
        }
        self.arrange(chunks, order, input)
    }

    /// Streams as the threads find.
    fn hand_over(&mut self, input: &Input<'_>, consume: Consume<'_>) -> Result<(), Error> {
        let output = Written::new(To::Consumer(Mutex::new(consume)), std::mem::take(&mut self.spare));
        self.search(input, &output)?.finish()?;
        self.spare = output.into_spare();
        Ok(())
    }

    /// Streams in canonical order: from one list where that is within the limit, else from as many lists of
    /// consecutive `i` as it takes, one search for each.
    fn stream_in_order(&mut self, input: &Input<'_>, limit: u64, consume: Consume<'_>) -> Result<(), Error> {
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
