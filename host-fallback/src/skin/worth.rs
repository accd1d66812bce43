//! Which skin is worth it: a pure function of what is known of the spheres and of their motion.
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

/// Estimated time per sphere to survey and sort, in nanoseconds. This and those below were measured beside each other on
/// AMD EPYC, and only their ratios count.
const SORT: f32 = 24.0;
/// Estimated time of a search over what the plan of the levels says of it.
const SEARCH: f32 = 1.4;
/// Estimated time to write down a pair or a candidate that a search finds, in nanoseconds.
const WRITE: f32 = 12.0;
/// Estimated time per sphere to keep where it was, in nanoseconds.
const KEEP: f32 = 10.0;
/// Estimated time per sphere to measure how far it has gone, in nanoseconds.
const MEASURE: f32 = 7.0;
/// Estimated time to test a candidate, in nanoseconds.
const TEST: f32 = 2.5;
/// Candidates per sphere at most, so that memory stays in proportion.
const MOST: f32 = 64.0;

/// A skin that is worth it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    /// The skin in farthest steps of the sample.
    pub(crate) skin: f32,
    /// How many calls candidates are expected to last.
    pub(crate) calls: f32,
}

/// The skin with which a call takes the least time on average, where one is better than none.
pub(crate) fn choose(
    survey: &Survey,
    crowding: &Crowding,
    (steps, growth): (&[f32; CLASSES], Growth),
) -> Option<Choice> {
    let n = survey.spheres as f32;
    let search =
        |survey: &Survey, found: f32| SORT + SEARCH * Levels::plan(survey, crowding).cost / n + WRITE * found;
    let none = search(survey, candidates(survey, crowding, &[0.0; CLASSES]));
    let mut best: Option<(f32, Choice)> = None;
    for skin in SKINS {
        let allowances = allowances(steps, skin);
        if !allowances.iter().all(|allowance| FINITE.contains(allowance)) {
            continue;
        }
        let candidates = candidates(survey, crowding, &allowances);
        if candidates > MOST {
            break;
        }
        let wide = widened(survey, &allowances);
        let find = KEEP + search(&wide, candidates);
        let test = MEASURE + TEST * candidates;
        let calls = growth.steps(skin).floor();
        let time = (find + (calls + 1.0) * test) / (calls + 1.0);
        match &best {
            Some((least, _)) if *least <= time => {}
            _ => best = Some((time, Choice { skin, calls })),
        }
    }
    let (time, choice) = best?;
    log::debug!("a skin of {} steps, {time:.1} ns a sphere, {none:.1} without", choice.skin);
    (time < BETTER * none).then_some(choice)
}

/// So many farthest steps for each class.
pub(super) fn allowances(steps: &[f32; CLASSES], skin: f32) -> Allowances {
    let farthest = steps.iter().copied().fold(0.0, f32::max);
    steps.map(|step| (skin * step.max(LEAST * farthest)).max(*FINITE.start()))
}

/// What is known of spheres whose radii are larger by their allowances.
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
