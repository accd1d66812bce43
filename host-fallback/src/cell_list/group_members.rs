use glam::Vec3;

use super::levels::LevelPlan;
use crate::Error;
use crate::compare::{PairTest, SphereRadii};
use crate::executor::Chunks;
use crate::frame::SearchFrame;
use crate::input::{CenterBounds, GroupInteraction, Grouping, InputStats, SearchInput, SizeClass};
use crate::memory::try_collect;
use crate::size_class::SIZE_CLASSES;

const CHUNK_SPHERES: usize = 1 << 14;

#[derive(Clone, Debug)]
pub(super) struct GroupMembers {
    /// Classes of the radius within the group, with the skin for candidates.
    pub(super) classes: [SizeClass; SIZE_CLASSES],
    pub(super) effective: f32,
    bounds: CenterBounds,
    /// Largest radius; with a skin, the largest that changes no effective radius.
    radius: f32,
    margin: f32,
}

impl GroupMembers {
    const NONE: Self = Self {
        classes: [SizeClass { count: 0, largest: 0.0 }; SIZE_CLASSES],
        effective: 0.0,
        bounds: CenterBounds::EMPTY,
        radius: 0.0,
        margin: 0.0,
    };

    fn add(&mut self, test: &PairTest<'_>, grouping: &Grouping<'_>, id: usize) {
        let SphereRadii { center, own, effective, widened, .. } = test.radii(id as u32);
        let radius = grouping.radius(test, id, widened);
        self.classes[InputStats::class_of(radius)].add(radius);
        self.effective = self.effective.max(widened);
        self.bounds.add(center);
        self.radius = self.radius.max(if test.has_margin() { own.max(effective) } else { own });
        self.margin = self.margin.max(widened - effective);
    }

    fn merge(&mut self, other: &Self) {
        for (class, with) in self.classes.iter_mut().zip(&other.classes) {
            class.merge(with);
        }
        self.effective = self.effective.max(other.effective);
        self.bounds.merge(other.bounds);
        self.radius = self.radius.max(other.radius);
        self.margin = self.margin.max(other.margin);
    }

    /// Two sets without other groups get the bounds of all spheres and no radii.
    pub(super) fn count(
        all: &mut Vec<Self>,
        input: &SearchInput<'_>,
        grouping: &Grouping<'_>,
    ) -> Result<(), Error> {
        if let Some(split) = grouping.sets() {
            *all = try_collect(Self::from_sets(input, split).into_iter(), "groups of spheres")?;
            return Ok(());
        }
        let (n, groups) = (input.stats.spheres, grouping.count());
        let open = || try_collect(std::iter::repeat_n(Self::NONE, groups), "groups of spheres");
        let fold_chunk = |members: Result<Vec<Self>, Error>, chunk: usize| {
            let mut members = members?;
            for id in chunk * CHUNK_SPHERES..n.min((chunk + 1) * CHUNK_SPHERES) {
                members[grouping.group_of(id)].add(&input.test, grouping, id);
            }
            Ok::<_, Error>(Ok(members))
        };
        let merge = |a: Result<Vec<Self>, Error>, b: Result<Vec<Self>, Error>| {
            let (mut a, b) = (a?, b?);
            a.iter_mut().zip(&b).for_each(|(a, b)| a.merge(b));
            Ok::<_, Error>(Ok(a))
        };
        let chunks = Chunks::unlimited(n.div_ceil(CHUNK_SPHERES));
        *all = input.executor.for_light_work(n).fold(chunks, open, fold_chunk, merge)??;
        Ok(())
    }

    fn from_sets(input: &SearchInput<'_>, split: usize) -> [Self; 2] {
        let (classes, bounds) = (input.stats.classes, input.stats.bounds());
        let mut first = Self { classes, bounds, ..Self::NONE };
        let mut second = first.clone();
        first.classes.iter_mut().for_each(|class| class.count = 0);
        for id in 0..split as u32 {
            let (_, radius) = input.test.effective(id);
            first.classes[InputStats::class_of(radius)].count += 1;
        }
        for (class, of_first) in second.classes.iter_mut().zip(&first.classes) {
            class.count -= of_first.count;
        }
        [first, second]
    }

    pub(super) fn level_class(&self, plan: &LevelPlan, level: usize) -> SizeClass {
        let mut all = SizeClass::default();
        for (class, class_level) in self.classes.iter().zip(&plan.of_class) {
            if usize::from(*class_level) == level {
                all.merge(class);
            }
        }
        all
    }

    pub(super) fn bounds(&self) -> CenterBounds {
        let point = CenterBounds { min: Vec3::ZERO, max: Vec3::ZERO };
        if self.bounds.min.x <= self.bounds.max.x { self.bounds } else { point }
    }

    pub(super) fn search_cutoff(
        &self,
        other: &Self,
        group_interaction: GroupInteraction,
        frame: Option<&SearchFrame>,
    ) -> f64 {
        let radii = f64::from(self.radius) + f64::from(other.radius);
        let searched = |frame: &SearchFrame| {
            let half = frame.radius(0.5 * group_interaction.distance);
            half.map_or(f64::INFINITY, |half| 2.0 * f64::from(half))
        };
        let distance = frame.map_or(group_interaction.distance, searched);
        let cutoff = distance.max(if group_interaction.touches { radii } else { 0.0 });
        cutoff + (f64::from(self.margin) + f64::from(other.margin))
    }
}
