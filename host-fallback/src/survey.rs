//! One pass over the input: is it valid, where does it lie, which sizes does it have?

use glam::Vec3;
use lazygrid_kernels::{InputError, Interactions, MAX_SPHERES, Spheres};
use rayon::prelude::*;

use crate::contact::Rule;

/// Spheres per piece of the pass.
const PIECE: usize = 1 << 15;
/// One class per binary exponent of `f32`.
pub const CLASSES: usize = 256;

/// What a detector must know of its input before it plans.
#[derive(Clone, Debug)]
pub struct Survey {
    /// How many spheres there are.
    pub spheres: usize,
    /// Smallest coordinates of any centre.
    pub min: Vec3,
    /// Largest coordinates of any centre.
    pub max: Vec3,
    /// Spheres by size: class `k` holds the effective radii with binary exponent `k`; class 0 zero and subnormals.
    pub classes: [Class; CLASSES],
}

/// The spheres whose effective radii share a binary exponent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Class {
    /// How many there are.
    pub count: u32,
    /// The largest of their radii.
    pub largest: f32,
}

impl Survey {
    /// The class of a radius.
    #[inline]
    pub fn class_of(radius: f32) -> usize {
        (radius.to_bits() >> 23) as usize & (CLASSES - 1)
    }

    /// The largest effective radius.
    pub fn largest_radius(&self) -> f32 {
        self.classes.iter().fold(0.0, |r, class| r.max(class.largest))
    }

    /// Classes that have spheres, the largest first.
    pub fn occupied(&self) -> impl Iterator<Item = (usize, Class)> + '_ {
        self.classes.iter().copied().enumerate().rev().filter(|(_, class)| class.count > 0)
    }

    /// Surveys spheres that were checked.
    pub(crate) fn of(rule: &Rule<'_>) -> Self {
        let n = rule.spheres().len();
        let survey = (0..n.div_ceil(PIECE))
            .into_par_iter()
            .map(|piece| Self::piece(rule, piece * PIECE, n.min((piece + 1) * PIECE)))
            .reduce(Self::empty, Self::merge);
        Self { spheres: n, ..survey }
    }

    fn piece(rule: &Rule<'_>, from: usize, to: usize) -> Self {
        let mut survey = Self::empty();
        for id in from..to {
            let (center, radius) = rule.effective(id as u32);
            survey.min = survey.min.min(center);
            survey.max = survey.max.max(center);
            let class = &mut survey.classes[Self::class_of(radius)];
            class.count += 1;
            class.largest = class.largest.max(radius);
        }
        survey
    }

    fn empty() -> Self {
        let (min, max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        Self { spheres: 0, min, max, classes: [Class::default(); CLASSES] }
    }

    fn merge(mut self, other: Self) -> Self {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        for (class, with) in self.classes.iter_mut().zip(&other.classes) {
            class.count += with.count;
            class.largest = class.largest.max(with.largest);
        }
        self
    }
}

/// Refuses what no detector can answer: too many spheres, values that are not finite, negative radii, species
/// outside the table.
///
/// # Errors
/// The [`InputError`] that names the first offender.
pub fn check(spheres: Spheres<'_>, interactions: Option<&Interactions>) -> Result<(), InputError> {
    let total = spheres.len() as u64;
    if total > MAX_SPHERES {
        return Err(InputError::TooManySpheres { count: total });
    }
    let (first, count) = find(spheres.len(), |i| !spheres.get(i).is_valid());
    if let Some(index) = first {
        let sphere = spheres.get(index as usize);
        return Err(InputError::Sphere { index, sphere, count, total });
    }
    let Some(table) = interactions else { return Ok(()) };
    let ids = spheres.species().ok_or(InputError::SpeciesMissing)?;
    match find(ids.len(), |i| ids[i] >= table.species()) {
        (Some(i), _) => {
            Err(InputError::SpeciesId { index: Some(i), id: ids[i as usize], count: table.species() })
        }
        (None, _) => Ok(()),
    }
}

/// The first of `0..n` that is `bad`, and how many are.
fn find(n: usize, bad: impl Fn(usize) -> bool + Sync) -> (Option<u32>, u64) {
    (0..n.div_ceil(PIECE))
        .into_par_iter()
        .map(|piece| {
            let range = piece * PIECE..n.min((piece + 1) * PIECE);
            // Nearly always there is none, and a sum without a branch is what the compiler vectorises.
            let count = range.clone().map(|i| u64::from(bad(i))).sum::<u64>();
            let first = if count == 0 { None } else { range.clone().find(|&i| bad(i)).map(|i| i as u32) };
            (first, count)
        })
        .reduce(|| (None, 0), |(a, m), (b, n)| (a.or(b), m + n))
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::Sphere;

    use super::*;

    #[test]
    fn the_first_bad_sphere_is_named_and_all_are_counted() {
        let mut spheres = vec![Sphere::new([0.0; 3], 1.0); 100_000];
        spheres[70_001].radius = f32::NAN;
        spheres[40_000].center.y = f32::INFINITY;
        spheres[99_999].radius = -1.0;
        let Err(InputError::Sphere { index, count, total, .. }) = check((&spheres).into(), None) else {
            panic!("bad spheres were accepted")
        };
        assert_eq!((index, count, total), (40_000, 3, 100_000));
    }

    #[test]
    fn classes_count_every_sphere_once() {
        let radii = [0.0, 1e-40, 0.5, 0.99, 1.0, 1.5, 3.0e38];
        let spheres: Vec<_> = radii.iter().map(|&r| Sphere::new([r, -r, 0.0], r)).collect();
        let survey = Survey::of(&Rule::new((&spheres).into(), None));
        assert_eq!(survey.classes.iter().map(|c| c.count).sum::<u32>(), 7);
        assert_eq!(survey.classes[0].count, 2);
        assert_eq!(survey.classes[Survey::class_of(1.0)], Class { count: 2, largest: 1.5 });
        assert_eq!(survey.largest_radius(), 3.0e38);
        assert_eq!((survey.min.y, survey.max.x), (-3.0e38, 3.0e38));
    }
}
