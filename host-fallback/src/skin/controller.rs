//! Decides what a detector with a skin does in a call: test the candidates, rebuild them, or search without any.

use super::candidate_list::{CandidateList, DisplacementLimits, fixed};
use super::cost_model::{SkinCosts, SkinScaling, choose};
use super::tuner::SkinTuner;
use crate::cell_list::{CellList, DensityCache, DensityProfile};
use crate::compare::PairTest;
use crate::executor::Executor;
use crate::input::SearchInput;
use crate::report::{RebuildReason, Report};
use crate::{Error, Skin};

/// Candidates, and what decides on the next.
#[derive(Debug, Default)]
pub(crate) struct SkinController {
    pub(crate) candidates: CandidateList,
    tuner: SkinTuner,
    density_cache: Option<DensityCache>,
}

impl SkinController {
    /// Takes up where the spheres are now. Says why candidates cannot serve the call, if they cannot.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn advance(
        &mut self,
        skin: Skin,
        (test, list): (&PairTest<'_>, &CellList),
        executor: Executor,
    ) -> Result<Option<RebuildReason>, Error> {
        if skin == Skin::Auto {
            self.tuner.observe(test)?;
        }
        let lapsed = self.candidates.update_displacements(test, list, executor);
        self.tuner.record_age(self.candidates.age(), lapsed);
        Ok(lapsed)
    }

    /// Finds candidates where they are worth it, else only builds the list. Whether there are candidates now.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn find(
        &mut self,
        list: &mut CellList,
        input: &SearchInput<'_>,
        report: &mut Report,
    ) -> Result<bool, Error> {
        let last = self.density_cache.take();
        let density_cache = report.time("plan", || list.density_cache(last, input))?;
        let density = density_cache.density();
        let limits = match input.settings.skin {
            // Only one set has candidates.
            _ if input.split.is_some() => None,
            Skin::Off => None,
            Skin::Fixed(_) if self.tuner.is_paused() => None,
            Skin::Fixed(distance) => Some(fixed(input.test.searched(distance))),
            Skin::Auto => report.time("plan", || self.choose(input, density))?,
        };
        if let Some(limits) = limits {
            if self.candidates.find((list, &density_cache), input, &limits, report)? {
                let count = self.candidates.stats(None).count;
                self.tuner.record_count(count as f32 / input.stats.spheres as f32);
                self.density_cache = Some(density_cache);
                return Ok(true);
            }
            self.tuner.record_overflow();
        }
        // Candidates go by where the list has the spheres.
        self.candidates.clear();
        list.build(input, &density_cache, report)?;
        self.density_cache = Some(density_cache);
        Ok(false)
    }

    /// The allowances that are worth it.
    fn choose(
        &mut self,
        input: &SearchInput<'_>,
        density: &DensityProfile,
    ) -> Result<Option<DisplacementLimits>, Error> {
        self.tuner.limits(SkinScaling::BySize, |motion, excess| {
            Ok(choose((&input.stats, density), motion, (&SkinCosts::CPU, SkinScaling::BySize), excess))
        })
    }
}
