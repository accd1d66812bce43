//! Statistics of the input in one pass: validity, bounds and size classes.

use std::ops::Range;

use glam::Vec3;
use lazygrid_kernels::{InputError, Interactions, Spheres};

use super::CenterBounds;
use super::validate::check;
use crate::compare::{EffectiveLoop, EffectiveRows, PairTest};
use crate::executor::{Chunks, Executor};
use crate::size_class::{SIZE_CLASSES, class_of};

const CHUNK_SPHERES: usize = 1 << 13;
/// Tables of size classes that consecutive spheres use in turn.
const TABLES: usize = 4;
/// Number of spheres below which one table is used, because several must be cleared and merged.
const MIN_TABLED_SPHERES: usize = 512;

#[derive(Clone, Debug)]
pub struct InputStats {
    pub spheres: usize,
    pub min: Vec3,
    pub max: Vec3,
    /// Classes by biased exponent of the effective radius. Class 0 has zero and subnormal radii.
    pub classes: [SizeClass; SIZE_CLASSES],
    span: [usize; 2],
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SizeClass {
    pub count: u32,
    pub largest: f32,
}

impl SizeClass {
    #[inline(always)]
    pub(crate) fn add(&mut self, radius: f32) {
        self.count += 1;
        self.largest = self.largest.max(radius);
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.largest = self.largest.max(other.largest);
    }
}

struct AddRows<'a> {
    stats: &'a mut InputStats,
    range: Range<usize>,
}

impl EffectiveLoop for AddRows<'_> {
    type Result = bool;

    #[inline(always)]
    fn run(self, rows: impl EffectiveRows) -> bool {
        let count = self.range.len();
        let spheres = self.range.map(|k| {
            let row = rows.get(k);
            (row, rows.effective(k, row[3]))
        });
        self.stats.add(count, spheres)
    }
}

impl InputStats {
    #[inline]
    pub fn class_of(radius: f32) -> usize {
        class_of(radius)
    }

    pub fn largest_radius(&self) -> f32 {
        self.occupied().next().map_or(0.0, |(_, class)| class.largest)
    }

    /// Returns the classes with spheres, largest first.
    pub fn occupied(&self) -> impl Iterator<Item = (usize, SizeClass)> + '_ {
        let [first, end] = self.span;
        let classes = self.classes.get(first..end).unwrap_or_default();
        (first..end).zip(classes.iter().copied()).rev().filter(|(_, class)| class.count > 0)
    }

    pub(crate) fn with_sizes(&self, larger: impl Fn(usize, f32) -> f32) -> Self {
        let mut stats = Self { spheres: self.spheres, min: self.min, max: self.max, ..Self::empty() };
        for (class, SizeClass { count, largest }) in self.occupied() {
            let largest = larger(class, largest);
            let class = class_of(largest);
            stats.classes[class].merge(&SizeClass { count, largest });
            stats.span = [stats.span[0].min(class), stats.span[1].max(class + 1)];
        }
        stats
    }

    pub(crate) fn bounds(&self) -> CenterBounds {
        CenterBounds { min: self.min, max: self.max }
    }

    pub(crate) fn with_classes(&self, classes: [SizeClass; SIZE_CLASSES]) -> Self {
        let occupied = || (0..SIZE_CLASSES).filter(|&class| classes[class].count > 0);
        let span = occupied().next().zip(occupied().next_back());
        let spheres = classes.iter().map(|class| class.count as usize).sum();
        let span = span.map_or([SIZE_CLASSES, 0], |(first, last)| [first, last + 1]);
        Self { spheres, min: self.min, max: self.max, classes, span }
    }

    /// Species ids must have been checked.
    ///
    /// # Errors
    /// [`InputError::Sphere`] for the first invalid sphere.
    pub fn new(
        spheres: Spheres<'_>,
        interactions: Option<&Interactions>,
        executor: Executor,
    ) -> Result<Self, InputError> {
        Self::from_test(&PairTest::new(spheres, interactions), executor)
    }

    pub(crate) fn from_test(test: &PairTest<'_>, executor: Executor) -> Result<Self, InputError> {
        let spheres = test.spheres();
        let n = spheres.len();
        let chunk = |stats: &mut Self, chunk: usize| {
            let range = chunk * CHUNK_SPHERES..n.min((chunk + 1) * CHUNK_SPHERES);
            test.for_rows(AddRows { stats, range })
        };
        let chunks = n.div_ceil(CHUNK_SPHERES);
        let mut stats = Self::empty();
        let is_suspect = match executor.for_light_work(n) {
            // Moving the statistics takes longer than adding a few spheres.
            Executor::Caller => (0..chunks).fold(false, |suspect, k| suspect | chunk(&mut stats, k)),
            pool => {
                let step = |(mut stats, suspect): (Self, bool), k| {
                    let is_suspect = chunk(&mut stats, k);
                    Ok::<_, InputError>((stats, suspect | is_suspect))
                };
                let merge = |(mut a, p): (Self, bool), (b, q): (Self, bool)| {
                    a.merge(&b);
                    Ok((a, p | q))
                };
                let (all, suspect) =
                    pool.fold(Chunks::unlimited(chunks), || (Self::empty(), false), step, merge)?;
                stats = all;
                suspect
            }
        };
        if is_suspect {
            check(spheres, executor)?;
        }
        stats.spheres = n;
        Ok(stats)
    }

    fn add(&mut self, count: usize, spheres: impl Iterator<Item = ([f32; 4], f32)>) -> bool {
        match count < MIN_TABLED_SPHERES {
            true => self.add_in::<1>(spheres),
            false => self.add_in::<TABLES>(spheres),
        }
    }

    #[inline(always)]
    fn add_in<const N: usize>(&mut self, spheres: impl Iterator<Item = ([f32; 4], f32)>) -> bool {
        let (mut min, mut max) = ([f32::INFINITY; 4], [f32::NEG_INFINITY; 4]);
        let (mut smallest, mut largest) = (f32::INFINITY, 0.0_f32);
        // Any non-finite number makes this NaN, without a branch.
        let mut poison = [0.0; 4];
        // With one table, equal radii would wait for the same counter.
        let mut tables = [[SizeClass::default(); SIZE_CLASSES]; N];
        for (k, (row, radius)) in spheres.enumerate() {
            for component in 0..4 {
                min[component] =
                    if row[component] < min[component] { row[component] } else { min[component] };
                max[component] =
                    if row[component] > max[component] { row[component] } else { max[component] };
                poison[component] += row[component] * 0.0;
            }
            smallest = if radius < smallest { radius } else { smallest };
            largest = if radius > largest { radius } else { largest };
            tables[k % N][class_of(radius)].add(radius);
        }
        let is_suspect = poison != [0.0; 4] || min[3] < 0.0;
        let (first, end) = (class_of(smallest), class_of(largest) + 1);
        if first < end {
            self.span = [self.span[0].min(first), self.span[1].max(end)];
            for table in &tables {
                for (class, with) in self.classes[first..end].iter_mut().zip(&table[first..end]) {
                    class.merge(with);
                }
            }
        }
        self.min = self.min.min(Vec3::new(min[0], min[1], min[2]));
        self.max = self.max.max(Vec3::new(max[0], max[1], max[2]));
        is_suspect
    }

    fn empty() -> Self {
        let (min, max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let classes = [SizeClass::default(); SIZE_CLASSES];
        Self { spheres: 0, min, max, classes, span: [SIZE_CLASSES, 0] }
    }

    fn merge(&mut self, other: &Self) {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.span = [self.span[0].min(other.span[0]), self.span[1].max(other.span[1])];
        for (class, with) in self.classes.iter_mut().zip(&other.classes) {
            class.merge(with);
        }
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
            InputStats::from_test(&PairTest::new((&spheres).into(), None), Executor::Pool)
        else {
            panic!("bad spheres were accepted")
        };
        assert_eq!((index, count, total), (40_000, 3, 100_000));
    }

    #[test]
    fn classes_count_every_sphere_once() {
        let radii = [0.0, 1e-40, 0.5, 0.99, 1.0, 1.5, 3.0e38];
        let spheres: Vec<_> = radii.iter().map(|&r| Sphere::new([r, -r, 0.0], r)).collect();
        let stats = InputStats::from_test(&PairTest::new((&spheres).into(), None), Executor::Pool)
            .expect("all are valid");
        assert_eq!(stats.classes.iter().map(|c| c.count).sum::<u32>(), 7);
        assert_eq!(stats.classes[0].count, 2);
        assert_eq!(stats.classes[InputStats::class_of(1.0)], SizeClass { count: 2, largest: 1.5 });
        assert_eq!(stats.largest_radius(), 3.0e38);
        assert_eq!((stats.min.y, stats.max.x), (-3.0e38, 3.0e38));
    }
}
