use lazygrid_host::{CandidateListStats, PhaseTime};
use lazygrid_kernels::Algorithm;

use crate::Backend;

/// The report of a call.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// Number of spheres.
    pub spheres: u64,
    /// Number of pairs found.
    pub pairs: u64,
    /// Backend that ran; never `Auto`.
    pub backend: Backend,
    /// GPU adapter's name; `None` on the CPU.
    pub adapter: Option<String>,
    /// Algorithm that ran; never `Auto` after a call.
    pub algorithm: Algorithm,
    /// Reason for backend and algorithm.
    pub reason: String,
    /// Planned cost on the GPU, unless a candidate list answered the call.
    #[cfg(feature = "gpu")]
    pub cost: Option<crate::gpu::CallCost>,
    /// Candidate list that answered the call.
    pub candidates: Option<CandidateListStats>,
    /// Time of each phase, summed over submissions.
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
    pub(crate) fn prepend_reason(&mut self, why: &str) {
        self.reason = match self.reason.as_str() {
            "" => why.to_owned(),
            reason => format!("{why}; {reason}"),
        };
    }
}

#[cfg(feature = "gpu")]
impl Report {
    pub(crate) fn begin(&mut self, spheres: usize) {
        self.phases.clear();
        (self.spheres, self.pairs) = (spheres as u64, 0);
        (self.cost, self.candidates) = (None, None);
    }
}
