use crate::compare::{Images, Rule, Task};
use crate::survey::Survey;
use crate::threads::Threads;
use crate::{Settings, Simd};

/// What a detector works on: spheres that were checked and surveyed.
pub(crate) struct Input<'a> {
    pub(crate) rule: Rule<'a>,
    pub(crate) survey: Survey,
    pub(crate) settings: &'a Settings,
    pub(crate) simd: Simd,
    pub(crate) threads: Threads,
    /// How many spheres are of the first of two sets, where only pairs of one of each count.
    pub(crate) split: Option<usize>,
}

impl Input<'_> {
    /// Runs comparisons in the vector code of the settings, between nearest images where space is periodic.
    pub(crate) fn run<T: Task>(&self, task: T) -> T::Result {
        self.simd.run(task, Images::of(&self.settings.space))
    }

    pub(crate) fn is_periodic(&self) -> bool {
        self.settings.space.is_periodic()
    }
}
