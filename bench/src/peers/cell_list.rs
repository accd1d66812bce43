//! A plain, well-made cell list with one grid per size class, as the baseline and the reference. It shares
//! only the exact test with lazygrid.

use std::error::Error;

use lazygrid::{Pair, Sphere};

use super::size_class_grid::SizeClassGrid;
use crate::measure::{ContenderFactory, Found, PairFinder};
use lazygrid_io::scenes::Scene;

/// Maximum number of size classes; the smallest spheres and points share the last one.
const CLASSES: usize = 24;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Cell size over the largest diameter of a class, at least 0.25. Below 1.01, a sphere searches more than
    /// one cell in each direction.
    pub cell_ratio: f32,
    /// Ratio of the largest to the smallest size of a class, above 1.
    pub class: f32,
}

impl Tuning {
    pub const DEFAULT: Self = Self { cell_ratio: 1.5, class: 4.0 };

    /// Returns the fastest of [`tunings`], by the ratio to parry3d's refitted tree within rounds of `--mode
    /// yardstick --algorithm cell-list --output unordered --n 100000 --rounds 7 --steps 3` of the bench
    /// `peers`.
    pub fn best(scene: Scene) -> Self {
        match scene {
            Scene::Equal => Self { cell_ratio: 2.5, ..Self::DEFAULT },
            // One class suffices: a cell of the largest spheres holds at most as many spheres as a vector
            // compares.
            Scene::FiveSizes => Self { cell_ratio: 1.25, class: 32.0 },
            Scene::Burst => Self { cell_ratio: 0.51, class: 4.0 },
            // The default gives transceivers and carriers separate grids.
            Scene::BurstLinear | Scene::Point | Scene::Transceivers(_) => Self::DEFAULT,
        }
    }
}

pub fn tunings(scene: Scene) -> Vec<ContenderFactory> {
    let classes: &[f32] = match scene {
        Scene::Equal => &[4.0],
        Scene::FiveSizes => &[2.0, 4.0, 32.0],
        Scene::Burst | Scene::BurstLinear | Scene::Point | Scene::Transceivers(_) => &[2.0, 4.0, 8.0],
    };
    let mut tunings = vec![];
    for &class in classes {
        for cell_ratio in [0.51, 0.75, 1.01, 1.25, 1.5, 2.0, 2.5] {
            let name = format!("plain cell list, cell ratio {cell_ratio}, class {class}");
            tunings.push(with(name, Tuning { cell_ratio, class }));
        }
    }
    tunings
}

pub fn incremental() -> ContenderFactory {
    with("plain cell list", Tuning::DEFAULT)
}

pub fn tuned(name: impl Into<String>, scene: Scene) -> ContenderFactory {
    with(name, Tuning::best(scene))
}

fn with(name: impl Into<String>, tuning: Tuning) -> ContenderFactory {
    ContenderFactory::new(name, move || Ok(CellList::new(tuning)))
}

pub(super) struct CellList {
    tuning: Tuning,
    classes: Vec<SizeClassGrid>,
    pairs: Vec<Pair>,
    spheres: usize,
}

impl CellList {
    pub(super) fn from_scene(scene: Scene) -> Self {
        Self::new(Tuning::best(scene))
    }

    pub(super) fn pairs_of(&mut self, spheres: &[Sphere]) -> &Vec<Pair> {
        if self.spheres != spheres.len() {
            self.classify(spheres);
        }
        self.find(spheres);
        &self.pairs
    }

    pub(super) fn order(&self) -> impl Iterator<Item = u32> {
        self.classes.iter().flat_map(|class| class.order.iter().copied())
    }

    fn new(tuning: Tuning) -> Self {
        Self { tuning, classes: vec![], pairs: vec![], spheres: 0 }
    }

    fn classify(&mut self, spheres: &[Sphere]) {
        let largest = spheres.iter().fold(0.0_f32, |largest, s| largest.max(s.radius));
        self.classes = std::iter::repeat_with(SizeClassGrid::default).take(CLASSES).collect();
        for (k, sphere) in (0..).zip(spheres) {
            let halvings = (largest / sphere.radius).log2();
            // A radius of 0 gives infinity. If all radii are 0, NaN becomes 0.
            let class = ((halvings / self.tuning.class.log2()) as usize).min(CLASSES - 1);
            self.classes[class].order.push(k);
        }
        self.classes.retain(|class| !class.order.is_empty());
        self.spheres = spheres.len();
    }
}

impl PairFinder for CellList {
    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        Ok(Found::Pairs(self.pairs_of(spheres)))
    }
}

impl CellList {
    fn find(&mut self, spheres: &[Sphere]) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor supports AVX2, as checked above.
            return unsafe { self.find_with_avx2(spheres) };
        }
        self.find_plainly(spheres);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn find_with_avx2(&mut self, spheres: &[Sphere]) {
        self.find_plainly(spheres);
    }

    #[inline(always)]
    fn find_plainly(&mut self, spheres: &[Sphere]) {
        self.pairs.clear();
        for class in &mut self.classes {
            class.build(spheres, self.tuning.cell_ratio);
        }
        for (k, class) in self.classes.iter().enumerate() {
            class.pairs_within(&mut self.pairs);
            for finer in &self.classes[k + 1..] {
                class.pairs_with(finer, &mut self.pairs);
            }
        }
    }
}
