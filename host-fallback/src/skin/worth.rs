//! Chooses the skin: a pure function of the survey of the spheres, their motion, and the costs.
//!
//! A skin in proportion to the farthest steps of each size is used up by all sizes at about the same time. The wider
//! it is, the longer candidates last, and the more of them there are.

use super::motion::Growth;
use super::{Allowances, FINITE};
use crate::cell_list::{Crowding, Levels};
use crate::classes::{CLASSES, class_of};
use crate::survey::{Class, Survey};

/// Skins that are tried, in farthest steps of the sample.
const SKINS: [f32; 9] = [2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 32.0, 64.0];
/// A skin has to be this much better than none, by the estimate: what it knows of the motion is uncertain.
const BETTER: f32 = 0.9;
/// Groups of size classes that are told apart at most.
const GROUPS: usize = 16;
/// The smallest allowance, as a part of the largest.
const LEAST: f32 = 1e-3;

/// The costs of calls, in nanoseconds or any other unit: only ratios count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// For each sphere of a search, for any result: to survey and sort on the CPU.
    pub search: f32,
    /// Of a search besides, over what the plan of the CPU's levels says of looking around.
    pub levels: f32,
    /// For each pair or candidate that a search finds.
    pub find: f32,
    /// For each sphere, to keep where it was.
    pub keep: f32,
    /// For each sphere, to measure how far it has gone.
    pub measure: f32,
    /// To test a candidate.
    pub test: f32,
    /// Of a call that keeps candidates, over one that does not, however many spheres there are.
    pub call: f32,
}

impl Costs {
    /// Nanoseconds of the CPU path, measured beside each other on AMD EPYC.
    pub const CPU: Self =
        Self { search: 24.0, levels: 1.4, find: 12.0, keep: 10.0, measure: 7.0, test: 2.5, call: 0.0 };

    /// The cost of a search for each sphere.
    fn of_search(&self, survey: &Survey, crowding: &Crowding, found: f32) -> f32 {
        let levels = match self.levels > 0.0 {
            true => self.levels * Levels::plan(survey, crowding).cost / survey.spheres as f32,
            false => 0.0,
        };
        self.search + levels + self.find * found
    }
}

/// The distribution of a skin among sizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Spread {
    /// In proportion to the farthest steps of each.
    BySize,
    /// All have the same.
    Alike,
}

impl Spread {
    /// The displacement limit of each class for a skin in farthest steps.
    pub(super) fn allowances(self, steps: &[f32; CLASSES], skin: f32) -> Allowances {
        let farthest = steps.iter().copied().fold(0.0, f32::max);
        let least = if self == Self::Alike { 1.0 } else { LEAST };
        steps.map(|step| (skin * step.max(least * farthest)).max(*FINITE.start()))
    }
}

/// Candidates per sphere at most, so that memory stays in proportion.
const MOST: f32 = 64.0;

/// A skin that is worth it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Choice {
    /// The skin in farthest steps of the sample.
    pub(super) skin: f32,
    /// The number of calls that the candidates are expected to last.
    pub(super) calls: f32,
    /// The expected number of candidates for each sphere.
    pub(super) candidates: f32,
}

/// The skin with which a call takes the least time on average, where one is better than none, if there are `excess` times as
/// many candidates as the sample says.
pub(super) fn choose(
    (survey, crowding): (&Survey, &Crowding),
    (steps, growth): (&[f32; CLASSES], Growth),
    (costs, spread): (&Costs, Spread),
    excess: f32,
) -> Option<Choice> {
    let n = survey.spheres as f32;
    let around = |allowances: &Allowances| excess * candidates(survey, crowding, allowances);
    let none = costs.of_search(survey, crowding, around(&[0.0; CLASSES]));
    let mut best: Option<(f32, Choice)> = None;
    for skin in SKINS {
        let allowances = spread.allowances(steps, skin);
        if !allowances.iter().all(|allowance| FINITE.contains(allowance)) {
            continue;
        }
        let candidates = around(&allowances);
        if candidates > MOST {
            break;
        }
        let wide = widened(survey, &allowances);
        let find = costs.keep + costs.of_search(&wide, crowding, candidates);
        let test = costs.measure + costs.test * candidates + costs.call / n;
        let calls = growth.steps(skin).floor();
        let time = (find + (calls + 1.0) * test) / (calls + 1.0);
        match &best {
            Some((least, _)) if *least <= time => {}
            _ => best = Some((time, Choice { skin, calls, candidates })),
        }
    }
    let (time, choice) = best?;
    log::debug!("a skin of {} steps, {time:.1} a sphere, {none:.1} without", choice.skin);
    (time < BETTER * none).then_some(choice)
}

/// The survey of the spheres with radii larger by their displacement limits.
fn widened(survey: &Survey, allowances: &Allowances) -> Survey {
    let mut wide = Survey { classes: [Class::default(); CLASSES], ..survey.clone() };
    for (class, Class { count, largest }) in survey.occupied() {
        let largest = largest + allowances[class];
        let target = &mut wide.classes[class_of(largest)];
        target.count += count;
        target.largest = target.largest.max(largest);
    }
    wide
}

/// About how many candidates there are per sphere.
fn candidates(survey: &Survey, crowding: &Crowding, allowances: &Allowances) -> f32 {
    // The edge of a cube with the volume of a sphere of radius 1, as log₂.
    const CUBE: f32 = 0.689;
    let classes = survey.occupied().count();
    let stride = classes.div_ceil(GROUPS).max(1);
    let mut groups = [(0.0_f32, 0.0_f32); GROUPS];
    for (k, (class, Class { count, largest })) in survey.occupied().enumerate() {
        let (share, reach) = &mut groups[k / stride];
        *share += count as f32 / survey.spheres as f32;
        *reach = reach.max(largest + allowances[class]);
    }
    let groups = || groups.iter().filter(|(share, _)| *share > 0.0);
    let met = |&(share, reach): &(f32, f32)| {
        let around = |&(of, other): &(f32, f32)| {
            // The sphere itself is no candidate.
            of * (crowding.mean((reach + other).log2() + CUBE) - 1.0).max(0.0)
        };
        share * groups().map(around).sum::<f32>()
    };
    groups().map(met).sum::<f32>() / 2.0
}
