//! Statistics of the input in one pass: validity, bounds and size classes.

use std::ops::Range;

use bytemuck::cast;
use glam::Vec3;
use lazygrid_kernels::{InputError, Interactions, Spheres};

use super::validate::check;
use crate::compare::PairTest;
use crate::executor::Executor;
use crate::size_class::{SIZE_CLASSES, class_of};

/// Spheres per chunk of the pass: few enough to balance threads, enough that merging takes no time.
const CHUNK_SPHERES: usize = 1 << 13;
/// Tables that count in turn.
const TABLES: usize = 4;
/// Number of spheres below which one table counts: clearing and merging four takes longer.
const FEW_SPHERES: usize = 256;

/// Statistics of the input that a detector needs before it plans.
#[derive(Clone, Debug)]
pub struct InputStats {
    /// The number of spheres.
    pub spheres: usize,
    /// The smallest coordinates of any center.
    pub min: Vec3,
    /// The largest coordinates of any center.
    pub max: Vec3,
    /// Spheres by size: class `k` holds the effective radii with binary exponent `k`; class 0 zero and subnormals.
    pub classes: [SizeClass; SIZE_CLASSES],
}

/// The spheres whose effective radii share a binary exponent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SizeClass {
    /// The number of spheres.
    pub count: u32,
    /// The largest of their radii.
    pub largest: f32,
}

impl SizeClass {
    /// Counts a sphere of this radius.
    #[inline(always)]
    pub(crate) fn add(&mut self, radius: f32) {
        self.count += 1;
        self.largest = self.largest.max(radius);
    }

    /// Counts the spheres of another class.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.largest = self.largest.max(other.largest);
    }
}

impl InputStats {
    /// The class of a radius.
    #[inline]
    pub fn class_of(radius: f32) -> usize {
        class_of(radius)
    }

    /// The largest effective radius.
    pub fn largest_radius(&self) -> f32 {
        self.classes.iter().fold(0.0, |r, class| r.max(class.largest))
    }

    /// The classes with spheres, the largest first.
    pub fn occupied(&self) -> impl Iterator<Item = (usize, SizeClass)> + '_ {
        self.classes.iter().copied().enumerate().rev().filter(|(_, class)| class.count > 0)
    }

    /// Checks and measures spheres whose species ids are checked already.
    ///
    /// # Errors
    /// [`InputError::Sphere`] for the first sphere that is not finite or has a negative radius.
    pub fn new(
        spheres: Spheres<'_>,
        interactions: Option<&Interactions>,
        executor: Executor,
    ) -> Result<Self, InputError> {
        Self::of(&PairTest::new(spheres, interactions), executor)
    }

    /// Checks and measures the spheres of `test`, whose species ids are checked already.
    ///
    /// # Errors
    /// [`InputError::Sphere`] for the first that is not valid.
    pub(crate) fn of(test: &PairTest<'_>, executor: Executor) -> Result<Self, InputError> {
        let spheres = test.spheres();
        let n = spheres.len();
        let survey = |range: Range<usize>| match (test.plain_rows(), range.len() < FEW_SPHERES) {
            (Some(rows), false) => {
                Self::piece::<TABLES>(rows[range].iter().map(|sphere| (cast(*sphere), sphere.radius)))
            }
            (None, false) => {
                Self::piece::<TABLES>(range.map(|i| (cast(spheres.get(i)), test.effective(i as u32).1)))
            }
            (_, true) => Self::piece::<1>(range.map(|i| (cast(spheres.get(i)), test.effective(i as u32).1))),
        };
        if n < FEW_SPHERES {
            let (stats, suspect) = survey(0..n);
            if suspect {
                check(spheres, executor)?;
            }
            return Ok(Self { spheres: n, ..stats });
        }
        let piece = |(stats, suspect): (Self, bool), piece: usize| {
            let range = piece * CHUNK_SPHERES..n.min((piece + 1) * CHUNK_SPHERES);
            let (own, suspicious) = survey(range);
            Ok((stats.merge(own), suspect | suspicious))
        };
        let merge = |(a, p): (Self, bool), (b, q): (Self, bool)| Ok((a.merge(b), p | q));
        let pieces = (n.div_ceil(CHUNK_SPHERES), usize::MAX);
        let (stats, suspect) =
            executor.for_light_work(n).fold(pieces, || (Self::empty(), false), piece, merge)?;
        if suspect {
            check(spheres, executor)?;
        }
        Ok(Self { spheres: n, ..stats })
    }

    /// Measures one chunk, given as rows `x, y, z, r` with their effective radii. Also returns `true` if a sphere may be
    /// invalid.
    fn piece<const TABLES: usize>(spheres: impl Iterator<Item = ([f32; 4], f32)>) -> (Self, bool) {
        let (mut min, mut max) = ([f32::INFINITY; 4], [f32::NEG_INFINITY; 4]);
        // Any number that is not finite makes this NaN, without a branch per sphere.
        let mut poison = [0.0; 4];
        // With one table, equal radii would wait for the same counter.
        let mut tables = [[SizeClass::default(); SIZE_CLASSES]; TABLES];
        for (k, (row, radius)) in spheres.enumerate() {
            // Each line compiles to one vector instruction.
            for lane in 0..4 {
                min[lane] = if row[lane] < min[lane] { row[lane] } else { min[lane] };
                max[lane] = if row[lane] > max[lane] { row[lane] } else { max[lane] };
                poison[lane] += row[lane] * 0.0;
            }
            tables[k % TABLES][Self::class_of(radius)].add(radius);
        }
        let suspect = poison != [0.0; 4] || min[3] < 0.0;
        let (min, max) = (Vec3::new(min[0], min[1], min[2]), Vec3::new(max[0], max[1], max[2]));
        let own = Self { spheres: 0, min, max, classes: tables[0] };
        let stats =
            tables[1..].iter().fold(own, |all, &classes| all.merge(Self { classes, ..Self::empty() }));
        (stats, suspect)
    }

    fn empty() -> Self {
        let (min, max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        Self { spheres: 0, min, max, classes: [SizeClass::default(); SIZE_CLASSES] }
    }

    fn merge(mut self, other: Self) -> Self {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        for (class, with) in self.classes.iter_mut().zip(&other.classes) {
            class.merge(with);
        }
        self
    }
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
        let Err(InputError::Sphere { index, count, total, .. }) =
            InputStats::of(&PairTest::new((&spheres).into(), None), Executor::Pool)
        else {
            panic!("bad spheres were accepted")
        };
        assert_eq!((index, count, total), (40_000, 3, 100_000));
    }

    #[test]
    fn classes_count_every_sphere_once() {
        let radii = [0.0, 1e-40, 0.5, 0.99, 1.0, 1.5, 3.0e38];
        let spheres: Vec<_> = radii.iter().map(|&r| Sphere::new([r, -r, 0.0], r)).collect();
        let stats =
            InputStats::of(&PairTest::new((&spheres).into(), None), Executor::Pool).expect("all are valid");
        assert_eq!(stats.classes.iter().map(|c| c.count).sum::<u32>(), 7);
        assert_eq!(stats.classes[0].count, 2);
        assert_eq!(stats.classes[InputStats::class_of(1.0)], SizeClass { count: 2, largest: 1.5 });
        assert_eq!(stats.largest_radius(), 3.0e38);
        assert_eq!((stats.min.y, stats.max.x), (-3.0e38, 3.0e38));
    }
}
