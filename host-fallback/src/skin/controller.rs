use super::CallSpheres;
use super::candidate_list::{CandidateList, DisplacementLimits, least_limit};
use super::cost_model::{SkinCosts, SkinModel, SkinScaling, choose};
use super::tuner::SkinTuner;
use crate::cell_list::{CellList, CellListBuilder, DensityCache, DensityProfile};
use crate::executor::Executor;
use crate::input::SearchInput;
use crate::report::{RebuildReason, Report};
use crate::{Error, Settings, Skin};

#[derive(Debug, Default)]
pub(crate) struct SkinController {
    pub(crate) candidates: CandidateList,
    tuner: SkinTuner,
    limits: DisplacementLimits,
    density_cache: Option<DensityCache>,
}

impl SkinController {
    pub(crate) fn advance(
        &mut self,
        settings: &Settings,
        spheres: CallSpheres<'_>,
        list: &CellList,
        executor: Executor,
    ) -> Result<Option<RebuildReason>, Error> {
        if settings.skin == Skin::Auto {
            self.tuner.observe(spheres)?;
        }
        let rebuild_reason = self.candidates.revalidate(spheres, list, settings.simd, executor);
        self.tuner.record_age(self.candidates.age(), rebuild_reason);
        Ok(rebuild_reason)
    }

    /// Builds a candidate list and returns `true` if it pays, otherwise only the cell list.
    pub(crate) fn find(
        &mut self,
        list: &mut CellList,
        input: &SearchInput<'_>,
        report: &mut Report,
    ) -> Result<bool, Error> {
        let Self { candidates, tuner, limits, density_cache: last } = self;
        let last = last.take();
        let density_cache = report.time("plan", || DensityCache::from_last(last, input))?;
        let density = density_cache.density();
        let limits = match input.settings.skin {
            Skin::Off => None,
            Skin::Fixed(_) if tuner.is_paused() => None,
            Skin::Fixed(distance) => {
                limits.set_all(0, input.test.searched(distance) / 2.0)?;
                Some(&*limits)
            }
            Skin::Auto => report.time("plan", || choose_limits(tuner, input, density))?,
        };
        let mut builder = CellListBuilder { list, density_cache: &density_cache };
        if let Some(limits) = limits {
            if candidates.find(&mut builder, input, limits, report)? {
                let count = candidates.stats(None).count;
                tuner.record_count(count as f32 / input.stats.spheres as f32);
                self.density_cache = Some(density_cache);
                return Ok(true);
            }
            tuner.record_overflow();
        }
        // The cell list of the candidates is rebuilt now.
        candidates.clear();
        builder.build(input, report)?;
        self.density_cache = Some(density_cache);
        Ok(false)
    }
}

fn choose_limits<'t>(
    tuner: &'t mut SkinTuner,
    input: &SearchInput<'_>,
    density: &DensityProfile,
) -> Result<Option<&'t DisplacementLimits>, Error> {
    let model = SkinModel {
        costs: &SkinCosts::CPU,
        scaling: SkinScaling::Proportional,
        least: least_limit(&input.test),
    };
    tuner.limits(model, |motion, excess| Ok(choose(&input.stats, density, motion, model, excess)))
}
