//! Displacements of a sample of spheres between calls, by species and size class.

use glam::Vec3;

use super::CallSpheres;
use super::candidate_list::nearest;
use crate::Error;
use crate::memory::try_resize;
use crate::size_class::SIZE_CLASSES;
use crate::species_classes::{PerClass, SpeciesClasses};

const MAX_SAMPLE: usize = 1 << 10;
/// Minimum spheres per sampled sphere, so that sampling costs almost nothing.
const MIN_SPHERES_PER_SAMPLE: usize = 32;
/// Decay per call of a class's largest displacement.
const STEP_DECAY: f32 = 0.9;
/// Minimum sampled spheres of a species and class for an estimate.
const MIN_COUNT: u16 = 4;
/// Estimate for spheres at rest, as a fraction of the largest displacement: some may begin to move.
const AT_REST: f32 = 0.125;
/// Fraction by which the learned growth law returns to the assumed one when it is forgotten.
const GROWTH_DECAY: f32 = 0.2;

#[derive(Debug)]
pub(crate) struct DisplacementStats {
    spheres: usize,
    positions: Vec<Vec3>,
    steps: SpeciesClasses,
    seen: SpeciesClasses,
    counts: SpeciesClasses<u16>,
    estimates: SpeciesClasses,
    calls: u32,
    growth: DisplacementGrowth,
}

/// Law of the largest displacement, `factor · calls^exponent`, in units of the sample's largest displacement per call.
/// Ballistic motion has the exponent 1, diffusion ½.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DisplacementGrowth {
    pub(crate) factor: f32,
    pub(crate) exponent: f32,
}

#[derive(Clone, Debug)]
pub(crate) struct Displacements {
    /// Mean over sampled spheres, each with the displacement of its species.
    pub(crate) mean: PerClass,
    pub(crate) largest: PerClass,
    pub(crate) growth: DisplacementGrowth,
}

impl DisplacementGrowth {
    const ASSUMED: Self = Self { factor: 1.3, exponent: 0.75 };

    pub(crate) fn steps(self, distance: f32) -> f32 {
        (distance / self.factor).max(0.0).powf(self.exponent.recip())
    }

    fn between(first: f32, steps: u32, last: f32) -> Self {
        let exponent = if steps > 1 { (last / first).ln() / (steps as f32).ln() } else { 1.0 };
        Self { factor: first, exponent: if exponent.is_finite() { exponent.clamp(0.3, 1.5) } else { 1.0 } }
    }
}

impl Default for DisplacementStats {
    fn default() -> Self {
        let (steps, seen, counts, estimates) = Default::default();
        let growth = DisplacementGrowth::ASSUMED;
        Self { spheres: 0, positions: Vec::new(), steps, seen, counts, estimates, calls: 0, growth }
    }
}

impl DisplacementStats {
    pub(crate) fn observe(&mut self, CallSpheres { test, input, .. }: CallSpheres<'_>) -> Result<(), Error> {
        let n = test.spheres().len();
        let size = (n / MIN_SPHERES_PER_SAMPLE).clamp(n.min(MIN_SPHERES_PER_SAMPLE), MAX_SAMPLE);
        let species = test.species_count();
        let known = self.spheres == n && self.positions.len() == size && self.steps.has_rows_for(species);
        if !known {
            self.spheres = usize::MAX;
            try_resize(&mut self.positions, size, "a sample of the spheres")?;
            self.seen.set_all(species, 0.0)?;
            self.counts.set_all(species, 0)?;
            self.estimates.set_all(species, 0.0)?;
            self.steps.set_all(species, 0.0)?;
            (self.spheres, self.calls) = (n, 0);
        }
        let lengths = test.lengths();
        let input = input.map(|input| (input, input.frame_map()));
        self.seen.fill(0.0);
        self.counts.fill(0);
        for (k, position) in self.positions.iter_mut().enumerate() {
            let id = sampled(k, n, size);
            let [x, y, z, radius] = match &input {
                Some((input, map)) => input.searched(map, id),
                None => test.row(id as u32),
            };
            let center = Vec3::new(x, y, z);
            let species = test.species_of(id as u32);
            let step = self.seen.get_mut(species, radius);
            *step = step.max(nearest(center - *position, lengths).length());
            *self.counts.get_mut(species, radius) += 1;
            *position = center;
        }
        // A sphere is invalid or too far away, so this call predicts nothing.
        if self.seen.numbers().any(|step| !step.is_finite()) {
            self.calls = 0;
            self.steps.fill(0.0);
        } else if known {
            self.calls = self.calls.saturating_add(1);
            for (step, seen) in self.steps.numbers_mut().zip(self.seen.numbers()) {
                *step = seen.max(STEP_DECAY * *step);
            }
        }
        Ok(())
    }

    /// Fits the growth law to the largest displacements after one call and after `calls`, in units of the largest
    /// displacement per call of the sample.
    pub(crate) fn learn(&mut self, first: f32, calls: u32, last: f32) {
        if first > 0.0 {
            self.growth = DisplacementGrowth::between(first, calls, last);
        }
    }

    pub(crate) fn forget(&mut self) {
        let DisplacementGrowth { factor, exponent } = &mut self.growth;
        *factor += GROWTH_DECAY * (DisplacementGrowth::ASSUMED.factor - *factor);
        *exponent += GROWTH_DECAY * (DisplacementGrowth::ASSUMED.exponent - *exponent);
    }

    pub(crate) fn are_known(&self) -> bool {
        self.calls > 0
    }

    /// Estimates the largest displacements per call. Species with few sampled spheres get the largest of their class;
    /// classes without spheres get the largest of all, and spheres at rest a fraction.
    pub(crate) fn estimate(&mut self) {
        let farthest = self.steps.numbers().fold(0.0, f32::max);
        let of_class = self.by_class(&self.steps, farthest);
        let numbers = self.estimates.numbers_mut().zip(self.steps.numbers()).zip(self.counts.numbers());
        for (k, ((estimate, step), count)) in numbers.enumerate() {
            let step = if count < MIN_COUNT { of_class.largest[k % SIZE_CLASSES] } else { step };
            *estimate = if step == 0.0 { AT_REST * farthest } else { step };
        }
    }

    pub(crate) fn estimates(&self) -> &SpeciesClasses {
        &self.estimates
    }

    pub(crate) fn displacements(&self) -> Displacements {
        let farthest = self.estimates.numbers().fold(0.0, f32::max);
        self.by_class(&self.estimates, farthest)
    }

    /// Classes outside the sample get `farthest`.
    fn by_class(&self, steps: &SpeciesClasses, farthest: f32) -> Displacements {
        let [mut mean, mut largest] = [[farthest; SIZE_CLASSES]; 2];
        for class in 0..SIZE_CLASSES {
            let rows = steps.rows().iter().zip(self.counts.rows());
            let species = || {
                rows.clone().map(|(row, count)| (row[class], count[class])).filter(|(_, count)| *count > 0)
            };
            let count: u16 = species().map(|(_, count)| count).sum();
            if count > 0 {
                largest[class] = species().map(|(step, _)| step).fold(0.0, f32::max);
                mean[class] =
                    species().map(|(step, count)| step * f32::from(count)).sum::<f32>() / f32::from(count);
            }
        }
        Displacements { mean, largest, growth: self.growth }
    }
}

/// Returns the `k`-th sampled sphere. Intervals are unequal, because species or sizes may recur at equal ones.
#[inline(always)]
fn sampled(k: usize, n: usize, size: usize) -> usize {
    let anywhere = (k as u32).wrapping_mul(0x9e37_79b1) >> 16;
    k * n / size + anywhere as usize % (n / size)
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::{Interaction, Interactions, Space, Sphere, Spheres};

    use super::*;
    use crate::compare::PairTest;
    use crate::size_class::class_of;

    #[test]
    fn largest_displacement_of_each_class_decays_slowly() {
        let mut motion = DisplacementStats::default();
        let at = |x: f32| [Sphere::new([x, 0.0, 0.0], 1.0), Sphere::new([0.0, 2.0 * x, 0.0], 0.25)];
        let mut steps = |x: f32| {
            let spheres = at(x);
            motion
                .observe(CallSpheres::new(&PairTest::new((&spheres).into(), None)))
                .expect("there is memory");
            motion.estimate();
            motion.are_known().then(|| [1.0, 0.25, 7.0].map(|radius| motion.estimates().get(0, radius)))
        };
        assert_eq!(steps(5.0), None);
        assert_eq!(steps(6.0), Some([1.0, 2.0, 2.0]));
        assert_eq!(steps(6.0), Some([0.9, 1.8, 1.8]));
    }

    #[test]
    fn species_of_one_size_have_displacements_of_their_own() {
        let table = Interactions::new(4, Interaction::Touch).expect("few species");
        let mut motion = DisplacementStats::default();
        for x in [0.0, 1.0] {
            let spheres = [0.0, 0.0, 0.0, 0.0, x, x, x, x, 2.0 * x].map(|x| Sphere::new([x, 0.0, 0.0], 1.0));
            let ids = [0, 0, 0, 0, 1, 1, 1, 1, 2];
            let spheres = Spheres::from(&spheres).with_species(&ids).expect("one id for each");
            let test = PairTest::new(spheres, Some(&table));
            motion.observe(CallSpheres::new(&test)).expect("there is memory");
        }
        motion.estimate();
        let steps = motion.estimates();
        assert_eq!([0, 1, 2, 3].map(|species| steps.get(species, 1.0)), [2.0 * AT_REST, 1.0, 2.0, 2.0]);
        assert_eq!(steps.get(1, 0.5), 2.0, "no sphere of the class");
        let of_class = motion.displacements();
        let class = class_of(1.0);
        assert_eq!(of_class.mean[class], (4.0 * 2.0 * AT_REST + 4.0 + 2.0) / 9.0);
        assert_eq!((of_class.largest[class], of_class.largest[class + 1]), (2.0, 2.0));
    }

    #[test]
    fn sample_has_species_that_recur_at_equal_intervals() {
        for (n, size) in [(4096, 128), (4000, 125), (100, 32), (31, 31), (1 << 20, 1 << 10)] {
            let ids: Vec<_> = (0..size).map(|k| sampled(k, n, size)).collect();
            assert!(ids.is_sorted_by(|a, b| a < b) && ids.iter().all(|&id| id < n));
            for interval in [2, 4].into_iter().filter(|interval| n / size >= 2 * interval) {
                let of_first = ids.iter().filter(|&id| id % interval == 0).count();
                let expected = size / interval;
                assert!(
                    (expected / 2..=2 * expected).contains(&of_first),
                    "{n} {size} {interval}: {of_first}"
                );
            }
        }
    }

    #[test]
    fn infinite_displacements_are_forgotten() {
        let mut motion = DisplacementStats::default();
        let mut seen = |x: f32| {
            let spheres = [Sphere::new([x, 0.0, 0.0], 1.0)];
            let test = PairTest::new((&spheres).into(), None);
            motion.observe(CallSpheres::new(&test)).expect("there is memory");
            motion.estimate();
            motion.are_known().then(|| motion.estimates().get(0, 1.0))
        };
        for (x, step) in [
            (0.0, None),
            (1.0, Some(1.0)),
            (f32::INFINITY, None),
            (1.0, None),
            (3.0, Some(2.0)),
            (-2e38, None),
            (2e38, None),
            (2e38, Some(0.0)),
        ] {
            assert_eq!(seen(x), step, "at {x}");
        }
    }

    #[test]
    fn displacement_across_the_boundary_is_short() {
        let space = Space::periodic([Some(8.0), None, None]).expect("a box");
        let mut motion = DisplacementStats::default();
        for x in [3.75, -3.75] {
            let spheres = [Sphere::new([x, 0.0, 0.0], 1.0)];
            let test = PairTest::new((&spheres).into(), None).in_space(space);
            motion.observe(CallSpheres::new(&test)).expect("there is memory");
        }
        motion.estimate();
        assert_eq!(motion.estimates().get(0, 1.0), 0.5);
    }

    #[test]
    fn growth_law_follows_from_two_distances() {
        let diffusive = DisplacementGrowth::between(1.5, 16, 6.0);
        assert_eq!(diffusive, DisplacementGrowth { factor: 1.5, exponent: 0.5 });
        assert_eq!(diffusive.steps(6.0), 16.0);
        assert_eq!(DisplacementGrowth::between(1.0, 1, 1.0).exponent, 1.0);
        assert_eq!(DisplacementGrowth::between(1.0, 4, 1.0).exponent, 0.3);
    }
}
