//! Which skin calls on the GPU have where the detector is to choose: what it tries next, by what it saw.
//!
//! A skin in proportion to the farthest step is tried. How many candidates it has and how long they last tells what a
//! call costs on average; while wider skins cost less, the next wider one is tried. Spheres alone decide, never a clock,
//! so that runs are the same. Costs are bytes that a GPU moves, by the plans of the kernels.

use glam::Vec3;
use lazygrid_host::{Kept, SKINS};
use lazygrid_kernels::{Space, Spheres};

/// The narrowest skin that is tried, in farthest steps of the sample; half of a skin is what a sphere may go. Each next
/// one is twice as wide.
const NARROWEST: f32 = 4.0;
/// The narrowest skin at all, as a part of the mean diameter.
const LEAST_SKIN: f32 = 1.0 / 64.0;
/// How many widths there are.
const WIDTHS: usize = 6;
/// Spheres from which on a skin is tried: with fewer, calls cost little but their submission.
const LEAST: usize = 10_000;
/// Spheres of the sample.
const SAMPLE: usize = 1 << 10;
/// A skin has to be this much better than none, or than the next narrower one.
const BETTER: f32 = 0.9;
/// Calls after which candidates that still serve are judged.
const LONG: u32 = 64;
/// Calls without a skin after one that was not worth it; doubled from time to time up to the most.
const PATIENCE: [u32; 2] = [8, 512];
/// By what factor the cost of a skin may change until another one is looked for, not sooner than after so many calls.
const AS_BEFORE: std::ops::RangeInclusive<f32> = 0.75..=1.33;
const SOON: u32 = 32;

/// Bytes per sphere to search anew.
const SEARCH: f32 = 210.0;
/// Bytes to read again in a search for each pair that it finds.
const FIND: f32 = 100.0;
/// Bytes per sphere to keep where it was.
const KEEP: f32 = 48.0;
/// Bytes per sphere to measure how far it has gone.
const MEASURE: f32 = 36.0;
/// Bytes to test a candidate.
const TEST: f32 = 40.0;

/// What is known of the motion, and which skin is used for now.
#[derive(Debug, Default)]
pub(super) struct Course {
    sample: Sample,
    /// Calls before a skin is tried, and how many they were the last time.
    wait: u32,
    patience: u32,
    used: Option<Used>,
    /// The skin of the least cost so far, by its place among the widths, with its cost.
    best: Option<(usize, f32)>,
}

/// A skin that is used.
#[derive(Clone, Copy, Debug)]
struct Used {
    width: usize,
    skin: f32,
    /// Whether it stays when its candidates have lapsed.
    is_settled: bool,
    /// Calls since candidates were found, that one included.
    calls: u32,
    /// Candidates per sphere, and pairs.
    candidates: f32,
    pairs: f32,
}

impl Used {
    /// Bytes per sphere of a call, on average over the calls so far.
    fn cost(&self) -> f32 {
        let found = KEEP + searched(self.candidates);
        found / self.calls as f32 + MEASURE + TEST * self.candidates
    }
}

/// Bytes per sphere of a search that finds so many pairs per sphere.
fn searched(pairs: f32) -> f32 {
    SEARCH + FIND * pairs
}

impl Course {
    /// The skin of the next call.
    pub(super) fn next(&mut self, spheres: Spheres<'_>, space: Space) -> Option<f32> {
        match self.sample.look(spheres, space) {
            None => self.restart(),
            Some(_) if spheres.len() < LEAST => self.restart(),
            Some(motion) => {
                self.wait = self.wait.saturating_sub(1);
                match self.used {
                    None if self.wait == 0 => self.begin(0, motion, false),
                    Some(Used { width, is_settled, calls: 0, .. }) => self.begin(width, motion, is_settled),
                    _ => (),
                }
            }
        }
        self.used.map(|used| used.skin)
    }

    /// Takes down what a call with `spheres` spheres and so many pairs had: the candidates that answered it, if any.
    pub(super) fn note(&mut self, spheres: usize, pairs: u64, kept: Option<Kept>) {
        let Some(used) = &mut self.used else { return };
        let Some(kept) = kept else { return self.give_up() };
        let mut before = *used;
        let each = 1.0 / spheres.max(1) as f32;
        (used.candidates, used.pairs) = (kept.count as f32 * each, pairs as f32 * each);
        if kept.rebuilt.is_none() {
            used.calls = used.calls.saturating_add(1);
            if used.calls < LONG || used.is_settled {
                return;
            }
            before = *used;
        }
        used.calls = 1;
        if before.calls > 0 {
            self.judge(&before);
        } else if MEASURE + TEST * used.candidates > BETTER * searched(used.pairs) {
            // However long they last.
            self.fall_back();
        }
    }

    fn restart(&mut self) {
        *self = Self { sample: std::mem::take(&mut self.sample), wait: 2, ..Self::default() };
    }

    /// Uses a skin of this width, where it is one and not wider than spheres are on average.
    fn begin(&mut self, width: usize, motion: Seen, is_settled: bool) {
        let skin = (NARROWEST * motion.step).max(LEAST_SKIN * motion.diameter) * (1 << width) as f32;
        if skin > motion.diameter || !SKINS.contains(&skin) {
            return self.fall_back();
        }
        self.used = Some(Used { width, skin, is_settled, calls: 0, candidates: 0.0, pairs: 0.0 });
    }

    /// Judges a skin whose candidates have lapsed, or have lasted long.
    fn judge(&mut self, used: &Used) {
        let (cost, none) = (used.cost(), searched(used.pairs));
        if used.is_settled {
            let is_as_before = self.best.is_none_or(|(_, least)| AS_BEFORE.contains(&(cost / least)));
            if cost >= none {
                self.give_up();
            } else if !is_as_before && self.wait == 0 {
                // Spheres move otherwise than when it was chosen.
                (self.wait, self.used, self.best) = (1, None, None);
            }
            return;
        }
        if cost >= BETTER * self.best.map_or(none, |(_, least)| least) {
            return self.fall_back();
        }
        self.best = Some((used.width, cost));
        let is_last = used.calls >= LONG || used.width + 1 == WIDTHS;
        match &mut self.used {
            Some(next) if is_last => (next.is_settled, self.wait) = (true, SOON),
            Some(next) => (next.width, next.calls) = (used.width + 1, 0),
            None => (),
        }
    }

    /// Goes back to the best skin, if there is one.
    fn fall_back(&mut self) {
        match (self.best, &mut self.used) {
            (Some((width, _)), Some(used)) if !used.is_settled => {
                (used.width, used.calls, used.is_settled) = (width, 0, true);
                self.wait = SOON;
            }
            _ => self.give_up(),
        }
    }

    fn give_up(&mut self) {
        self.patience = (2 * self.patience).clamp(PATIENCE[0], PATIENCE[1]);
        (self.wait, self.used, self.best) = (self.patience, None, None);
    }
}

/// What a look at the spheres shows.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// The farthest step of one of the sample since the last call.
    step: f32,
    /// The mean diameter of the sample.
    diameter: f32,
}

/// Spheres that are looked at in every call.
#[derive(Debug, Default)]
struct Sample {
    spheres: usize,
    places: Vec<Vec3>,
}

impl Sample {
    /// How far the sample has gone since the last call; `None` where that had another number of spheres.
    fn look(&mut self, spheres: Spheres<'_>, space: Space) -> Option<Seen> {
        let n = spheres.len();
        let size = n.min(SAMPLE);
        let is_known = self.spheres == n && n > 0;
        self.spheres = n;
        self.places.resize(size, Vec3::ZERO);
        let (mut step, mut diameter) = (0.0_f64, 0.0);
        for (k, place) in self.places.iter_mut().enumerate() {
            let sphere = spheres.get((k as u64 * n as u64 / size as u64) as usize);
            step = step.max(space.distance_squared(*place, sphere.center));
            diameter += 2.0 * f64::from(sphere.radius) / size as f64;
            *place = sphere.center;
        }
        is_known.then_some(Seen { step: step.sqrt() as f32, diameter: diameter as f32 })
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_host::Rebuilt;
    use lazygrid_kernels::Sphere;

    use super::*;

    const N: usize = 20_000;

    /// Spheres that all go `step` along x at every call, whose candidates per sphere are 0.2 · (1 + skin)³. Returns how
    /// many of the calls were served from candidates, the last skin, and the calls that found candidates.
    fn follow(course: &mut Course, calls: u32, step: f32, crowding: f32) -> (u32, Option<f32>, u32) {
        let (mut at, mut served, mut found) = (0.0, 0, 0);
        let (mut held, mut left): (Option<f32>, f32) = (None, 0.0);
        for _ in 0..calls {
            at += step;
            let spheres = vec![Sphere::new([at, 0.0, 0.0], 0.5); N];
            let skin = course.next((&spheres).into(), Space::UNBOUNDED);
            left -= step;
            let fits = held == skin && left >= 0.0;
            let Some(skin) = skin else {
                held = None;
                course.note(N, 4000, None);
                continue;
            };
            let mut kept = Kept::default();
            kept.count = (N as f32 * crowding * (1.0 + skin).powi(3)) as u64;
            if fits {
                served += 1;
            } else {
                (held, left) = (Some(skin), skin / 2.0);
                kept.rebuilt = Some(Rebuilt::Moved);
                found += 1;
            }
            course.note(N, (N as f32 * crowding) as u64, Some(kept));
        }
        (served, held, found)
    }

    #[test]
    fn what_moves_little_is_served_from_candidates() {
        let mut course = Course::default();
        let (served, skin, found) = follow(&mut course, 400, 0.002, 0.2);
        assert!(served > 370 && found < 25, "{served} of 400, found {found} times");
        assert!(skin.is_some_and(|skin| (0.02..0.3).contains(&skin)), "{skin:?}");
    }

    #[test]
    fn what_stands_still_is_served_by_one_search() {
        let (served, _, found) = follow(&mut Course::default(), 300, 0.0, 0.2);
        assert!(served > 290 && found < 4, "{served} of 300, found {found} times");
    }

    #[test]
    fn what_flies_is_searched_anew_and_tried_ever_more_rarely() {
        for (step, crowding) in [(0.5, 0.2), (0.24, 0.2), (0.01, 0.0)] {
            let (served, skin, found) = follow(&mut Course::default(), 1000, step, crowding);
            match step < 0.1 {
                // Few candidates cost little.
                true => assert!(served > 800 && skin.is_some(), "{step}: {served}"),
                false => {
                    assert!(served + found < 40 && skin.is_none(), "{step}: {served} served, {found} found")
                }
            }
        }
    }

    #[test]
    fn motion_that_changes_changes_the_skin() {
        let mut course = Course::default();
        let (_, slow, _) = follow(&mut course, 300, 0.0005, 0.2);
        let (served, fast, _) = follow(&mut course, 400, 0.005, 0.2);
        assert!(fast > slow && served > 300, "{slow:?} {fast:?}, {served} served");
        let (served, none, _) = follow(&mut course, 400, 0.6, 0.2);
        assert!(none.is_none() && served < 20, "{none:?}, {served} served");
    }

    #[test]
    fn few_spheres_and_other_numbers_of_them_are_searched_anew() {
        let mut course = Course::default();
        for n in [LEAST - 1, LEAST, LEAST + 1, LEAST, LEAST - 1].repeat(3) {
            let spheres = vec![Sphere::new([0.0; 3], 0.5); n];
            assert_eq!(course.next((&spheres).into(), Space::UNBOUNDED), None, "{n}");
            course.note(n, 0, None);
        }
    }
}
