//! Calls that are answered from candidates, which stay on the device from call to call.

use std::ops::Range;

use lazygrid_host::{CandidateListStats, RebuildReason};
use lazygrid_kernels::layout::{Outcome, SkinState};

use super::submission::Submission;
use super::{GpuSession, MAX_IN_FLIGHT};
use crate::Error;
use crate::gpu::detector::GpuSkinDetector;

/// Calls that search anew after one whose candidates did not fit. Trying costs about as much as one of them.
const PAUSE: u64 = 16;

/// A detector with candidates, and what is known of them.
#[derive(Debug)]
pub(super) struct SkinSession {
    pub(super) detector: GpuSkinDetector,
    /// The first call that may be answered from candidates again.
    from: u64,
    /// Calls since candidates were found.
    age: u32,
    /// Calls since those were found that the last call came upon, and how far the farthest sphere had gone, as a part of what
    /// it may.
    last_rebuild: (u32, f32),
}

impl GpuSession {
    /// Has later calls keep candidates, pairs that are up to so much too far apart to touch, until some sphere has moved by
    /// half of that; without a distance they search anew. An answer never depends on it. Where the candidates do not fit the
    /// device, calls search anew as well. Unlike another search, that for candidates is never split over several submissions.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`] for a distance out of range; otherwise where the device refuses something.
    pub fn set_skin(&mut self, distance: Option<f32>) -> Result<(), Error> {
        let keeping = |distance| {
            let detector = self.with_skin(distance)?;
            Ok::<_, Error>(SkinSession { detector, from: 0, age: 0, last_rebuild: (0, 0.0) })
        };
        self.skin = distance.map(keeping).transpose()?;
        Ok(())
    }

    /// The same as [`set_skin`](Self::set_skin); with the same distance as before candidates stay.
    pub(in crate::gpu) fn update_skin(&mut self, distance: Option<f32>) -> Result<(), Error> {
        match (&mut self.skin, distance) {
            (Some(skin), Some(distance)) if skin.detector.skin() == distance => Ok(()),
            (Some(skin), Some(distance)) => skin.detector.set_skin(distance),
            _ => self.set_skin(distance),
        }
    }

    /// Calls since the candidates were found that the last call came upon, and how far the farthest sphere had gone, as a part
    /// of what it may.
    pub(in crate::gpu) fn last_rebuild(&self) -> (u32, f32) {
        self.skin.as_ref().map_or((0, 0.0), |skin| skin.last_rebuild)
    }

    fn with_skin(&self, distance: f32) -> Result<GpuSkinDetector, Error> {
        let (device, pipelines) = (&self.gpu.device, self.gpu.pipelines.clone());
        let settings = self.detector.settings().clone();
        GpuSkinDetector::with_pipelines(device, pipelines, settings, distance)
            .map_err(|error| self.gpu.reason(error))
    }

    /// The same as [`memory_for`](Self::memory_for), for calls that search anew and calls that keep candidates by turns.
    pub(in crate::gpu) fn memory_with_candidates(&self, spheres: u32) -> Result<u64, Error> {
        let kept = match &self.skin {
            Some(skin) => skin.detector.memory_for(spheres)?,
            None => self.with_skin(1.0)?.memory_for(spheres)?,
        };
        Ok(self.memory_beside(spheres) + self.detector.memory_for(spheres)? + kept)
    }

    /// Returns `true` if this call is answered from candidates, if there is room for them.
    pub(super) fn uses_candidates(&self, number: u64) -> bool {
        let asked = self.calls[number as usize % MAX_IN_FLIGHT].keeps;
        self.skin.as_ref().is_some_and(|skin| asked && number >= skin.from)
    }

    /// Has this call and some after it search anew.
    pub(super) fn pause_skin(&mut self, number: u64) {
        if let Some(skin) = &mut self.skin {
            skin.from = number + PAUSE;
        }
        self.kept = None;
    }

    /// The candidates that the last finished call was answered from; `None` where it searched without any.
    pub fn kept(&self) -> Option<CandidateListStats> {
        self.kept
    }

    /// Takes down what a submission says of the candidates. A call that was repeated has found them anew if one of its
    /// submissions has.
    pub(super) fn note(&mut self, state: &SkinState) {
        let Some(skin) = &mut self.skin else { return };
        let rebuilt = match state.rebuild_reason {
            0 => None,
            SkinState::DISPLACEMENT => Some(RebuildReason::Displacement),
            SkinState::INPUT_CHANGED => Some(RebuildReason::InputChanged),
            _ => Some(RebuildReason::NoList),
        };
        let before = self.kept.take();
        let mut kept = CandidateListStats::default();
        kept.count = state.candidates.into();
        kept.rebuilt = before.and_then(|kept| kept.rebuilt).or(rebuilt);
        if before.is_none() {
            skin.last_rebuild = (skin.age.saturating_add(1), skin.detector.part(state.last_displacement));
        }
        skin.age = match (kept.rebuilt, before) {
            (Some(_), _) => 0,
            (None, Some(_)) => skin.age,
            (None, None) => skin.age.saturating_add(1),
        };
        kept.age = skin.age;
        kept.displacement_fraction = if kept.rebuilt.is_some() { 0.0 } else { skin.last_rebuild.1 };
        self.kept = Some(kept);
    }

    /// Repeats a call whose candidates did not fit: with room for them, or without any.
    pub(super) fn repeat_for_candidates(
        &mut self,
        number: u64,
        window: Range<u32>,
        outcome: &Outcome,
    ) -> Result<(), Error> {
        let (largest, needed) = (self.largest_capacity(), outcome.entries_needed());
        let Some(skin) = &mut self.skin else { return self.submit(number, Submission::Full(window)) };
        let before = skin.detector.candidate_capacity();
        if outcome.overflow & !Outcome::OVERFLOW_PAIRS == Outcome::OVERFLOW_CANDIDATES && needed <= largest {
            // Below 2³² by the largest capacity.
            skin.detector.set_candidate_capacity((needed + needed / 8).min(largest) as u32);
            log::info!("{needed} candidates do not fit: repeating with room for them");
            self.submit(number, Submission::Full(window))?;
            if !self.uses_candidates(number)
                && let Some(skin) = &mut self.skin
            {
                skin.detector.set_candidate_capacity(before);
            }
            return Ok(());
        }
        log::info!("{needed} candidates do not fit: searching anew for {PAUSE} calls");
        self.pause_skin(number);
        self.submit(number, Submission::Full(window))
    }
}
