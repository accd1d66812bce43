use lazygrid_host::{CandidateListStats, RebuildReason};
use lazygrid_kernels::layout::SkinState;

use super::GpuSession;
use crate::Error;
use crate::gpu::detector::{GpuSkinDetector, displacement_fraction};
use crate::gpu::plan::WorkBudget;

/// Calls without a list after a list that did not fit; an attempt costs about as much as one of them.
pub(super) const PAUSE: u64 = 16;
/// Upper bound of the distance tests per candidate of a new list, unless some spheres are much denser than others.
const TESTS_PER_CANDIDATE: f64 = 16.0;

#[derive(Debug)]
pub(super) struct SkinSession {
    pub(super) detector: GpuSkinDetector,
    /// First call that may use a list.
    from: u64,
    candidates_per_sphere: Option<f64>,
}

/// The calls that use candidate lists, counted from 1 over all skins.
#[derive(Debug, Default)]
pub(super) struct ListCalls {
    begun: u32,
    /// Latest call that is known to have built a list.
    built_by: u32,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct ListCall {
    number: u32,
    /// [`ListCalls::built_by`] when the call began.
    built_by: u32,
}

impl ListCalls {
    pub(super) fn begin(&mut self) -> ListCall {
        self.begun = self.begun.saturating_add(1);
        ListCall { number: self.begun, built_by: self.built_by }
    }
}

impl SkinSession {
    /// Returns `true` if a rebuild may be long: its parts are then submitted one by one.
    pub(super) fn is_long_search(&self, spheres: u32, budget: WorkBudget) -> bool {
        let tests = |candidates: f64| candidates * f64::from(spheres) * TESTS_PER_CANDIDATE;
        self.candidates_per_sphere.is_none_or(|candidates| tests(candidates) > budget.tests as f64)
    }
}

impl GpuSession {
    /// Sets the skin of later calls; `None` disables the candidate list. If candidates do not fit the device, calls
    /// search without a list.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`] if `distance` is out of range, or an error of the device.
    pub fn set_skin(&mut self, distance: Option<f32>) -> Result<(), Error> {
        let keeping = |distance| {
            let detector = self.with_skin(distance)?;
            Ok::<_, Error>(SkinSession { detector, from: 0, candidates_per_sphere: None })
        };
        self.skin = distance.map(keeping).transpose()?;
        Ok(())
    }

    pub(crate) fn update_skin(&mut self, distance: Option<f32>) -> Result<(), Error> {
        match (&mut self.skin, distance) {
            (Some(skin), Some(distance)) if skin.detector.skin() == distance => Ok(()),
            (Some(skin), Some(distance)) => {
                skin.candidates_per_sphere = None;
                skin.detector.set_skin(distance)
            }
            _ => self.set_skin(distance),
        }
    }

    /// Returns the list's age when the last finished call began, and the used fraction of the displacement limit.
    pub(crate) fn last_rebuild(&self) -> (u32, f32) {
        self.last.previous_list
    }

    fn with_skin(&self, distance: f32) -> Result<GpuSkinDetector, Error> {
        let (device, pipelines) = (&self.gpu.device, self.gpu.pipelines.clone());
        let settings = self.detector.settings().clone();
        GpuSkinDetector::with_pipelines(device, pipelines, settings, distance)
            .map_err(|error| self.gpu.reason(error))
    }

    pub(crate) fn memory_with_candidates(&self, spheres: u32) -> Result<u64, Error> {
        let candidates = match &self.skin {
            Some(skin) => skin.detector.memory_for(spheres)?,
            None => self.with_skin(1.0)?.memory_for(spheres)?,
        };
        Ok(self.io_memory(spheres) + self.detector.memory_for(spheres)? + candidates)
    }

    /// Returns `true` if a call that begins now may use a candidate list.
    pub(super) fn has_skin(&self, number: u64) -> bool {
        self.skin.as_ref().is_some_and(|skin| number >= skin.from)
    }

    pub(super) fn uses_candidates(&self, number: u64) -> bool {
        self.skin.is_some() && self.slot(number).call.may_use_candidates
    }

    /// Lets the call and those that begin soon search without a list.
    pub(super) fn pause_skin(&mut self, number: u64) {
        self.slot_mut(number).call.may_use_candidates = false;
        if let Some(skin) = &mut self.skin {
            skin.from = number + PAUSE;
        }
    }

    /// Returns the candidate list of the last finished call; `None` if the call searched.
    pub fn candidate_list_stats(&self) -> Option<CandidateListStats> {
        self.last.list
    }

    /// Reports the list of a submission with that skin. A retried call rebuilt the list if one of its submissions did.
    pub(super) fn record_state(&mut self, number: u64, distance: f32, state: &SkinState) {
        let slot = self.slot(number);
        let (spheres, Some(call)) = (slot.buffers.count, slot.list) else { return };
        if let Some(skin) = self.skin.as_mut().filter(|skin| skin.detector.skin() == distance) {
            skin.candidates_per_sphere = Some(f64::from(state.candidates) / f64::from(spheres.max(1)));
        }
        let rebuilt = match state.rebuild_reason {
            0 => None,
            SkinState::DISPLACEMENT => Some(RebuildReason::Displacement),
            SkinState::INPUT_CHANGED => Some(RebuildReason::InputChanged),
            _ => Some(RebuildReason::NoList),
        };
        let before = self.last.list.take();
        let mut stats = CandidateListStats::default();
        stats.count = state.candidates.into();
        stats.rebuilt = before.and_then(|stats| stats.rebuilt).or(rebuilt);
        if before.is_none() {
            let fraction = displacement_fraction(state.last_displacement, distance);
            self.last.previous_list = (call.number - call.built_by, fraction);
        }
        let (previous_age, fraction) = self.last.previous_list;
        (stats.age, stats.displacement_fraction) = match (stats.rebuilt, before) {
            (Some(_), _) => (0, 0.0),
            (None, Some(before)) => (before.age, fraction),
            // The device also knows a list that an unfinished call built, but counts submissions.
            (None, None) => (previous_age.min(state.age), fraction),
        };
        let built_by = call.number - stats.age;
        self.list_calls.built_by = self.list_calls.built_by.max(built_by);
        self.last.list = Some(stats);
    }
}
