//! Choice of the skin from sizes, displacements and costs.
//!
//! With skins in proportion to the displacements of each species and size class, all spheres exceed their limits at
//! about the same time.

use super::candidate_list::LIMIT_RANGE;
use super::displacement::Displacements;
use crate::cell_list::{DensityProfile, LevelPlan};
use crate::input::{InputStats, SizeClass};
use crate::size_class::SIZE_CLASSES;
use crate::species_classes::PerClass;

/// Skins to compare, in units of the largest displacement per call of the sample.
const SKIN_STEPS: [f32; 9] = [2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 32.0, 64.0];
/// Fraction of the cost without a skin, which a skin must not exceed, because displacements are uncertain.
const MAX_RELATIVE_COST: f32 = 0.9;
const MAX_CLASS_GROUPS: usize = 16;
/// Smallest displacement limit as a fraction of the largest.
const MIN_LIMIT_RATIO: f32 = 1e-3;

/// Costs of calls with and without a candidate list. Only their ratios have an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinCosts {
    /// Nanoseconds per sphere to measure and sort for a search.
    pub search_ns: f32,
    /// Nanoseconds per unit of cost in the CPU's level plan. 0 on a GPU.
    pub levels_ns: f32,
    /// Nanoseconds per pair or candidate that a search finds.
    pub find_ns: f32,
    /// Nanoseconds per sphere to store its reference position.
    pub keep_ns: f32,
    /// Nanoseconds per sphere to measure its displacement.
    pub measure_ns: f32,
    /// Nanoseconds per candidate test.
    pub test_ns: f32,
    /// Nanoseconds per call with a candidate list, for its further dispatches.
    pub call_ns: f32,
}

impl SkinCosts {
    /// Costs on a CPU, measured in one run on an AMD EPYC.
    pub const CPU: Self = Self {
        search_ns: 24.0,
        levels_ns: 1.4,
        find_ns: 12.0,
        keep_ns: 10.0,
        measure_ns: 7.0,
        test_ns: 2.5,
        call_ns: 0.0,
    };

    /// Returns the fewest spheres for which a candidate list may pay; `None` if it never does.
    pub fn min_worthwhile_spheres(&self) -> Option<u32> {
        let saved = self.search_ns - self.measure_ns;
        (saved > 0.0).then(|| (self.call_ns / saved).ceil() as u32)
    }

    /// Returns `true` if all costs are finite and not negative, and a search costs more than 0.
    pub fn is_valid(&self) -> bool {
        let Self { search_ns, levels_ns, find_ns, keep_ns, measure_ns, test_ns, call_ns } = *self;
        let others = [levels_ns, find_ns, keep_ns, measure_ns, test_ns, call_ns];
        search_ns.is_finite() && search_ns > 0.0 && others.iter().all(|cost| cost.is_finite() && *cost >= 0.0)
    }

    /// Returns the nanoseconds per sphere of a search.
    fn search_ns_per_sphere(&self, stats: &InputStats, density: &DensityProfile, found: f32) -> f32 {
        let levels = match self.levels_ns > 0.0 {
            true => self.levels_ns * LevelPlan::plan(stats, density).cost / stats.spheres as f32,
            false => 0.0,
        };
        self.search_ns + levels + self.find_ns * found
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SkinScaling {
    Proportional,
    Alike,
}

/// Maximum candidates per sphere, which bounds the memory of a list.
const MAX_CANDIDATES: f32 = 64.0;

#[derive(Clone, Copy, Debug)]
pub(super) struct SkinChoice {
    /// Skin in units of the largest displacement per call of the sample.
    pub(super) skin: f32,
    /// Calls that the list serves after its build.
    pub(super) calls: f32,
    /// Candidates per sphere.
    pub(super) candidates: f32,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct SkinModel<'a> {
    pub(super) costs: &'a SkinCosts,
    pub(super) scaling: SkinScaling,
    pub(super) least: f32,
}

impl SkinModel<'_> {
    /// Returns the limit for `step` per call; `farthest` is the largest.
    pub(super) fn limit(&self, skin: f32, step: f32, farthest: f32) -> f32 {
        let ratio = if self.scaling == SkinScaling::Alike { 1.0 } else { MIN_LIMIT_RATIO };
        (skin * step.max(ratio * farthest)).max(*LIMIT_RANGE.start()).max(self.least)
    }
}

/// Minimizes the mean time of a call; `None` if a search without a skin costs less. `excess` multiplies the estimated
/// candidates.
pub(super) fn choose(
    stats: &InputStats,
    density: &DensityProfile,
    motion: &Displacements,
    model: SkinModel<'_>,
    excess: f32,
) -> Option<SkinChoice> {
    let (n, costs) = (stats.spheres as f32, model.costs);
    let farthest = motion.largest.iter().copied().fold(0.0, f32::max);
    let around = |limits: &PerClass| excess * candidates(stats, density, limits);
    let none = costs.search_ns_per_sphere(stats, density, around(&[0.0; SIZE_CLASSES]));
    let mut best: Option<(f32, SkinChoice)> = None;
    for skin in SKIN_STEPS {
        let [mean, largest] =
            [&motion.mean, &motion.largest].map(|steps| steps.map(|step| model.limit(skin, step, farthest)));
        if !largest.iter().all(|limit| LIMIT_RANGE.contains(limit)) {
            continue;
        }
        let candidates = around(&mean);
        if candidates > MAX_CANDIDATES {
            break;
        }
        let wide = stats.with_sizes(|class, radius| radius + largest[class]);
        let find = costs.keep_ns + costs.search_ns_per_sphere(&wide, density, candidates);
        let test = costs.measure_ns + costs.test_ns * candidates + costs.call_ns / n;
        let calls = motion.growth.steps(skin).floor();
        let time = (find + (calls + 1.0) * test) / (calls + 1.0);
        match &best {
            Some((least, _)) if *least <= time => {}
            _ => best = Some((time, SkinChoice { skin, calls, candidates })),
        }
    }
    let (time, choice) = best?;
    log::debug!("skin of {} steps: {time:.1} ns per sphere, {none:.1} ns without a skin", choice.skin);
    (time < MAX_RELATIVE_COST * none).then_some(choice)
}

fn candidates(stats: &InputStats, density: &DensityProfile, limits: &PerClass) -> f32 {
    // log₂ of the side of a cube with the volume of a unit ball.
    const CUBE: f32 = 0.689;
    let classes = stats.occupied().count();
    let stride = classes.div_ceil(MAX_CLASS_GROUPS).max(1);
    let mut groups = [(0.0_f32, 0.0_f32); MAX_CLASS_GROUPS];
    for (k, (class, SizeClass { count, largest })) in stats.occupied().enumerate() {
        let (fraction, radius) = &mut groups[k / stride];
        *fraction += count as f32 / stats.spheres as f32;
        *radius = radius.max(largest + limits[class]);
    }
    let groups = || groups.iter().filter(|(fraction, _)| *fraction > 0.0);
    let met = |&(fraction, radius): &(f32, f32)| {
        let around = |&(other_fraction, other): &(f32, f32)| {
            other_fraction * (density.mean((radius + other).log2() + CUBE) - 1.0).max(0.0)
        };
        fraction * groups().map(around).sum::<f32>()
    };
    groups().map(met).sum::<f32>() / 2.0
}
