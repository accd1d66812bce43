use std::sync::atomic::Ordering::Relaxed;

use crate::compare::{Output, PairTest, SimdTask, Sink};
use crate::executor::Executor;
use crate::input::InputStats;
use crate::input::{Grouping, SpeciesGroups};
use crate::{Error, Settings, Simd};

/// The input of a search: spheres that were checked and surveyed.
pub(crate) struct SearchInput<'a> {
    pub(crate) test: PairTest<'a>,
    pub(crate) stats: InputStats,
    pub(crate) settings: &'a Settings,
    pub(crate) simd: Simd,
    pub(crate) executor: Executor,
    /// The number of spheres of the first of two sets, if only pairs of one sphere of each count.
    pub(crate) split: Option<usize>,
}

#[cfg(test)]
impl<'a> SearchInput<'a> {
    /// Surveys the spheres of a rule, all of one set.
    pub(crate) fn surveyed(test: PairTest<'a>, settings: &'a Settings) -> Self {
        let stats = InputStats::of(&test, Executor::Pool).expect("all are valid");
        Self { test, stats, settings, simd: Simd::detect(), executor: Executor::Pool, split: None }
    }
}

impl SearchInput<'_> {
    /// Runs comparisons in the vector code of the settings, between nearest images in a periodic space.
    pub(crate) fn run<T: SimdTask>(&self, task: T) -> T::Result {
        self.simd.run(task, self.test.periodic_box(self.stats.largest_radius()))
    }

    /// Returns `true` if the caller wants the search to end; asked before each piece of work.
    pub(crate) fn is_stopped(&self) -> bool {
        self.settings.stop.as_ref().is_some_and(|stop| stop.load(Relaxed))
    }

    /// The groups of spheres: two sets, each divided by species. `species` says by which groups, and whether those that
    /// pair are kept apart.
    pub(crate) fn grouping<'g>(&'g self, species: Option<(&'g SpeciesGroups, bool)>) -> Grouping<'g> {
        let species = species.zip(self.test.spheres().species());
        let species = species.map(|((groups, is_separate), ids)| (groups.partition(is_separate), ids));
        Grouping::new(self.split, species)
    }

    pub(crate) fn is_periodic(&self) -> bool {
        self.test.space().is_periodic()
    }
}

/// Searches pieces of work over the threads, each from a sink to that sink with more in it, and merges the sinks in the
/// order of the pieces. None is begun that nobody wants any more. `most` pieces at a time are done by one thread.
///
/// # Errors
/// The errors of `search`, [`Error::OutOfMemory`], and [`Error::Cancelled`] where the caller wants no more of any kind.
pub(crate) fn search_pieces<'o, O: Output>(
    (output, input): (&'o O, &SearchInput<'_>),
    (pieces, most): (usize, usize),
    search: impl Fn(O::Sink<'o>, usize) -> Result<O::Sink<'o>, Error> + Send + Sync,
) -> Result<O::Sink<'o>, Error> {
    let piece = |sink: O::Sink<'o>, piece| match sink.stopped() {
        _ if input.is_stopped() => Err(Error::Cancelled),
        true => Ok(sink),
        false => search(sink, piece)?.checked(),
    };
    input.executor.fold((pieces, most), || output.open(), piece, Sink::merge)
}
