use std::ops::Range;

use lazygrid_host::{CandidateListStats, RebuildReason};
use lazygrid_kernels::layout::{Outcome, SkinState};

use super::submission::Submission;
use super::{GpuSession, MAX_IN_FLIGHT};
use crate::Error;
use crate::gpu::detector::GpuSkinDetector;

/// Calls without a list after a list that did not fit; an attempt costs about as much as one of them.
const PAUSE: u64 = 16;
/// Upper bound of the distance tests per candidate of a new list, unless some spheres are much denser than others.
const TESTS_PER_CANDIDATE: u64 = 16;
/// Parts of a candidate search in crowded cells above which a list has too many candidates to be worthwhile.
const MAX_DEFERRED_PARTS: u32 = 4096;

#[derive(Debug)]
pub(super) struct SkinSession {
    pub(super) detector: GpuSkinDetector,
    /// First call that may use a list.
    from: u64,
    candidates: Option<u64>,
    age: u32,
    last_rebuild: (u32, f32),
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
            Ok::<_, Error>(SkinSession {
                detector,
                from: 0,
                candidates: None,
                age: 0,
                last_rebuild: (0, 0.0),
            })
        };
        self.skin = distance.map(keeping).transpose()?;
        Ok(())
    }

    pub(crate) fn update_skin(&mut self, distance: Option<f32>) -> Result<(), Error> {
        match (&mut self.skin, distance) {
            (Some(skin), Some(distance)) if skin.detector.skin() == distance => Ok(()),
            (Some(skin), Some(distance)) => skin.detector.set_skin(distance),
            _ => self.set_skin(distance),
        }
    }

    /// Returns the list's age when the last call began, and the used fraction of the displacement limit.
    pub(crate) fn last_rebuild(&self) -> (u32, f32) {
        self.skin.as_ref().map_or((0, 0.0), |skin| skin.last_rebuild)
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

    /// Returns `true` if a rebuild may be long: its parts are then submitted one by one.
    pub(super) fn is_long_search(&self) -> bool {
        let tests =
            |skin: &SkinSession| skin.candidates.map(|count| count.saturating_mul(TESTS_PER_CANDIDATE));
        self.skin.as_ref().and_then(tests).is_none_or(|tests| tests > self.detector.budget().tests)
    }

    pub(super) fn uses_candidates(&self, number: u64) -> bool {
        let is_allowed = self.calls[number as usize % MAX_IN_FLIGHT].may_use_candidates;
        self.skin.as_ref().is_some_and(|skin| is_allowed && number >= skin.from)
    }

    pub(super) fn pause_skin(&mut self, number: u64) {
        if let Some(skin) = &mut self.skin {
            skin.from = number + PAUSE;
        }
        self.candidate_list_stats = None;
    }

    /// Returns the candidate list of the last finished call; `None` if the call searched.
    pub fn candidate_list_stats(&self) -> Option<CandidateListStats> {
        self.candidate_list_stats
    }

    /// A retried call rebuilt the list if one of its submissions did.
    pub(super) fn record_state(&mut self, state: &SkinState) {
        let Some(skin) = &mut self.skin else { return };
        skin.candidates = Some(state.candidates.into());
        let rebuilt = match state.rebuild_reason {
            0 => None,
            SkinState::DISPLACEMENT => Some(RebuildReason::Displacement),
            SkinState::INPUT_CHANGED => Some(RebuildReason::InputChanged),
            _ => Some(RebuildReason::NoList),
        };
        let before = self.candidate_list_stats.take();
        let mut stats = CandidateListStats::default();
        stats.count = state.candidates.into();
        stats.rebuilt = before.and_then(|stats| stats.rebuilt).or(rebuilt);
        if before.is_none() {
            skin.last_rebuild =
                (skin.age.saturating_add(1), skin.detector.displacement_fraction(state.last_displacement));
        }
        skin.age = match (stats.rebuilt, before) {
            (Some(_), _) => 0,
            (None, Some(_)) => skin.age,
            (None, None) => skin.age.saturating_add(1),
        };
        stats.age = skin.age;
        stats.displacement_fraction = if stats.rebuilt.is_some() { 0.0 } else { skin.last_rebuild.1 };
        self.candidate_list_stats = Some(stats);
    }

    pub(super) fn retry_for_candidates(
        &mut self,
        number: u64,
        window: Range<u32>,
        outcome: &Outcome,
    ) -> Result<(), Error> {
        let (largest, needed) = (self.largest_capacity(), outcome.candidates_needed());
        let Some(skin) = &mut self.skin else { return self.submit(number, Submission::Full(window)) };
        let parts = skin.detector.needed_deferred_parts(outcome);
        if outcome.overflow & Outcome::OVERFLOW_WORK != 0 && parts <= MAX_DEFERRED_PARTS {
            log::info!("the search for candidates exceeds a dispatch: retrying in {parts} parts");
            skin.detector.set_deferred_parts(parts);
            return self.submit(number, Submission::Full(window));
        }
        let before = skin.detector.candidate_capacity();
        if outcome.overflow & !Outcome::OVERFLOW_PAIRS == Outcome::OVERFLOW_CANDIDATES && needed <= largest {
            skin.detector.set_candidate_capacity((needed + needed / 8).min(largest) as u32);
            log::info!("{needed} candidates do not fit: retrying with more capacity");
            self.submit(number, Submission::Full(window))?;
            if !self.uses_candidates(number)
                && let Some(skin) = &mut self.skin
            {
                skin.detector.set_candidate_capacity(before);
            }
            return Ok(());
        }
        log::info!("{needed} candidates do not fit: searching without a list for {PAUSE} calls");
        self.pause_skin(number);
        self.submit(number, Submission::Full(window))
    }
}
