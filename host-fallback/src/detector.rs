use std::ops::ControlFlow;

use lazygrid_kernels::{Pair, Sphere, Spheres};
use rayon::ThreadPool;

use crate::cell_list::CellList;
use crate::choice::Structure;
use crate::compare::{Columns, Count, Rule};
use crate::given::Given;
use crate::input::Input;
use crate::memory::{resize, with_growth};
use crate::paper::{ArrayGrid, HashGrid, RecursiveGrid};
use crate::skin::Candidates;
use crate::state::State;
use crate::survey::Survey;
use crate::threads::{self, Threads};
use crate::{Error, Neighbors, Order, Rebuilt, Report, Settings};

/// Pairs per chunk of a stream between two sets at most, 8 MiB.
const PART: usize = 1 << 20;

/// Finds overlapping pairs on the CPU, call after call, reusing its buffers.
#[derive(Debug)]
pub struct HostDetector {
    settings: Settings,
    /// What its calls build, at most.
    structure: Structure,
    pool: Option<ThreadPool>,
    state: State,
}

impl HostDetector {
    /// A detector with these settings.
    ///
    /// # Errors
    /// [`Error::Setting`] for a setting outside its range, [`Error::NotOnBackend`] for a GPU algorithm,
    /// [`Error::Threads`] where the system refuses the threads.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        let structure = settings.check()?;
        let pool = match settings.threads {
            // One thread is the calling one.
            None | Some(1) => None,
            Some(threads) => Some(threads::pool(threads)?),
        };
        log::debug!("vector code: {:?}", settings.simd);
        let mut state = State::default();
        state.report.algorithm = settings.algorithm;
        Ok(Self { settings, structure, pool, state })
    }

    /// The overlapping pairs, each once, in the order of the settings.
    ///
    /// # Errors
    /// [`Error::Input`] for a bad input, [`Error::TooManyPairs`] above the limit, [`Error::OutOfMemory`].
    pub fn pairs(&mut self, spheres: Spheres<'_>) -> Result<&[Pair], Error> {
        let order = self.settings.order;
        self.run(Given::One(spheres), |state, input| state.list(input, order))?;
        Ok(&self.state.pairs)
    }

    /// The overlapping pairs of one sphere of each set, in the order of the settings: `i` is the index of the one in `a`,
    /// `j` that of the other in `b`. No two spheres of one set are ever compared.
    ///
    /// # Errors
    /// As [`pairs`](Self::pairs), [`InputError::Second`](lazygrid_kernels::InputError::Second) for what is wrong with `b`;
    /// [`Error::Setting`] for an algorithm other than the cell list, naive and `Auto`.
    pub fn between(&mut self, a: Spheres<'_>, b: Spheres<'_>) -> Result<&[Pair], Error> {
        let order = self.settings.order;
        self.run(self.two(a, b)?, |state, input| state.list(input, order))?;
        Ok(&self.state.pairs)
    }

    /// The pairs as neighbour lists.
    ///
    /// # Errors
    /// As [`pairs`](Self::pairs).
    pub fn neighbors(&mut self, spheres: Spheres<'_>) -> Result<Neighbors<'_>, Error> {
        self.run(Given::One(spheres), |state, input| state.list(input, Order::Canonical))?;
        let State { report, lists, pairs, .. } = &mut self.state;
        report.time("neighbors", || lists.fill(pairs, spheres.len()))
    }

    /// For every sphere of `a` those of `b` that it overlaps, ascending.
    ///
    /// # Errors
    /// As [`between`](Self::between).
    pub fn neighbors_between(&mut self, a: Spheres<'_>, b: Spheres<'_>) -> Result<Neighbors<'_>, Error> {
        self.run(self.two(a, b)?, |state, input| state.list(input, Order::Canonical))?;
        let State { report, lists, pairs, .. } = &mut self.state;
        report.time("neighbors", || lists.fill_forward(pairs, a.len()))
    }

    /// How many pairs there are.
    ///
    /// # Errors
    /// [`Error::Input`] for a bad input, [`Error::OutOfMemory`].
    pub fn count(&mut self, spheres: Spheres<'_>) -> Result<u64, Error> {
        self.count_of(Given::One(spheres))
    }

    /// How many pairs of one sphere of each set there are.
    ///
    /// # Errors
    /// As [`between`](Self::between).
    pub fn count_between(&mut self, a: Spheres<'_>, b: Spheres<'_>) -> Result<u64, Error> {
        self.count_of(self.two(a, b)?)
    }

    fn count_of(&mut self, given: Given<'_>) -> Result<u64, Error> {
        self.run(given, |state, input| {
            state.report.pairs = state.search(input, &Count)?.0;
            Ok(())
        })?;
        Ok(self.state.report.pairs)
    }

    /// Hands the pairs over in chunks of at most `chunk` and returns how many there were.
    ///
    /// # Errors
    /// As [`count`](Self::count).
    pub fn stream<F>(&mut self, spheres: Spheres<'_>, chunk: usize, consume: F) -> Result<u64, Error>
    where
        F: FnMut(&[Pair]) -> ControlFlow<()> + Send,
    {
        self.stream_of(Given::One(spheres), chunk, consume)
    }

    /// Hands the pairs of one sphere of each set over in chunks of at most `chunk` and returns how many there were.
    ///
    /// # Errors
    /// As [`between`](Self::between).
    pub fn stream_between<F>(
        &mut self,
        (a, b): (Spheres<'_>, Spheres<'_>),
        chunk: usize,
        mut consume: F,
    ) -> Result<u64, Error>
    where
        F: FnMut(&[Pair]) -> ControlFlow<()> + Send,
    {
        let (given, first) = (self.two(a, b)?, a.len() as u32);
        let mut part = Vec::new();
        let chunk = chunk.clamp(1, PART);
        resize(&mut part, chunk, "a chunk of pairs")?;
        self.stream_of(given, chunk, move |pairs| {
            let own = &mut part[..pairs.len()];
            own.iter_mut().zip(pairs).for_each(|(own, pair)| *own = Pair { i: pair.i, j: pair.j - first });
            consume(own)
        })
    }

    fn stream_of<F>(&mut self, given: Given<'_>, chunk: usize, mut consume: F) -> Result<u64, Error>
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
        self.run(given, |state, input| match order {
            Order::Unordered => state.hand_over(input, &mut consume),
            Order::Canonical => state.stream_in_order(input, limit, &mut consume),
        })?;
        self.state.report.pairs = handed;
        Ok(handed)
    }

    /// Two sets, for algorithms that can keep them apart.
    fn two<'a>(&self, a: Spheres<'a>, b: Spheres<'a>) -> Result<Given<'a>, Error> {
        match self.structure {
            Structure::CellList | Structure::Naive => Ok(Given::Two(a, b)),
            Structure::HashGrid | Structure::ArrayGrid | Structure::RecursiveGrid => {
                let range =
                    "pairs between two sets are found by `CellList`, `Naive` and `Auto`: choose one of them";
                let value = self.settings.algorithm.to_string();
                Err(Error::Setting { name: "algorithm", value, range })
            }
        }
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
    /// bytes for each of its spheres. The candidates that a skin keeps are included, as many as it may keep: up to 96 of
    /// 8 bytes for each sphere, although few scenes have more than ten. [`Skin::Off`](crate::Skin::Off) keeps none.
    pub fn memory_for(&self, spheres: u64) -> u64 {
        let (ratio, threads) = (self.settings.raster_ratio, self.threads() as u64);
        let wrapped = match self.settings.space.is_periodic() {
            true => with_growth(spheres * size_of::<Sphere>() as u64),
            false => 0,
        };
        let own = match self.structure {
            Structure::Naive => with_growth(spheres * Columns::BYTES_PER_SPHERE),
            Structure::HashGrid => HashGrid::memory_for(spheres, ratio, threads),
            Structure::ArrayGrid => ArrayGrid::memory_for(spheres, ratio, threads),
            Structure::RecursiveGrid => RecursiveGrid::memory_for(spheres, ratio, threads),
            Structure::CellList => CellList::memory_for(spheres),
        };
        let kept = match self.settings.keeps_candidates() {
            true => Candidates::memory_for(spheres, self.settings.max_pairs, threads),
            false => 0,
        };
        own.saturating_add(wrapped).saturating_add(kept)
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

    /// Checks and surveys the input, chooses, builds, and leaves the rest to `work`, all in the detector's pool; with few
    /// spheres only what takes long.
    fn run(
        &mut self,
        given: Given<'_>,
        work: impl FnOnce(&mut State, &Input<'_>) -> Result<(), Error> + Send,
    ) -> Result<(), Error> {
        let Self { settings, structure, pool, state } = self;
        let pool = pool.as_ref();
        // Of the paper's grids nothing tells how long they take.
        let is_large =
            given.len() >= threads::MANY || !matches!(structure, Structure::Naive | Structure::CellList);
        let here = || match settings.threads {
            Some(1) => Ok(Threads::Calling),
            _ => Threads::here(),
        };
        let task = || {
            state.report = Report { spheres: given.len() as u64, ..Report::default() };
            let threads = if is_large { here()? } else { Threads::Calling };
            let interactions = settings.interactions.as_ref();
            given.check_species(interactions, threads)?;
            let refinement = given.refinement(interactions, &settings.space)?;
            let mut near = std::mem::take(&mut state.near);
            let report = &mut state.report;
            let rule = match (settings.space.shear(), &refinement) {
                (Some(shear), Some(refinement)) => {
                    let spheres = report.time("copy", || near.straight(refinement, given.len(), threads))?;
                    Rule::new(spheres, None).in_space(shear.straight())
                }
                _ => {
                    let spheres = match given.as_they_are(&settings.space) {
                        Some(spheres) => spheres,
                        None => report.time("copy", || given.near(&settings.space, &mut near, threads))?,
                    };
                    Rule::new(spheres, interactions).in_space(settings.space)
                }
            };
            let rule = rule.refined(refinement.as_ref());
            let lapsed = match given {
                Given::One(_) => state.advance(settings, &rule, threads)?,
                Given::Two(..) => Some(Rebuilt::First),
            };
            let survey = match (lapsed, state.course.candidates.survey()) {
                (None, Some(survey)) => survey.clone(),
                _ => {
                    let survey = state.report.time("survey", || Survey::of(&rule, threads));
                    // What is wrong is said of the spheres as they were given.
                    survey.or_else(|error| given.check(threads).and(Err(error)))?
                }
            };
            let mut input =
                Input { rule, survey, settings, simd: settings.simd, threads, split: given.split() };
            state.build(&input, lapsed)?;
            if is_large || state.is_short(&input) {
                work(state, &input)?;
            } else {
                threads::within(pool, || {
                    input.threads = here()?;
                    work(state, &input)
                })?;
            }
            state.near = near;
            Ok(())
        };
        if is_large { threads::within(pool, task) } else { task() }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::thread;

    use lazygrid_kernels::{Algorithm, Sphere};

    use super::*;

    /// Whether a search of so many spheres, one at a place, is done by the thread that asks for it.
    fn is_done_here(n: usize, spacing: f32, algorithm: Algorithm) -> bool {
        let spheres: Vec<_> = (0..n).map(|k| Sphere::new([spacing * k as f32, 0.0, 0.0], 1.0)).collect();
        let settings =
            Settings { threads: Some(2), algorithm, order: Order::Unordered, ..Settings::default() };
        let mut detector = HostDetector::new(settings).expect("the settings are in range");
        let (caller, mut are_here) = (thread::current().id(), Vec::new());
        let found = detector.stream((&spheres).into(), 1 << 20, |_| {
            are_here.push(thread::current().id() == caller);
            ControlFlow::Continue(())
        });
        assert!(found.expect("the spheres are valid") > 0);
        are_here.into_iter().all(|is_here| is_here)
    }

    #[test]
    fn nobody_is_woken_for_what_ends_sooner() {
        assert!(is_done_here(500, 1.5, Algorithm::Auto) && is_done_here(3000, 1.5, Algorithm::Auto));
        assert!(!is_done_here(100_000, 1.5, Algorithm::Auto), "many spheres");
        assert!(!is_done_here(6000, 0.0, Algorithm::CellList), "few spheres that all touch");
    }

    #[test]
    fn a_plan_of_an_earlier_call_loses_no_pair() {
        let settings = |algorithm| Settings { algorithm, ..Settings::default() };
        let mut detector =
            HostDetector::new(settings(Algorithm::CellList)).expect("the settings are in range");
        let mut naive = HostDetector::new(settings(Algorithm::Naive)).expect("the settings are in range");
        let corners = [0.0, 100.0].map(|at| Sphere::new([at; 3], 1.0));
        // Spread out, then in ever smaller clumps between the same bounds; at last some are larger.
        for (width, radii) in [(90.0, [1.0, 0.1]), (10.0, [1.0, 0.1]), (0.0, [1.0, 0.1]), (90.0, [20.0, 0.1])]
        {
            let at = |k: u32| [7, 11, 13].map(|step| 5.0 + width * ((k * step) % 101) as f32 / 101.0);
            let inner = (0..500).map(|k| Sphere::new(at(k), radii[k as usize % 2]));
            let spheres: Vec<_> = corners.into_iter().chain(inner).collect();
            let expected = naive.pairs((&spheres).into()).expect("the spheres are valid");
            assert_eq!(
                detector.pairs((&spheres).into()).expect("the spheres are valid"),
                expected,
                "{width}"
            );
        }
    }
}
