use std::time::{Duration, Instant};

use lazygrid_kernels::Algorithm;

/// The report of a call.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Number of spheres.
    pub spheres: u64,
    /// Number of pairs.
    pub pairs: u64,
    /// Algorithm that ran; never `Auto` after a call.
    pub algorithm: Algorithm,
    /// Reason for the algorithm.
    pub reason: String,
    /// Wall-clock time of each phase, in execution order.
    pub phases: Vec<PhaseTime>,
    /// Candidate list of the call; `None` for a search without one.
    pub candidates: Option<CandidateListStats>,
}

/// Statistics of the candidate list.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct CandidateListStats {
    /// Number of candidates.
    pub count: u64,
    /// Calls since the build; 0 in the call that builds it.
    pub age: u32,
    /// Largest fraction of its displacement limit that any sphere has used, from 0 to 1.
    pub displacement_fraction: f32,
    /// Reason for a rebuild in this call; `None` if the list was kept.
    pub rebuilt: Option<RebuildReason>,
}

/// The reason for a rebuild of the candidate list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RebuildReason {
    /// No list existed.
    NoList,
    /// A sphere exceeded its displacement limit.
    Displacement,
    /// The number, radii or species of the spheres changed, or `f64` spheres left the search frame.
    InputChanged,
}

impl std::fmt::Display for RebuildReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::NoList => "no list existed",
            Self::Displacement => "a sphere had moved too far",
            Self::InputChanged => "the spheres had changed",
        })
    }
}

/// One phase of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PhaseTime {
    /// Name, such as `sort` or `search`.
    pub name: &'static str,
    /// Wall-clock time.
    pub time: Duration,
}

impl PhaseTime {
    /// Creates a phase.
    pub fn new(name: &'static str, time: Duration) -> Self {
        Self { name, time }
    }

    /// Adds to the time of the phase of this name, or appends the phase.
    pub fn add(phases: &mut Vec<Self>, name: &'static str, time: Duration) {
        #[expect(clippy::disallowed_methods, reason = "a call has a handful of phases")]
        match phases.iter_mut().find(|phase| phase.name == name) {
            Some(phase) => phase.time += time,
            None => phases.push(Self { name, time }),
        }
    }
}

impl Report {
    pub(crate) fn time<T>(&mut self, name: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        PhaseTime::add(&mut self.phases, name, start.elapsed());
        result
    }
}
