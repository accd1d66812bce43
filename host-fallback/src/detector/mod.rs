//! The CPU detector: prepares a query, chooses an algorithm, builds its index and searches it.

pub mod algorithm_choice;
mod finder;
mod state;

use std::sync::Arc;

use lazygrid_kernels::Query;

use crate::cell_list::CellList;
use crate::executor::{Executor, MIN_PARALLEL_SPHERES, Team};
use crate::grids::{ArrayGrid, HashGrid, RecursiveGrid};
use crate::input::{InputStats, Preparation, QueryBuffers, SearchInput, SpeciesGroups, check_valid};
use crate::naive::Naive;
use crate::skin::{CallSpheres, memory_of_candidates};
use crate::{Error, PhaseTime, Report, Settings};
use algorithm_choice::IndexKind;
pub use finder::{ChunkConsumer, PairFinder, PairSource, SearchBackend, Work, ranges};
use state::{BuiltSearch, DetectorState};

/// The CPU detector. It reuses its buffers.
pub type HostDetector = PairFinder<HostBackend>;

#[derive(Debug)]
pub struct HostBackend {
    settings: Settings,
    structure: IndexKind,
    team: Arc<Team>,
    buffers: QueryBuffers,
    state: DetectorState,
}

impl PairFinder<HostBackend> {
    /// # Errors
    /// [`Error::InvalidSetting`], [`Error::NotOnBackend`] for a GPU algorithm, [`Error::ThreadPool`] if the system
    /// refuses the threads.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        HostBackend::new(settings).map(Self::on)
    }

    pub fn report(&self) -> &Report {
        self.backend().report()
    }
}

impl HostBackend {
    /// # Errors
    /// See [`HostDetector::new`].
    pub fn new(settings: Settings) -> Result<Self, Error> {
        settings.check()?;
        let structure = IndexKind::from_algorithm(settings.algorithm)?;
        let team = Arc::new(Team::new(settings.threads)?);
        log::debug!("vector code: {:?}", settings.simd);
        let mut state = DetectorState::default();
        state.report.algorithm = settings.algorithm;
        Ok(Self { settings, structure, team, buffers: QueryBuffers::default(), state })
    }

    pub fn report(&self) -> &Report {
        &self.state.report
    }

    /// Returns the most bytes that all threads hold for `spheres` spheres, without the result and its chunks.
    ///
    /// The paper's grids may take four times as much beyond 2²⁹ cells, and again on periodic axes below three cells.
    /// The recursive grid is assumed to have one overfull cell with all spheres; nested ones add up to 150 bytes per
    /// sphere. A candidate list is assumed to have 96 candidates of 8 bytes per sphere, its maximum. Few scenes have
    /// more than ten, and [`Skin::Off`](crate::Skin::Off) keeps none.
    pub fn memory_for(&self, spheres: u64, is_f64: bool) -> u64 {
        let (ratio, threads) = (self.settings.cell_ratio, self.team.count() as u64);
        let copied = QueryBuffers::memory_for(spheres, is_f64, &self.settings, true);
        let own = match self.structure {
            IndexKind::Naive => Naive::memory_for(spheres),
            IndexKind::HashGrid => HashGrid::memory_for(spheres, ratio, threads),
            IndexKind::ArrayGrid => ArrayGrid::memory_for(spheres, ratio, threads),
            IndexKind::RecursiveGrid => RecursiveGrid::memory_for(spheres, ratio, threads),
            IndexKind::CellList => CellList::memory_for(spheres),
        };
        let candidates = match self.settings.keeps_candidates() {
            true => {
                let spheres = (spheres, self.settings.interactions.is_some());
                memory_of_candidates(spheres, self.settings.max_pairs, threads)
            }
            false => 0,
        };
        let table = self.settings.interactions.as_ref();
        let species = table.map_or(0, |table| SpeciesGroups::memory_for(table.species(), spheres));
        own.saturating_add(copied).saturating_add(candidates).saturating_add(species)
    }
}

impl SearchBackend for HostBackend {
    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn team(&self) -> &Arc<Team> {
        &self.team
    }

    fn report_mut(&mut self) -> (&mut u64, &mut Vec<PhaseTime>) {
        (&mut self.state.report.pairs, &mut self.state.report.phases)
    }

    fn search(&mut self, query: &Query<'_>, work: Work<'_>) -> Result<(), Error> {
        let Self { settings, structure, team, buffers, state } = self;
        let settings = &*settings;
        // The paper's grids take an unpredictable time.
        let is_large = query.len() >= MIN_PARALLEL_SPHERES
            || !matches!(structure, IndexKind::Naive | IndexKind::CellList);
        let mut task = || {
            state.report = Report { spheres: query.len() as u64, ..Report::default() };
            let executor = if is_large { team.executor()? } else { Executor::Caller };
            let (mut rebuild_reason, mut prepared) = (None, None);
            let has_same_species = state.skin.candidates.have_species_of(query, buffers.version());
            if has_same_species {
                prepared = buffers.prepare_in_place(query, settings, executor)?;
                if let Some(in_place) = &prepared {
                    let input = in_place.input;
                    let spheres = CallSpheres { test: &in_place.test(settings), input, has_same_species };
                    rebuild_reason = state.advance(settings, spheres, executor)?;
                }
            }
            let is_advanced = prepared.is_some();
            let prepared = match prepared.filter(|_| rebuild_reason.is_none()) {
                Some(prepared) => prepared,
                None => {
                    let preparation =
                        Preparation { settings, wraps: true, has_same_species, uses_only_radii: false };
                    buffers.prepare(query, preparation, executor, &mut state.report.phases)?
                }
            };
            let test = prepared.test(settings);
            if !is_advanced {
                let spheres = CallSpheres { test: &test, input: None, has_same_species };
                rebuild_reason = state.advance(settings, spheres, executor)?;
            }
            let stats = match (rebuild_reason, state.skin.candidates.input_stats()) {
                (None, Some(stats)) => stats.clone(),
                _ => {
                    let stats = state.report.time("survey", || InputStats::from_test(&test, executor));
                    // The error must show the numbers as given, not as searched.
                    stats.or_else(|error| check_valid(query, executor).and(Err(error)))?
                }
            };
            let test = test.with_radii_up_to(stats.largest_radius());
            let (simd, split, groups) = (settings.simd, prepared.split, prepared.groups);
            let mut input = SearchInput { test, stats, settings, simd, executor, split, groups };
            state.build(&mut input, rebuild_reason)?;
            if is_large || state.is_short(&input) {
                work(&mut BuiltSearch { state, input: &input })
            } else {
                team.within(|| {
                    input.executor = team.executor()?;
                    work(&mut BuiltSearch { state, input: &input })
                })
            }
        };
        if is_large { team.within(task) } else { task() }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
    use std::thread;

    use lazygrid_kernels::{Algorithm, Interaction, Interactions, Space, Sphere};

    use super::*;
    use crate::memory::with_growth;
    use crate::test_support::new_detector;
    use crate::{Order, Skin};

    fn two() -> [Sphere; 2] {
        [Sphere::new([0.0; 3], 1.0); 2]
    }

    #[test]
    fn into_pairs_after_failed_search_is_empty() {
        let settings = Settings { max_pairs: 1, ..Settings::default() };
        let detector = || {
            let mut detector = new_detector(settings.clone());
            assert_eq!(detector.pairs(two().as_slice()).map(<[_]>::len), Ok(1));
            detector
        };
        let mut limited = detector();
        let refused = limited.pairs([two()[0]; 3].as_slice());
        assert_eq!(refused, Err(Error::TooManyPairs { found: 3, limit: 1 }));
        assert_eq!(limited.into_pairs(), []);
        let mut invalid = detector();
        assert!(invalid.pairs([Sphere::new([f32::NAN; 3], 1.0)].as_slice()).is_err());
        assert_eq!(invalid.into_pairs(), []);
    }

    #[test]
    fn memory_for_counts_the_species_of_candidates() {
        let memory = |interactions| {
            let settings = Settings { skin: Skin::Auto, interactions, ..Settings::default() };
            new_detector(settings).backend().memory_for(1000, false)
        };
        let table = Interactions::new(1, Interaction::Touch).expect("few species");
        let of_table = SpeciesGroups::memory_for(1, 1000);
        let of_candidates = with_growth(24 * 1000) - with_growth(20 * 1000);
        assert_eq!(memory(Some(table)), memory(None) + of_candidates + of_table);
    }

    #[test]
    fn memory_for_counts_the_copy_for_distances_beyond_f32() {
        let memory = |distance| {
            let table = Interactions::new(1, Interaction::Within(distance)).expect("a distance in range");
            let settings = Settings { interactions: Some(table), ..Settings::default() };
            new_detector(settings).backend().memory_for(1000, false)
        };
        for distance in [1e-40, 1e40] {
            assert_eq!(memory(distance), memory(0.1) + with_growth(16 * 1000), "{distance}");
        }
    }

    #[test]
    fn memory_for_counts_the_copy_of_each_space() {
        let memory = |space, is_f64, wraps| {
            let settings = Settings { space, skin: Skin::Off, ..Settings::default() };
            let copied = QueryBuffers::memory_for(1000, is_f64, &settings, wraps);
            let detector = new_detector(settings);
            (copied, detector.backend().memory_for(1000, is_f64))
        };
        let periodic = |length: f64| Space::periodic([Some(length), None, None]).expect("a length");
        let tilted = [[10.0, 0.0, 0.0], [4.0, 10.0, 0.0], [0.0, 0.0, 10.0]];
        let tilted = Space::triclinic(tilted.map(Some)).expect("a cell");
        let copy = with_growth(16 * 1000);
        let (_, without) = memory(Space::UNBOUNDED, false, true);
        for (space, on_gpu, on_host) in [
            (Space::UNBOUNDED, 0, 0),
            (periodic(10.0), 0, copy),
            (periodic(10.1), copy, copy),
            (tilted, copy, copy),
        ] {
            assert_eq!(memory(space, false, false).0, on_gpu, "{space:?}");
            assert_eq!(memory(space, false, true), (on_host, without + on_host), "{space:?}");
            assert_eq!(memory(space, true, false), (copy, without + copy), "{space:?}");
        }
    }

    #[test]
    fn sorted_stream_of_a_small_limit_needs_few_searches() {
        let spheres: Vec<_> = (0..4000).map(|k| Sphere::new([1.5 * k as f32, 0.0, 0.0], 1.0)).collect();
        for max_pairs in [0, 1, 100] {
            let settings = Settings { max_pairs, ..Settings::default() };
            let mut detector = new_detector(settings);
            let (mut chunks, mut streamed) = (0, Vec::new());
            let found = detector.stream(&spheres, usize::MAX, |pairs| {
                chunks += 1;
                streamed.extend_from_slice(pairs);
                ControlFlow::Continue(())
            });
            assert_eq!((found, chunks), (Ok(3999), 17), "{max_pairs}");
            assert!(streamed.is_sorted() && streamed.len() == 3999, "{max_pairs}");
        }
    }

    #[test]
    fn stop_flag_cancels_searches_of_few_spheres() {
        let stop = Arc::new(AtomicBool::new(false));
        for (&algorithm, n) in Algorithm::CPU.iter().flat_map(|algorithm| [(algorithm, 0), (algorithm, 3)]) {
            let settings = Settings { algorithm, stop: Some(stop.clone()), ..Settings::default() };
            let mut detector = new_detector(settings);
            let spheres: Vec<_> = (0..n).map(|k| Sphere::new([9.0 * k as f32; 3], 1.0)).collect();
            for (is_stopped, expected) in [(false, Ok(0)), (true, Err(Error::Cancelled)), (false, Ok(0))] {
                stop.store(is_stopped, Relaxed);
                assert_eq!(detector.count(&spheres), expected, "{algorithm}, {n} spheres");
            }
        }
    }

    fn is_done_here(n: usize, spacing: f32, algorithm: Algorithm) -> bool {
        let spheres: Vec<_> = (0..n).map(|k| Sphere::new([spacing * k as f32, 0.0, 0.0], 1.0)).collect();
        let settings =
            Settings { threads: Some(2), algorithm, order: Order::Unordered, ..Settings::default() };
        let mut detector = new_detector(settings);
        let (caller, mut are_here) = (thread::current().id(), Vec::new());
        let found = detector.stream(&spheres, 1 << 20, |_| {
            are_here.push(thread::current().id() == caller);
            ControlFlow::Continue(())
        });
        assert!(found.expect("the spheres are valid") > 0);
        are_here.into_iter().all(|is_here| is_here)
    }

    #[test]
    fn short_work_wakes_no_thread() {
        assert!(is_done_here(500, 1.5, Algorithm::Auto) && is_done_here(3000, 1.5, Algorithm::Auto));
        assert!(!is_done_here(100_000, 1.5, Algorithm::Auto), "many spheres");
        assert!(!is_done_here(6000, 0.0, Algorithm::CellList), "few spheres that all touch");
    }

    #[test]
    fn consumer_that_panicked_is_not_called_again() {
        let spheres = vec![Sphere::new([0.0; 3], 1.0); 4000];
        let settings = Settings { threads: Some(2), order: Order::Unordered, ..Settings::default() };
        let mut detector = new_detector(settings);
        let mut calls = 0;
        let streamed = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            detector.stream(&spheres, 1 << 10, |_| {
                calls += 1;
                panic!("a consumer's own");
            })
        }));
        assert!(streamed.is_err());
        assert_eq!(calls, 1);
        assert_eq!(detector.count(&spheres), Ok(4000 * 3999 / 2));
    }

    #[test]
    fn reused_plan_loses_no_pair() {
        let settings = |algorithm| Settings { algorithm, ..Settings::default() };
        let mut detector = new_detector(settings(Algorithm::CellList));
        let mut naive = new_detector(settings(Algorithm::Naive));
        let corners = [0.0, 100.0].map(|at| Sphere::new([at; 3], 1.0));
        for (width, radii) in [(90.0, [1.0, 0.1]), (10.0, [1.0, 0.1]), (0.0, [1.0, 0.1]), (90.0, [20.0, 0.1])]
        {
            let at = |k: u32| [7, 11, 13].map(|step| 5.0 + width * ((k * step) % 101) as f32 / 101.0);
            let inner = (0..500).map(|k| Sphere::new(at(k), radii[k as usize % 2]));
            let spheres: Vec<_> = corners.into_iter().chain(inner).collect();
            let expected = naive.pairs(&spheres).expect("the spheres are valid");
            assert_eq!(detector.pairs(&spheres).expect("the spheres are valid"), expected, "{width}");
        }
    }
}
