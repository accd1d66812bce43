use std::time::{Duration, Instant};

use lazygrid_kernels::Algorithm;

/// What a call did: which algorithm, why, and how long each phase took.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// How many spheres were given.
    pub spheres: u64,
    /// How many pairs were found.
    pub pairs: u64,
    /// The algorithm that ran; never `Auto` after a call.
    pub algorithm: Algorithm,
    /// Why it was chosen.
    pub reason: String,
    /// Wall-clock time of each phase, in the order they ran.
    pub phases: Vec<Phase>,
}

/// One phase of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phase {
    /// Its name, such as `sort` or `search`.
    pub name: &'static str,
    /// Wall-clock time it took.
    pub time: Duration,
}

impl Report {
    /// Runs `work` and records its time as phase `name`; a phase that runs again adds to its time.
    pub(crate) fn time<T>(&mut self, name: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        let time = start.elapsed();
        #[expect(clippy::disallowed_methods, reason = "a call has a handful of phases")]
        match self.phases.iter_mut().find(|phase| phase.name == name) {
            Some(phase) => phase.time += time,
            None => self.phases.push(Phase { name, time }),
        }
        result
    }
}
