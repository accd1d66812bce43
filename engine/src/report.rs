use lazygrid_host::{CandidateListStats, PhaseTime};
use lazygrid_kernels::Algorithm;

use crate::Backend;

/// What the last call did and why.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// How many spheres were given.
    pub spheres: u64,
    /// How many pairs were found.
    pub pairs: u64,
    /// The backend that ran; never `Auto`.
    pub backend: Backend,
    /// The GPU adapter's name; `None` on the CPU.
    pub adapter: Option<String>,
    /// The algorithm that ran; never `Auto` after a call.
    pub algorithm: Algorithm,
    /// Why this backend and this algorithm.
    pub reason: String,
    /// What the call cost the GPU, by its plan; `None` on the CPU, and where it was answered from candidates that were kept.
    #[cfg(feature = "gpu")]
    pub cost: Option<crate::gpu::CallCost>,
    /// The candidates that the call was answered from; `None` where it searched without any.
    pub candidates: Option<CandidateListStats>,
    /// Time of each phase, in the order they ran. A call that takes a GPU several submissions has the sum of all.
    pub phases: Vec<PhaseTime>,
}

impl From<&lazygrid_host::Report> for Report {
    fn from(host: &lazygrid_host::Report) -> Self {
        Self {
            spheres: host.spheres,
            pairs: host.pairs,
            backend: Backend::Cpu,
            adapter: None,
            algorithm: host.algorithm,
            reason: host.reason.clone(),
            #[cfg(feature = "gpu")]
            cost: None,
            candidates: host.candidates,
            phases: host.phases.clone(),
        }
    }
}

impl Report {
    /// Puts a reason in front of the others.
    pub(crate) fn precede(&mut self, why: &str) {
        self.reason = match self.reason.as_str() {
            "" => why.to_owned(),
            reason => format!("{why}; {reason}"),
        };
    }
}

#[cfg(feature = "gpu")]
impl Report {
    /// Starts the report of a call.
    pub(crate) fn begin(&mut self, spheres: usize) {
        self.phases.clear();
        (self.spheres, self.pairs) = (spheres as u64, 0);
        (self.cost, self.candidates) = (None, None);
    }
}
