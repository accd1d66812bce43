//! Displacements of a sample of spheres between calls, by size class.

use glam::Vec3;

use super::CallSpheres;
use super::candidate_list::nearest;
use crate::Error;
use crate::memory::try_resize;
use crate::size_class::{SIZE_CLASSES, class_of};

const MAX_SAMPLE: usize = 1 << 10;
/// Sampling costs almost nothing.
const MIN_SPHERES_PER_SAMPLE: usize = 32;
/// Per call, of a class's largest displacement.
const STEP_DECAY: f32 = 0.9;
/// Per call, of the learned growth law.
const GROWTH_DECAY: f32 = 0.2;

#[derive(Debug)]
pub(crate) struct DisplacementStats {
    spheres: usize,
    positions: Vec<Vec3>,
    steps: [f32; SIZE_CLASSES],
    calls: u32,
    growth: DisplacementGrowth,
}

/// Growth law of the largest displacement, `factor · calls^exponent`, in units of the largest displacement per call of
/// the sample. Ballistic motion has the exponent 1, diffusion ½.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DisplacementGrowth {
    pub(crate) factor: f32,
    pub(crate) exponent: f32,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Displacements<'a> {
    pub(crate) steps: &'a [f32; SIZE_CLASSES],
    pub(crate) growth: DisplacementGrowth,
}

impl DisplacementGrowth {
    const ASSUMED: Self = Self { factor: 1.3, exponent: 0.75 };

    /// Calls until the largest displacement is `distance`, in units of the displacement per call.
    pub(crate) fn steps(self, distance: f32) -> f32 {
        (distance / self.factor).max(0.0).powf(self.exponent.recip())
    }

    /// From the largest displacement `first` after one call and `last` after `steps` calls.
    fn between(first: f32, steps: u32, last: f32) -> Self {
        let exponent = if steps > 1 { (last / first).ln() / (steps as f32).ln() } else { 1.0 };
        Self { factor: first, exponent: if exponent.is_finite() { exponent.clamp(0.3, 1.5) } else { 1.0 } }
    }
}

impl Default for DisplacementStats {
    fn default() -> Self {
        let growth = DisplacementGrowth::ASSUMED;
        Self { spheres: 0, positions: Vec::new(), steps: [0.0; SIZE_CLASSES], calls: 0, growth }
    }
}

impl DisplacementStats {
    pub(crate) fn observe(&mut self, CallSpheres { test, input }: CallSpheres<'_>) -> Result<(), Error> {
        let n = test.spheres().len();
        let size = (n / MIN_SPHERES_PER_SAMPLE).clamp(n.min(MIN_SPHERES_PER_SAMPLE), MAX_SAMPLE);
        let known = self.spheres == n && self.positions.len() == size;
        if !known {
            try_resize(&mut self.positions, size, "a sample of the spheres")?;
            (self.spheres, self.calls, self.steps) = (n, 0, [0.0; SIZE_CLASSES]);
        }
        let lengths = test.lengths();
        let mut steps = [0.0_f32; SIZE_CLASSES];
        for (k, position) in self.positions.iter_mut().enumerate() {
            let id = k * n / size;
            let [x, y, z, radius] = input.map_or_else(|| test.row(id as u32), |input| input.searched(id));
            let center = Vec3::new(x, y, z);
            let class = &mut steps[class_of(radius)];
            *class = class.max(nearest(center - *position, lengths).length());
            *position = center;
        }
        // A sphere that is not valid, or too far away: what was seen says nothing about the next call.
        if steps.iter().any(|step| !step.is_finite()) {
            (self.calls, self.steps) = (0, [0.0; SIZE_CLASSES]);
        } else if known {
            self.calls = self.calls.saturating_add(1);
            for (step, seen) in self.steps.iter_mut().zip(steps) {
                *step = seen.max(STEP_DECAY * *step);
            }
        }
        Ok(())
    }

    /// Learns from the largest displacements `first` after one call, and `last` after `calls`, in units of the largest
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

    /// Returns the largest displacement per call of each class (unobserved classes get the largest) and its growth law;
    /// `None` before two calls.
    pub(crate) fn steps(&self) -> Option<([f32; SIZE_CLASSES], DisplacementGrowth)> {
        let farthest = self.steps.iter().copied().fold(0.0, f32::max);
        let steps = self.steps.map(|step| if step > 0.0 { step } else { farthest });
        (self.calls > 0).then_some((steps, self.growth))
    }
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::{Space, Sphere};

    use super::*;
    use crate::compare::PairTest;

    #[test]
    fn largest_displacement_of_each_class_decays_slowly() {
        let mut motion = DisplacementStats::default();
        let at = |x: f32| [Sphere::new([x, 0.0, 0.0], 1.0), Sphere::new([0.0, 2.0 * x, 0.0], 0.25)];
        let mut steps = |x: f32| {
            let spheres = at(x);
            motion
                .observe(CallSpheres { test: &PairTest::new((&spheres).into(), None), input: None })
                .expect("there is memory");
            motion.steps().map(|(steps, _)| [steps[class_of(1.0)], steps[class_of(0.25)], steps[7]])
        };
        assert_eq!(steps(5.0), None);
        assert_eq!(steps(6.0), Some([1.0, 2.0, 2.0]));
        assert_eq!(steps(6.0), Some([0.9, 1.8, 1.8]));
    }

    #[test]
    fn infinite_displacements_are_forgotten() {
        let mut motion = DisplacementStats::default();
        let mut seen = |x: f32| {
            let spheres = [Sphere::new([x, 0.0, 0.0], 1.0)];
            let test = PairTest::new((&spheres).into(), None);
            motion.observe(CallSpheres { test: &test, input: None }).expect("there is memory");
            motion.steps().map(|(steps, _)| steps[class_of(1.0)])
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
            motion.observe(CallSpheres { test: &test, input: None }).expect("there is memory");
        }
        assert_eq!(motion.steps().expect("two calls").0[class_of(1.0)], 0.5);
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
