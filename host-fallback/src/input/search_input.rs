use std::sync::atomic::Ordering::Relaxed;

use glam::Vec3;

use super::CenterBounds;
use crate::compare::{Output, PairTest, SimdTask, Sink};
use crate::executor::{Chunks, Executor};
use crate::input::{Division, Grouping, InputStats, SpeciesGroups};
use crate::{Error, Settings, Simd};

pub(crate) struct SearchInput<'a> {
    pub(crate) test: PairTest<'a>,
    pub(crate) stats: InputStats,
    pub(crate) settings: &'a Settings,
    pub(crate) simd: Simd,
    pub(crate) executor: Executor,
    /// First index of the second set, if only pairs across two sets are found.
    pub(crate) split: Option<usize>,
    pub(crate) groups: Option<&'a SpeciesGroups>,
}

#[cfg(test)]
impl<'a> SearchInput<'a> {
    pub(crate) fn with_stats(test: PairTest<'a>, settings: &'a Settings) -> Self {
        let stats = InputStats::from_test(&test, Executor::Pool).expect("all are valid");
        let (simd, executor) = (Simd::detect(), Executor::Pool);
        Self { test, stats, settings, simd, executor, split: None, groups: None }
    }
}

impl<'a> SearchInput<'a> {
    pub(crate) fn run<T: SimdTask>(&self, task: T) -> T::Result {
        self.simd.run(task, self.test.periodic_box(self.stats.largest_radius()))
    }

    /// Threads ask before each chunk of work.
    pub(crate) fn is_stopped(&self) -> bool {
        self.settings.stop.as_ref().is_some_and(|stop| stop.load(Relaxed))
    }

    pub(crate) fn grouping(&self, division: Division) -> Grouping<'a> {
        let species = self.groups.zip(self.test.spheres().species());
        Grouping::new(self.split, species.map(|(groups, ids)| (groups.partition(division), ids)))
    }

    pub(crate) fn extent(&self, bounds: CenterBounds) -> f32 {
        let lengths = self.test.lengths();
        let apart = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).as_vec3().min(Vec3::MAX);
        (0..3).map(|axis| lengths[axis].unwrap_or(apart[axis])).fold(0.0, f32::max)
    }

    pub(crate) fn is_periodic(&self) -> bool {
        self.test.space().is_periodic()
    }
}

/// Merges sinks in order, until the caller stops. A task has at most `most` chunks.
pub(crate) fn search_chunks<'o, O: Output>(
    output: &'o O,
    input: &SearchInput<'_>,
    chunks: usize,
    most: usize,
    search: impl Fn(O::Sink<'o>, usize) -> Result<O::Sink<'o>, Error> + Send + Sync,
) -> Result<O::Sink<'o>, Error> {
    let fold_chunk = |sink: O::Sink<'o>, chunk| match sink.stopped() {
        _ if input.is_stopped() => Err(Error::Cancelled),
        true => Ok(sink),
        false => search(sink, chunk)?.checked(),
    };
    input.executor.fold(
        Chunks { count: chunks, most_per_task: most },
        || output.open(),
        fold_chunk,
        Sink::merge,
    )
}
