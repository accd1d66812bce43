use std::ops::Range;
use std::sync::{Arc, Weak};

use super::MAX_IN_FLIGHT;
use super::call_buffers::CallBuffers;
use super::skin::ListCall;
use crate::Error;
use crate::gpu::detector::{AlgorithmChoice, GpuSpheres};
use crate::gpu::device::{Mapping, with_error_scope};
use crate::gpu::plan::{GpuPhase, Plan};

#[derive(Clone, Debug)]
pub(crate) struct QueuedCall {
    pub(crate) choice: AlgorithmChoice,
    pub(crate) window: Range<u32>,
    pub(crate) split: u32,
    pub(crate) may_use_candidates: bool,
    pub(crate) reuses_layout: bool,
}

impl QueuedCall {
    pub(super) fn new(choice: AlgorithmChoice) -> Self {
        Self { choice, window: GpuSpheres::ALL, split: 0, may_use_candidates: true, reuses_layout: true }
    }
}

/// A call that was begun. Dropping the ticket abandons it.
#[derive(Debug, PartialEq, Eq)]
#[must_use = "the result comes with `finish`"]
pub struct Ticket {
    pub(super) number: u64,
    /// Lets the session notice a dropped ticket.
    held: Arc<()>,
}

/// The state of a call, which neither later calls nor later settings of the session change.
#[derive(Debug)]
pub(super) struct CallSlot {
    pub(super) call: QueuedCall,
    pub(super) buffers: CallBuffers,
    /// `None` if the call has not used a candidate list.
    pub(super) list: Option<ListCall>,
    pub(super) counts: SubmissionCounts,
    pub(super) pending: Option<PendingReadback>,
    ticket: Weak<()>,
}

/// Numbers of submissions of a call.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SubmissionCounts {
    /// Searches, including retries.
    pub searches: u32,
    /// Searches that reused an earlier call's cells.
    pub reused_layouts: u32,
    /// Command buffers of searches and continuations.
    pub parts: u32,
    /// Copies of pairs that a search left on the device.
    pub copies: u32,
}

#[derive(Debug)]
pub(super) struct PendingReadback {
    pub(super) device: wgpu::Device,
    pub(super) submission: wgpu::SubmissionIndex,
    pub(super) mapping: Mapping,
    pub(super) staged: u64,
    pub(super) submitted: Submitted,
    /// `Some` after a search.
    pub(super) plan: Option<Arc<Plan>>,
}

/// The type of the last submission of a call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Submitted {
    Search { reuses_layout: bool },
    CandidateSearch { skin: f32 },
    Continuation,
    Copy,
}

impl Submitted {
    pub(super) fn timed_phases(self) -> &'static [GpuPhase] {
        match self {
            Self::Search { .. } => GpuPhase::ALL,
            Self::Continuation => &[GpuPhase::Search],
            Self::CandidateSearch { .. } | Self::Copy => &[],
        }
    }
}

impl Drop for PendingReadback {
    fn drop(&mut self) {
        // A lost device has nothing to unmap.
        let _ = with_error_scope(&self.device, "unmapping", 0, || self.mapping.buffer().unmap());
    }
}

impl CallSlot {
    pub(super) fn index_of(number: u64) -> usize {
        number as usize % MAX_IN_FLIGHT
    }

    pub(super) fn new(choice: AlgorithmChoice) -> Self {
        let (buffers, list, counts, pending, ticket) = Default::default();
        Self { call: QueuedCall::new(choice), buffers, list, counts, pending, ticket }
    }

    pub(super) fn set_call(&mut self, call: QueuedCall) {
        (self.call, self.list, self.counts) = (call, None, SubmissionCounts::default());
    }

    pub(super) fn new_ticket(&mut self, number: u64) -> Ticket {
        let held = Arc::new(());
        self.ticket = Arc::downgrade(&held);
        Ticket { number, held }
    }

    pub(super) fn has_ticket(&self, ticket: &Ticket) -> bool {
        std::ptr::eq(self.ticket.as_ptr(), Arc::as_ptr(&ticket.held))
    }

    pub(super) fn is_abandoned(&self) -> bool {
        self.ticket.strong_count() == 0
    }

    pub(super) fn input(&self, window: &Range<u32>, has_interactions: bool) -> Result<GpuSpheres<'_>, Error> {
        // Only a call that was not begun has no spheres.
        let spheres = self.buffers.spheres.as_ref().ok_or(Error::ForeignTicket)?;
        let mut input = GpuSpheres::new(spheres, self.buffers.count).in_window(window.clone());
        input.species = self.buffers.species().filter(|_| has_interactions).map(Into::into);
        Ok(if self.call.split > 0 { input.across(self.call.split) } else { input })
    }
}
