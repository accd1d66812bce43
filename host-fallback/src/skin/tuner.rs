//! The choice of skins from displacements and earlier candidate lists, for every backend.

use lazygrid_kernels::{Interactions, Space, Spheres};

use super::CallSpheres;
use super::candidate_list::DisplacementLimits;
use super::cost_model::{SkinChoice, SkinCosts, SkinModel, SkinScaling, choose};
use super::displacement::{DisplacementStats, Displacements};
use crate::Error;
use crate::cell_list::DensityProfile;
use crate::compare::PairTest;
use crate::executor::Executor;
use crate::input::InputStats;
use crate::report::RebuildReason;

/// Maximum searches before a new choice, and number of searches without a list after an overflow.
const MAX_WAIT: u32 = 31;
/// Ratios of observed to expected validity and candidates, for which a choice is kept.
const EXPECTED_RATIOS: std::ops::RangeInclusive<f32> = 0.5..=2.0;

/// Learns from calls and chooses skins. It never reads a clock, so that runs are reproducible.
#[derive(Debug, Default)]
pub struct SkinTuner {
    displacements: DisplacementStats,
    choice: Option<SkinChoice>,
    limits: DisplacementLimits,
    /// Largest used fraction of a limit in the list's first call.
    first: f32,
    wait: u32,
    /// Initial `wait` of the last choice.
    patience: u32,
    pause: u32,
    /// log₂ of the ratio of observed to estimated candidates.
    excess: f32,
}

impl SkinTuner {
    /// Samples the positions of the spheres of a call.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn observe_spheres(
        &mut self,
        spheres: Spheres<'_>,
        interactions: Option<&Interactions>,
        space: Space,
    ) -> Result<(), Error> {
        let test = PairTest::new(spheres, interactions).in_space(space);
        self.observe(CallSpheres::new(&test))
    }

    pub(super) fn observe(&mut self, spheres: CallSpheres<'_>) -> Result<(), Error> {
        self.displacements.observe(spheres)
    }

    /// Records the age of the list in calls, the largest used fraction of a limit, and the reason for a rebuild.
    pub fn record_age(
        &mut self,
        (age, displacement_fraction): (u32, f32),
        rebuild_reason: Option<RebuildReason>,
    ) {
        if age == 1 {
            self.first = displacement_fraction;
        }
        if let (Some(RebuildReason::Displacement), Some(choice)) = (rebuild_reason, &self.choice) {
            self.displacements.learn(self.first * choice.skin, age, displacement_fraction * choice.skin);
            // A list that lasted about as predicted is not reconsidered soon.
            let is_as_expected = EXPECTED_RATIOS.contains(&(age as f32 / (choice.calls + 1.0)));
            self.wait = if is_as_expected { self.wait } else { 0 };
        }
    }

    /// Records the number of candidates per sphere of a new list.
    pub fn record_count(&mut self, candidates: f32) {
        if let Some(choice) = &self.choice {
            let excess = candidates / choice.candidates;
            if excess.is_finite()
                && !EXPECTED_RATIOS.contains(&excess)
                && choice.candidates.max(candidates) > 0.5
            {
                self.excess = (self.excess + excess.log2()).clamp(-4.0, 4.0);
                self.wait = 0;
            }
        }
    }

    /// Records that a list had too many candidates. Some searches then run without a list.
    pub fn record_overflow(&mut self) {
        self.pause = MAX_WAIT;
    }

    pub(super) fn is_paused(&mut self) -> bool {
        let is_paused = self.pause > 0;
        self.pause = self.pause.saturating_sub(1);
        is_paused
    }

    /// Chooses the skin of the next list for all spheres; `None` if searching costs less. Reads the spheres only for a
    /// new choice. Callers must call it before a search, or after a search that built a list.
    ///
    /// # Errors
    /// [`Error::Input`] for invalid spheres, [`Error::OutOfMemory`], [`Error::ThreadPool`].
    pub fn skin(
        &mut self,
        spheres: Spheres<'_>,
        interactions: Option<&Interactions>,
        space: Space,
        costs: &SkinCosts,
    ) -> Result<Option<f32>, Error> {
        let model = SkinModel { costs, scaling: SkinScaling::Alike, least: 0.0 };
        let choose_skin = |displacements: &Displacements, excess: f32| {
            let stats = InputStats::from_test(&PairTest::new(spheres, interactions), Executor::current()?)?;
            let density = DensityProfile::from_centers(spheres, space)?;
            Ok(choose(&stats, &density, displacements, model, excess))
        };
        let limits = self.limits(model, choose_skin)?;
        Ok(limits.map(|limits| 2.0 * limits.get(0, 0.0)))
    }

    /// Returns the limits of the last choice, or of a new one by `choose`, which gets displacements and the excess.
    pub(super) fn limits(
        &mut self,
        model: SkinModel<'_>,
        choose: impl FnOnce(&Displacements, f32) -> Result<Option<SkinChoice>, Error>,
    ) -> Result<Option<&DisplacementLimits>, Error> {
        if self.is_paused() || !self.displacements.are_known() {
            return Ok(None);
        }
        if self.wait > 0 && self.choice.is_none() {
            self.wait -= 1;
            return Ok(None);
        }
        self.displacements.estimate();
        if self.wait > 0 {
            self.wait -= 1;
        } else {
            let choice = choose(&self.displacements.displacements(), self.excess.exp2())?;
            let skin = |choice: Option<SkinChoice>| choice.map(|choice| choice.skin);
            let same = skin(choice) == skin(self.choice);
            self.patience = if same { (2 * self.patience + 1).min(MAX_WAIT) } else { 0 };
            (self.wait, self.choice) = (self.patience, choice);
            if choice.is_none() {
                // No list is built, so nothing is measured: decay the old estimate.
                self.displacements.forget();
                self.excess *= 0.8;
            }
        }
        let Some(SkinChoice { skin, .. }) = self.choice else { return Ok(None) };
        let steps = self.displacements.estimates();
        let farthest = steps.numbers().fold(0.0, f32::max);
        self.limits.set_from(steps, |step| model.limit(skin, step, farthest))?;
        Ok(Some(&self.limits))
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::Sphere;

    use super::*;
    use crate::test_support::Random;

    /// A search takes as long as testing fifty candidates.
    const COSTS: SkinCosts = SkinCosts {
        search_ns: 50.0,
        levels_ns: 0.0,
        find_ns: 5.0,
        keep_ns: 5.0,
        measure_ns: 5.0,
        test_ns: 1.0,
        call_ns: 0.0,
    };

    fn follow(
        tuner: &mut SkinTuner,
        n: usize,
        calls: u32,
        step: f32,
        costs: &SkinCosts,
    ) -> (u32, Option<f32>) {
        let mut random = Random(3);
        let side = (n as f32).cbrt() * 1.6;
        let space = Space::periodic([Some(f64::from(side)); 3]).expect("a box");
        let mut spheres: Vec<_> = (0..n).map(|_| Sphere::new(random.point(side / 2.0), 0.5)).collect();
        let directions: Vec<_> = (0..n).map(|_| glam::Vec3::from(random.point(1.0)).normalize()).collect();
        let (mut held, mut displacement, mut age, mut served) = (None, 0.0, 0, 0);
        for _ in 0..calls {
            tuner.observe_spheres((&spheres).into(), None, space).expect("there is memory");
            if let Some(skin) = held {
                (age, displacement) = (age + 1, displacement + step);
                let rebuild_reason = (displacement > skin / 2.0).then_some(RebuildReason::Displacement);
                tuner.record_age((age, displacement / (skin / 2.0)), rebuild_reason);
                served += u32::from(rebuild_reason.is_none());
                held = held.filter(|_| rebuild_reason.is_none());
            }
            if held.is_none() {
                held = tuner.skin((&spheres).into(), None, space, costs).expect("valid");
                (age, displacement) = (0, 0.0);
            }
            for (sphere, direction) in spheres.iter_mut().zip(&directions) {
                sphere.center += step * direction;
            }
        }
        (served, held)
    }

    #[test]
    fn skin_follows_from_displacements_and_costs() {
        let cheap = SkinCosts { search_ns: 4.0, find_ns: 1.0, ..COSTS };
        let by_the_call = SkinCosts { call_ns: 1000.0 * COSTS.search_ns, ..COSTS };
        for (what, n, step, costs, calls_served) in [
            ("little displacements", 3000, 0.002, COSTS, 90..=100),
            ("none", 3000, 0.0, COSTS, 97..=100),
            ("some", 3000, 0.02, COSTS, 60..=95),
            ("more than a skin is worth", 3000, 0.5, COSTS, 0..=5),
            ("a search that costs nothing", 3000, 0.02, cheap, 0..=5),
            ("too few for what a call costs", 500, 0.002, by_the_call, 0..=0),
            ("enough of them", 5000, 0.002, by_the_call, 90..=100),
        ] {
            let (served, _) = follow(&mut SkinTuner::default(), n, 100, step, &costs);
            assert!(calls_served.contains(&served), "{what}: {served} of 100");
        }
    }

    #[test]
    fn changed_displacements_change_the_skin() {
        let mut tuner = SkinTuner::default();
        let (_, slow) = follow(&mut tuner, 2000, 100, 0.001, &COSTS);
        let (served, fast) = follow(&mut tuner, 2000, 300, 0.01, &COSTS);
        assert!(fast > slow && served > 150, "{slow:?} {fast:?}, {served} served");
        let (served, none) = follow(&mut tuner, 2000, 200, 0.6, &COSTS);
        assert!(none.is_none() && served < 40, "{none:?}, {served} served");
        let (served, _) = follow(&mut tuner, 2000, 400, 0.001, &COSTS);
        assert!(served > 100, "{served} served after the spheres came to rest");
    }

    #[test]
    fn unsampled_fast_sphere_makes_skin_retries_rare() {
        let n = 4000;
        let mut random = Random(5);
        let spheres: Vec<_> = (0..n).map(|_| Sphere::new(random.point(12.0), 0.5)).collect();
        let mut tuner = SkinTuner::default();
        let mut tried = 0;
        for call in 0..1000 {
            let mut spheres = spheres.clone();
            spheres.iter_mut().for_each(|sphere| sphere.center.x += 1e-3 * call as f32);
            tuner.observe_spheres((&spheres).into(), None, Space::UNBOUNDED).expect("there is memory");
            tuner.record_age((1, 80.0), Some(RebuildReason::Displacement));
            let skin = tuner.skin((&spheres).into(), None, Space::UNBOUNDED, &COSTS).expect("valid");
            tried += u32::from(skin.is_some());
        }
        assert!((1..60).contains(&tried), "{tried} of 1000 calls had a skin");
    }

    #[test]
    fn unexpectedly_many_candidates_narrow_the_skin() {
        let mut tuner = SkinTuner::default();
        let (_, skin) = follow(&mut tuner, 3000, 50, 0.01, &COSTS);
        assert!(skin.is_some());
        for _ in 0..3 {
            tuner.record_count(16.0 * tuner.choice.map_or(1.0, |choice| choice.candidates));
        }
        let (_, narrower) = follow(&mut tuner, 3000, 1, 0.01, &COSTS);
        assert!(narrower.is_none_or(|narrower| Some(narrower) < skin), "{narrower:?} {skin:?}");
        tuner.record_overflow();
        let (served, none) = follow(&mut tuner, 3000, MAX_WAIT, 0.01, &COSTS);
        assert!(none.is_none() && served == 0, "{none:?}, {served} served");
    }
}
