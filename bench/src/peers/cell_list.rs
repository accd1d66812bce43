//! A plain, well-made cell list as the yardstick: spheres sorted by the cell of their centre, one grid per size class,
//! half of the neighbourhood visited, contiguous runs compared. It shares nothing with lazygrid's detectors but the
//! exact test, which makes it the reference where comparing all pairs would take too long.

use std::error::Error;

use lazygrid::{Pair, Sphere};

use super::class::Class;
use crate::measure::{Contender, Found, Search};

/// Sizes of a class are within this factor of each other.
const CLASS: f32 = 4.0;
/// The smallest spheres, and points, share the last of this many classes.
const CLASSES: usize = 24;

/// The yardstick, which keeps the last step's order.
pub fn running() -> Contender {
    Contender::new("plain cell list", || Ok(CellList::default()))
}

#[derive(Default)]
struct CellList {
    /// From the largest spheres to the smallest.
    classes: Vec<Class>,
    pairs: Vec<Pair>,
    spheres: usize,
}

impl CellList {
    /// Sorts the spheres into classes by size, once: radii do not change from step to step.
    fn classify(&mut self, spheres: &[Sphere]) {
        let largest = spheres.iter().fold(0.0_f32, |largest, s| largest.max(s.radius));
        self.classes = std::iter::repeat_with(Class::default).take(CLASSES).collect();
        for (k, sphere) in (0..).zip(spheres) {
            let halvings = (largest / sphere.radius).log(CLASS);
            // A radius of 0 has infinitely many, no radius at all NaN, which becomes 0.
            let class = (halvings as usize).min(CLASSES - 1);
            self.classes[class].order.push(k);
        }
        self.classes.retain(|class| !class.order.is_empty());
        self.spheres = spheres.len();
    }
}

impl Search for CellList {
    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        if self.spheres != spheres.len() {
            self.classify(spheres);
        }
        self.find(spheres);
        Ok(Found::Pairs(&self.pairs))
    }
}

impl CellList {
    fn find(&mut self, spheres: &[Sphere]) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor was just asked whether it has what the function needs.
            return unsafe { self.find_with_avx2(spheres) };
        }
        self.find_plainly(spheres);
    }

    /// The same code, for which the compiler may use wider vectors.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn find_with_avx2(&mut self, spheres: &[Sphere]) {
        self.find_plainly(spheres);
    }

    #[inline(always)]
    fn find_plainly(&mut self, spheres: &[Sphere]) {
        self.pairs.clear();
        for class in &mut self.classes {
            class.build(spheres);
        }
        for (k, class) in self.classes.iter().enumerate() {
            class.pairs_within(&mut self.pairs);
            for finer in &self.classes[k + 1..] {
                class.pairs_with(finer, &mut self.pairs);
            }
        }
    }
}
