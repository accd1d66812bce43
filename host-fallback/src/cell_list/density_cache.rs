//! A density sample and its division of species into groups, which small inputs reuse.

use glam::Vec3;

use super::LevelPlan;
use super::density::{DensityProfile, EXACT_TEST_NS, Sample};
use crate::input::{CenterBounds, Division, Grouping, SearchInput, SizeClass, SpeciesGroups};
use crate::memory::{try_collect, try_push};
use crate::size_class::SIZE_CLASSES;
use crate::{Error, InputStats};

/// Smaller inputs reuse a sample, which takes a sixth of a call with 1000 spheres; a poor plan costs little.
const MAX_REUSE_SPHERES: usize = 1 << 12;
const MAX_REUSES: u32 = 15;
/// Larger shifts of the bounds, as a fraction of the extent, discard the sample.
const MAX_BOUNDS_SHIFT: f32 = 0.0625;
/// A finer division must cost less than this fraction of the coarser one.
const MAX_FINER_COST: f32 = 0.9;
/// Stricter for a division by distance, because its estimate is coarse.
const MAX_NARROW_COST: f32 = 0.5;
/// Nanoseconds per sphere. Cheaper searches gain little by a division by distance.
const MIN_DIVISION_NS: f32 = 200.0;
/// Estimated nanoseconds per sphere of a search between groups.
const CROSSING_NS: f32 = 60.0;

impl Sample {
    /// Estimates the nanoseconds with one plan for all groups.
    fn cost(&self, input: &SearchInput<'_>, density: &DensityProfile, grouping: &Grouping<'_>) -> f32 {
        let exact = match grouping.is_by_radii() {
            true => 0.0,
            false => EXACT_TEST_NS * density.contacts(&input.stats),
        };
        LevelPlan::plan(&input.stats, density).cost + exact
    }

    fn cost_by_group(
        &self,
        input: &SearchInput<'_>,
        of_groups: &[DensityProfile],
        grouping: &Grouping<'_>,
    ) -> Result<f32, Error> {
        let all = self.stats_of_groups(input, grouping)?;
        let within = all.iter().zip(of_groups).enumerate().map(|(group, (stats, density))| {
            if grouping.pairs_within(group) { LevelPlan::plan(stats, density).cost } else { 0.0 }
        });
        let between = grouping.paired_groups().filter(|(a, b)| a != b);
        let between = between.map(|(a, b)| CROSSING_NS * all[a].spheres.min(all[b].spheres) as f32);
        Ok(within.sum::<f32>() + between.sum::<f32>())
    }

    fn codes_of_group(&self, grouping: &Grouping<'_>, group: usize) -> impl Iterator<Item = (u64, u32)> {
        self.codes.iter().copied().filter(move |(_, id)| grouping.group_of(*id as usize) == group)
    }

    fn stats_of_groups(
        &self,
        input: &SearchInput<'_>,
        grouping: &Grouping<'_>,
    ) -> Result<Vec<InputStats>, Error> {
        let of_group = |group| {
            let mut classes = [SizeClass::default(); SIZE_CLASSES];
            for (_, id) in self.codes_of_group(grouping, group) {
                let id = id as usize;
                let (_, effective) = input.test.effective(id as u32);
                let radius = grouping.radius(&input.test, id, effective);
                classes[InputStats::class_of(radius)].add(radius);
            }
            let scale =
                |count: u32| (u64::from(count) * self.spheres as u64 / self.codes.len() as u64) as u32;
            classes.iter_mut().for_each(|class| class.count = scale(class.count));
            input.stats.with_classes(classes)
        };
        try_collect((0..grouping.count()).map(of_group), "groups of spheres")
    }

    fn densities_of_groups(
        &self,
        input: &SearchInput<'_>,
        grouping: &Grouping<'_>,
    ) -> Result<Vec<DensityProfile>, Error> {
        let mut densities = Vec::new();
        for group in 0..grouping.count() {
            let (mut codes, mut bounds) = (Vec::new(), CenterBounds::EMPTY);
            for code in self.codes_of_group(grouping, group) {
                try_push(&mut codes, code, "a sample of the spheres")?;
                bounds.add(input.test.spheres().get(code.1 as usize).center);
            }
            let spheres = codes.len() * self.spheres / self.codes.len().max(1);
            let density = DensityProfile::from_codes(&codes, spheres, self.cube_size, None);
            let density = density.for_group(self.periodic_axes, grouping.pairs_within(group));
            let density = density.within(input.extent(bounds));
            try_push(&mut densities, density, "densities of groups")?;
        }
        Ok(densities)
    }
}

#[derive(Debug)]
pub(crate) struct DensityCache {
    density: DensityProfile,
    of_groups: Vec<DensityProfile>,
    division: Division,
    groups_version: u32,
    spheres: usize,
    split: Option<usize>,
    bounds: [Vec3; 2],
    reuses_left: u32,
}

impl DensityCache {
    pub(crate) fn from_last(last: Option<Self>, input: &SearchInput<'_>) -> Result<Self, Error> {
        let InputStats { spheres, min, max, .. } = input.stats;
        let groups_version = input.groups.map_or(0, SpeciesGroups::version);
        match last {
            Some(last) if last.has_groups(input, groups_version) && last.serves(spheres, [min, max]) => {
                Ok(Self { reuses_left: last.reuses_left - 1, ..last })
            }
            _ => {
                let reuses_left = if spheres < MAX_REUSE_SPHERES { MAX_REUSES } else { 0 };
                let (density, of_groups, division) = Self::sample(input)?;
                let (bounds, split) = ([min, max], input.split);
                Ok(Self { density, of_groups, division, groups_version, spheres, split, bounds, reuses_left })
            }
        }
    }

    fn sample(input: &SearchInput<'_>) -> Result<(DensityProfile, Vec<DensityProfile>, Division), Error> {
        let sample = Sample::take(input)?;
        let Some(groups) = input.groups else {
            return Ok((sample.density(None), Vec::new(), Division::Merged));
        };
        let density = |division| sample.density(Some(&input.grouping(division)));
        let mut best = (density(Division::Merged), Vec::new(), Division::Merged);
        if groups.finer_divisions().next().is_none() {
            return Ok(best);
        }
        let mut least = sample.cost(input, &best.0, &input.grouping(Division::Merged));
        for division in groups.finer_divisions() {
            let grouping = input.grouping(division);
            if !grouping.is_narrow() {
                let density = density(division);
                let cost = sample.cost(input, &density, &grouping);
                if cost < MAX_FINER_COST * least {
                    (least, best) = (cost, (density, Vec::new(), division));
                }
            } else if least > MIN_DIVISION_NS * sample.spheres as f32 {
                let of_groups = sample.densities_of_groups(input, &grouping)?;
                if sample.cost_by_group(input, &of_groups, &grouping)? < MAX_NARROW_COST * least {
                    best = (density(division), of_groups, division);
                }
            }
        }
        Ok(best)
    }

    #[cfg(test)]
    pub(crate) fn with_division(self, division: Division, input: &SearchInput<'_>) -> Self {
        let sample = Sample::take(input).expect("there is memory");
        let of_groups =
            sample.densities_of_groups(input, &input.grouping(division)).expect("there is memory");
        Self { division, of_groups, ..self }
    }

    pub(crate) fn density(&self) -> &DensityProfile {
        &self.density
    }

    /// The division must have a narrow group.
    pub(crate) fn density_of(&self, group: usize) -> &DensityProfile {
        &self.of_groups[group]
    }

    pub(crate) fn division(&self) -> Division {
        self.division
    }

    fn has_groups(&self, input: &SearchInput<'_>, version: u32) -> bool {
        self.groups_version == version && self.split == input.split
    }

    fn serves(&self, spheres: usize, [min, max]: [Vec3; 2]) -> bool {
        let [low, high] = self.bounds;
        let margin = (high - low).max_element() * MAX_BOUNDS_SHIFT;
        let near = |a: Vec3, b: Vec3| (a - b).abs().max_element() <= margin;
        self.reuses_left > 0 && self.spheres == spheres && near(min, low) && near(max, high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sample_is_reused_by_small_inputs_within_about_the_same_bounds() {
        let density = DensityProfile::from_codes(&[(7, 0); 100], 1000, 1.0, None);
        let density_cache = |reuses_left| DensityCache {
            density: density.clone(),
            of_groups: Vec::new(),
            division: Division::Merged,
            groups_version: 0,
            spheres: 1000,
            split: None,
            bounds: [Vec3::ZERO, Vec3::ONE],
            reuses_left,
        };
        assert!(density_cache(1).serves(1000, [Vec3::splat(0.06), Vec3::ONE]));
        assert!(!density_cache(0).serves(1000, [Vec3::ZERO, Vec3::ONE]), "it has served");
        assert!(!density_cache(1).serves(1001, [Vec3::ZERO, Vec3::ONE]), "another number");
        assert!(!density_cache(1).serves(1000, [Vec3::ZERO, Vec3::new(1.0, 1.0, 1.07)]), "another place");
        assert!(!density_cache(1).serves(1000, [Vec3::ZERO, Vec3::INFINITY]), "far away");
    }
}
