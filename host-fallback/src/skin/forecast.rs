//! Which skin the next candidates get, from what was seen of the spheres and of earlier candidates. It is the same on every
//! backend; only what things cost differs.

use lazygrid_kernels::{Interactions, Space, Spheres};

use super::Allowances;
use super::motion::{Growth, Motion};
use super::worth::{Choice, Costs, Spread, choose};
use crate::Error;
use crate::cell_list::Crowding;
use crate::classes::CLASSES;
use crate::compare::Rule;
use crate::report::Rebuilt;
use crate::survey::Survey;
use crate::threads::Threads;

/// Searches at most for which a choice is not thought over, and after candidates that were too many.
const PATIENCE: u32 = 31;
/// Lives of candidates, and numbers of them, over those expected with which a choice stands.
const AS_EXPECTED: std::ops::RangeInclusive<f32> = 0.5..=2.0;

/// What is known of the motion, and what follows from it for candidates that are kept from call to call. It never looks at a
/// clock, so that runs are the same.
#[derive(Debug, Default)]
pub struct Forecast {
    motion: Motion,
    choice: Option<Choice>,
    /// How far the farthest sphere had gone one call after the candidates were found, as a part of its allowance.
    first: f32,
    /// For how many searches the choice stands, and for how many it stood the last time.
    wait: u32,
    patience: u32,
    /// For how many searches no candidates are looked for, as they were too many.
    pause: u32,
    /// log₂ of how many candidates there were for each that was expected.
    excess: f32,
}

impl Forecast {
    /// Takes a look at where the spheres of a call are.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn look(
        &mut self,
        spheres: Spheres<'_>,
        interactions: Option<&Interactions>,
        space: Space,
    ) -> Result<(), Error> {
        self.observe(&Rule::new(spheres, interactions).in_space(space))
    }

    pub(super) fn observe(&mut self, rule: &Rule<'_>) -> Result<(), Error> {
        self.motion.observe(rule)
    }

    /// Takes down that candidates were found so many calls ago and that the farthest sphere has gone this part of what it may;
    /// and why they cannot serve, where they cannot.
    pub fn note_age(&mut self, (age, moved): (u32, f32), lapsed: Option<Rebuilt>) {
        if age == 1 {
            self.first = moved;
        }
        if let (Some(Rebuilt::Moved), Some(choice)) = (lapsed, &self.choice) {
            self.motion.learn(self.first * choice.skin, (age, moved * choice.skin));
            // A list that lasted about as long as predicted is not reconsidered soon.
            let is_as_expected = AS_EXPECTED.contains(&(age as f32 / (choice.calls + 1.0)));
            self.wait = if is_as_expected { self.wait } else { 0 };
        }
    }

    /// Takes down how many candidates were found for each sphere.
    pub fn note_found(&mut self, candidates: f32) {
        if let Some(choice) = &self.choice {
            let excess = candidates / choice.candidates;
            if excess.is_finite() && !AS_EXPECTED.contains(&excess) && choice.candidates.max(candidates) > 0.5
            {
                self.excess = (self.excess + excess.log2()).clamp(-4.0, 4.0);
                self.wait = 0;
            }
        }
    }

    /// Takes down that there was no room for candidates: for some searches none are looked for.
    pub fn note_too_many(&mut self) {
        self.pause = PATIENCE;
    }

    /// Returns `true` if a search is one of those.
    pub(super) fn is_paused(&mut self) -> bool {
        let is_paused = self.pause > 0;
        self.pause = self.pause.saturating_sub(1);
        is_paused
    }

    /// The skin with which candidates are to be found for the next calls, the same for all spheres; `None` where searching anew
    /// costs less. Spheres are surveyed only where the last choice no longer stands. Asked before a search, or after one that
    /// found candidates.
    ///
    /// # Errors
    /// [`Error::Input`] for spheres that are not valid, [`Error::OutOfMemory`], [`Error::Threads`].
    pub fn skin(
        &mut self,
        spheres: Spheres<'_>,
        interactions: Option<&Interactions>,
        space: Space,
        costs: &Costs,
    ) -> Result<Option<f32>, Error> {
        let think = |motion: (&[f32; CLASSES], Growth), excess: f32| {
            let survey = Survey::of(&Rule::new(spheres, interactions), Threads::here()?)?;
            let crowding = Crowding::of_places(spheres, space)?;
            Ok(choose((&survey, &crowding), motion, (costs, Spread::Alike), excess))
        };
        let allowances = self.allowances(Spread::Alike, think)?;
        Ok(allowances.map(|allowances| 2.0 * allowances[0]))
    }

    /// The allowances that are worth it: by the last choice, or by what `think` makes of the motion and of how many times as
    /// many candidates there are as expected.
    pub(super) fn allowances(
        &mut self,
        spread: Spread,
        think: impl FnOnce((&[f32; CLASSES], Growth), f32) -> Result<Option<Choice>, Error>,
    ) -> Result<Option<Allowances>, Error> {
        if self.is_paused() {
            return Ok(None);
        }
        let Some((steps, growth)) = self.motion.steps() else { return Ok(None) };
        if self.wait > 0 {
            self.wait -= 1;
        } else {
            let choice = think((&steps, growth), self.excess.exp2())?;
            let skin = |choice: Option<Choice>| choice.map(|choice| choice.skin);
            let same = skin(choice) == skin(self.choice);
            self.patience = if same { (2 * self.patience + 1).min(PATIENCE) } else { 0 };
            (self.wait, self.choice) = (self.patience, choice);
            if choice.is_none() {
                // No list is built, so nothing is measured: decay the old estimate.
                self.motion.forget();
                self.excess *= 0.8;
            }
        }
        Ok(self.choice.map(|choice| spread.allowances(&steps, choice.skin)))
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::Sphere;

    use super::*;
    use crate::judged::Random;

    /// Costs of a backend on which a search takes as long as testing fifty candidates.
    const COSTS: Costs =
        Costs { search: 50.0, levels: 0.0, find: 5.0, keep: 5.0, measure: 5.0, test: 1.0, call: 0.0 };

    /// Follows spheres in a periodic box that all go `step` at every call, some way each; how many calls candidates served,
    /// and the last skin.
    fn follow(
        forecast: &mut Forecast,
        (n, calls): (usize, u32),
        step: f32,
        costs: &Costs,
    ) -> (u32, Option<f32>) {
        let mut random = Random(3);
        // About one partner within a diameter.
        let edge = (n as f32).cbrt() * 1.6;
        let space = Space::periodic([Some(f64::from(edge)); 3]).expect("a box");
        let mut spheres: Vec<_> = (0..n).map(|_| Sphere::new(random.point(edge / 2.0), 0.5)).collect();
        let ways: Vec<_> = (0..n).map(|_| glam::Vec3::from(random.point(1.0)).normalize()).collect();
        let (mut held, mut gone, mut age, mut served) = (None, 0.0, 0, 0);
        for _ in 0..calls {
            forecast.look((&spheres).into(), None, space).expect("there is memory");
            if let Some(skin) = held {
                (age, gone) = (age + 1, gone + step);
                let lapsed = (gone > skin / 2.0).then_some(Rebuilt::Moved);
                forecast.note_age((age, gone / (skin / 2.0)), lapsed);
                served += u32::from(lapsed.is_none());
                held = held.filter(|_| lapsed.is_none());
            }
            if held.is_none() {
                held = forecast.skin((&spheres).into(), None, space, costs).expect("valid");
                (age, gone) = (0, 0.0);
            }
            for (sphere, way) in spheres.iter_mut().zip(&ways) {
                sphere.center += step * way;
            }
        }
        (served, held)
    }

    #[test]
    fn skins_follow_from_the_motion_and_from_what_things_cost() {
        let cheap = Costs { search: 4.0, find: 1.0, ..COSTS };
        // As if each call took as long as searching among a thousand spheres anew.
        let by_the_call = Costs { call: 1000.0 * COSTS.search, ..COSTS };
        for (what, n, step, costs, calls_served) in [
            ("little motion", 3000, 0.002, COSTS, 90..=100),
            ("none", 3000, 0.0, COSTS, 97..=100),
            ("some", 3000, 0.02, COSTS, 60..=95),
            ("more than a skin is worth", 3000, 0.5, COSTS, 0..=5),
            ("a search that costs nothing", 3000, 0.02, cheap, 0..=5),
            ("too few for what a call costs", 500, 0.002, by_the_call, 0..=0),
            ("enough of them", 5000, 0.002, by_the_call, 90..=100),
        ] {
            let (served, _) = follow(&mut Forecast::default(), (n, 100), step, &costs);
            assert!(calls_served.contains(&served), "{what}: {served} of 100");
        }
    }

    #[test]
    fn motion_that_changes_changes_the_skin() {
        let mut forecast = Forecast::default();
        let (_, slow) = follow(&mut forecast, (2000, 100), 0.001, &COSTS);
        let (served, fast) = follow(&mut forecast, (2000, 300), 0.01, &COSTS);
        assert!(fast > slow && served > 150, "{slow:?} {fast:?}, {served} served");
        let (served, none) = follow(&mut forecast, (2000, 200), 0.6, &COSTS);
        assert!(none.is_none() && served < 40, "{none:?}, {served} served");
        let (served, _) = follow(&mut forecast, (2000, 400), 0.001, &COSTS);
        assert!(served > 100, "{served} served after the motion has come to rest");
    }

    /// A sphere that no sample sees ends candidates at once, for as long as it flies.
    #[test]
    fn who_is_seen_only_by_what_it_ends_is_tried_again_rarely() {
        let n = 4000;
        let mut random = Random(5);
        let spheres: Vec<_> = (0..n).map(|_| Sphere::new(random.point(12.0), 0.5)).collect();
        let mut forecast = Forecast::default();
        let mut tried = 0;
        for call in 0..1000 {
            let mut spheres = spheres.clone();
            spheres.iter_mut().for_each(|sphere| sphere.center.x += 1e-3 * call as f32);
            forecast.look((&spheres).into(), None, Space::UNBOUNDED).expect("there is memory");
            forecast.note_age((1, 80.0), Some(Rebuilt::Moved));
            let skin = forecast.skin((&spheres).into(), None, Space::UNBOUNDED, &COSTS).expect("valid");
            tried += u32::from(skin.is_some());
        }
        assert!((1..60).contains(&tried), "{tried} of 1000 calls had a skin");
    }

    #[test]
    fn more_candidates_than_expected_are_reckoned_with() {
        let mut forecast = Forecast::default();
        let (_, skin) = follow(&mut forecast, (3000, 50), 0.01, &COSTS);
        assert!(skin.is_some());
        // Each has as many as if space were sixteen times as crowded.
        for _ in 0..3 {
            forecast.note_found(16.0 * forecast.choice.map_or(1.0, |choice| choice.candidates));
        }
        let (_, narrower) = follow(&mut forecast, (3000, 1), 0.01, &COSTS);
        assert!(narrower.is_none_or(|narrower| Some(narrower) < skin), "{narrower:?} {skin:?}");
        forecast.note_too_many();
        let (served, none) = follow(&mut forecast, (3000, PATIENCE), 0.01, &COSTS);
        assert!(none.is_none() && served == 0, "{none:?}, {served} served");
    }
}
