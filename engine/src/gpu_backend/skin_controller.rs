//! The CPU path's skin tuner with the costs of the device.

use lazygrid_host::{CandidateListStats, RebuildReason, SKIN_RANGE, SkinCosts, SkinTuner};

use super::slab_search::SearchRequest;
use crate::Error;

/// Within these factors the current skin stays, because a change rebuilds the list.
const SIMILAR_SKIN_RATIOS: std::ops::RangeInclusive<f32> = 0.67..=1.5;

#[derive(Debug, Default)]
pub(super) struct SkinController {
    tuner: SkinTuner,
    skin: Option<f32>,
    is_served: bool,
}

impl SkinController {
    pub(super) fn next(
        &mut self,
        request: &SearchRequest<'_>,
        costs: &SkinCosts,
    ) -> Result<Option<f32>, Error> {
        let (spheres, interactions, space) = (request.spheres, request.interactions, request.space);
        self.tuner.observe_spheres(spheres, interactions, space)?;
        if !self.is_served {
            let skin = self.tuner.skin(spheres, interactions, space, costs)?;
            let skin = skin.filter(|skin| SKIN_RANGE.contains(skin));
            self.skin = match (self.skin, skin) {
                (Some(current), Some(skin)) if SIMILAR_SKIN_RATIOS.contains(&(skin / current)) => {
                    Some(current)
                }
                _ => skin,
            };
        }
        Ok(self.skin)
    }

    /// `previous` is the age and displacement fraction of the previous list.
    pub(super) fn record_call(
        &mut self,
        spheres: usize,
        stats: Option<CandidateListStats>,
        previous: (u32, f32),
    ) {
        self.is_served = stats.is_some_and(|stats| stats.rebuilt.is_none());
        match stats {
            Some(CandidateListStats { rebuilt: None, .. }) => self.tuner.record_age(previous, None),
            Some(CandidateListStats { rebuilt, count, .. }) => {
                if rebuilt == Some(RebuildReason::Displacement) {
                    self.tuner.record_age(previous, rebuilt);
                }
                self.tuner.record_count(count as f32 / spheres.max(1) as f32);
            }
            None if self.skin.is_some() => {
                self.tuner.record_overflow();
                self.skin = None;
            }
            None => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::{Algorithm, Space, Sphere};

    use super::*;
    use crate::gpu::costs::SOFTWARE_SKIN_COSTS;

    fn follow(controller: &mut SkinController, calls: u32, step: f32, fits: bool) -> (u32, u32) {
        let n = 8000_usize;
        let costs = SOFTWARE_SKIN_COSTS;
        let (mut held, mut age, mut at, mut since) = (None, 0, 0.0, 0.0);
        let (mut served, mut found) = (0, 0);
        for _ in 0..calls {
            at += step;
            let position = |k: usize| [k % 20, k / 20 % 20, k / 400].map(|c| c as f32 * 1.5);
            let all: Vec<_> =
                (0..n).map(position).map(|[x, y, z]| Sphere::new([x + at, y, z], 0.5)).collect();
            let (algorithm, space) = (Algorithm::CellList, Space::UNBOUNDED);
            let spheres = (&all).into();
            let request =
                SearchRequest { spheres, split: None, interactions: None, space, algorithm, filter: None };
            let skin = controller.next(&request, &costs).expect("valid");
            let Some(distance) = skin.filter(|_| fits) else {
                (held, found) = (None, found + u32::from(skin.is_some()));
                controller.record_call(n, None, (0, 0.0));
                continue;
            };
            let moved = (at - since) / (distance / 2.0);
            let mut stats = CandidateListStats::default();
            stats.rebuilt = match held == skin {
                true if moved <= 1.0 => None,
                true => Some(RebuildReason::Displacement),
                false => Some(RebuildReason::NoList),
            };
            stats.count = if distance < 0.5 { 0 } else { 3 * n as u64 };
            let previous = (age + 1, moved);
            match stats.rebuilt {
                None => (served, age) = (served + 1, age + 1),
                Some(_) => (found, age, since, held) = (found + 1, 0, at, skin),
            }
            controller.record_call(n, Some(stats), previous);
        }
        (served, found)
    }

    #[test]
    fn candidates_serve_slow_spheres_and_not_fast_ones() {
        for (step, fits, calls_served, times_found) in [
            (0.0, true, 190..=200, 0..=3),
            (0.002, true, 180..=200, 1..=16),
            (0.6, true, 0..=20, 0..=12),
            (0.002, false, 0..=0, 1..=7),
        ] {
            let (served, found) = follow(&mut SkinController::default(), 200, step, fits);
            let what = format!("steps of {step}: {served} of 200 served, found {found} times");
            assert!(calls_served.contains(&served) && times_found.contains(&found), "{what}");
        }
    }

    #[test]
    fn spheres_that_come_to_rest_are_served_again() {
        let mut controller = SkinController::default();
        follow(&mut controller, 100, 0.6, true);
        assert!(controller.skin.is_none());
        let (served, _) = follow(&mut controller, 300, 0.001, true);
        assert!(served > 150, "{served} of 300 were served");
    }
}
