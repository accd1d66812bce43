use bytemuck::{cast, cast_slice};
use lazygrid_kernels::{Space, Sphere, SphereValues, Spheres};

use super::input_spheres::{InputLoop, InputRows, InputSpheres};
use crate::Simd;
use crate::compare::{SimdTask, SimdWidth};
use crate::executor::Executor;
use crate::frame::{Bounds, FrameMap};
use crate::memory::try_collect;
use crate::{Error, math};

const CHUNK_SPHERES: usize = 1 << 14;
/// Number of lengths up to which [`Wrapping::wrap`] computes images itself.
const NEAR: f64 = (1 << 20) as f64;

pub(super) fn copy(
    spheres: Spheres<'_>,
    targets: &mut [Sphere],
    space: Option<&Space>,
    simd: Simd,
    executor: Executor,
) {
    let wrapping = space.map(Wrapping::new);
    executor.for_each_chunk(targets, CHUNK_SPHERES, |chunk, targets| {
        let from = chunk * CHUNK_SPHERES;
        match &wrapping {
            Some(wrapping) => simd.run(WrapChunk { spheres, wrapping, from, targets }, None),
            None => copy_chunk(spheres, from, targets),
        }
    });
}

/// A loop for each layout, because a test of the layout per sphere takes longer than the copy.
fn copy_chunk(spheres: Spheres<'_>, from: usize, targets: &mut [Sphere]) {
    match spheres.values() {
        SphereValues::RowsF32(rows) => targets.copy_from_slice(cast_slice(&rows[from..][..targets.len()])),
        SphereValues::StridedF32(columns) => {
            targets.iter_mut().zip(from..).for_each(|(to, k)| *to = cast(columns.get(k)));
        }
        SphereValues::RowsF64(_) | SphereValues::StridedF64(_) => {
            targets.iter_mut().zip(from..).for_each(|(to, k)| *to = spheres.get(k));
        }
    }
}

struct Wrapping<'s> {
    space: &'s Space,
    /// 0 for an unbounded axis.
    lengths: [f64; 4],
    per_length: [f64; 4],
}

impl<'s> Wrapping<'s> {
    fn new(space: &'s Space) -> Self {
        let [x, y, z] = space.lengths_f32().map(|length| length.map_or(0.0, f64::from));
        let lengths = [x, y, z, 0.0];
        let per_length = lengths.map(|length| if length > 0.0 { length.recip() } else { 0.0 });
        Self { space, lengths, per_length }
    }

    /// Moves a sphere to its image within half a length of the origin, without rounding.
    ///
    /// # Correctness
    ///
    /// 1. A coordinate `x` and a length `L` are `f32` numbers. Unless `x / L` is a whole number and a half, it is at
    ///    least 2⁻²⁶ away from one. Below 2²⁰ lengths the product with the inverse is wrong by less than 2⁻³¹, so it
    ///    rounds to a nearest whole number.
    /// 2. That number, of at most 21 bits, times a length of 24 bits is an `f64` number. The difference from `x` is at
    ///    most half a length and a multiple of a unit of `x` or `L`, hence an `f32` number.
    /// 3. [`Space::wrap`] wraps all other coordinates, including non-finite ones.
    #[inline(always)]
    fn wrap(&self, sphere: Sphere) -> Sphere {
        let row: [f32; 4] = cast(sphere);
        let (mut wrapped, mut is_near) = (row, true);
        for component in 0..4 {
            let x = f64::from(row[component]);
            let lengths = x * self.per_length[component];
            wrapped[component] = (x - math::nearest(lengths) * self.lengths[component]) as f32;
            is_near &= lengths.abs() < NEAR;
        }
        if is_near { cast(wrapped) } else { Sphere { center: self.space.wrap(sphere.center), ..sphere } }
    }
}

struct WrapChunk<'c> {
    spheres: Spheres<'c>,
    wrapping: &'c Wrapping<'c>,
    from: usize,
    targets: &'c mut [Sphere],
}

impl SimdTask for WrapChunk<'_> {
    type Result = ();

    #[inline(always)]
    fn run<V: SimdWidth>(self, _: V) {
        let Self { spheres, wrapping, from, targets } = self;
        match spheres.values() {
            SphereValues::RowsF32(rows) => {
                let spheres: &[Sphere] = cast_slice(&rows[from..]);
                targets.iter_mut().zip(spheres).for_each(|(to, sphere)| *to = wrapping.wrap(*sphere));
            }
            SphereValues::StridedF32(columns) => {
                targets.iter_mut().zip(from..).for_each(|(to, k)| *to = wrapping.wrap(cast(columns.get(k))));
            }
            SphereValues::RowsF64(_) | SphereValues::StridedF64(_) => {
                targets.iter_mut().zip(from..).for_each(|(to, k)| *to = wrapping.wrap(spheres.get(k)));
            }
        }
    }
}

/// Returns the bounds of the given numbers.
pub(super) fn map_to_frame(
    input: InputSpheres<'_>,
    targets: &mut [Sphere],
    simd: Simd,
    executor: Executor,
) -> Result<Bounds, Error> {
    let map = |(chunk, targets): (usize, &mut [Sphere])| {
        simd.run(FrameChunk { input, from: chunk * CHUNK_SPHERES, targets }, None)
    };
    let chunks = targets.chunks_mut(CHUNK_SPHERES).enumerate();
    if executor == Executor::Caller {
        return Ok(chunks.map(map).fold(Bounds::EMPTY, Bounds::merge));
    }
    let mut chunks = try_collect(chunks.map(|chunk| (chunk, Bounds::EMPTY)), "chunks of spheres")?;
    executor.for_each(&mut chunks, |_, ((chunk, targets), bounds)| *bounds = map((*chunk, targets)));
    Ok(chunks.iter().fold(Bounds::EMPTY, |all, (_, bounds)| all.merge(*bounds)))
}

struct FrameChunk<'c> {
    input: InputSpheres<'c>,
    from: usize,
    targets: &'c mut [Sphere],
}

impl SimdTask for FrameChunk<'_> {
    type Result = Bounds;

    #[inline(always)]
    fn run<V: SimdWidth>(self, vector: V) -> Bounds {
        self.input.run(vector, self)
    }
}

impl InputLoop for FrameChunk<'_> {
    type Result = Bounds;

    #[inline(always)]
    fn run<V: SimdWidth, const PERIODIC: bool>(
        self,
        vector: V,
        rows: impl InputRows,
        map: &FrameMap<'_>,
    ) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for (target, k) in self.targets.iter_mut().zip(self.from..) {
            let row = rows.get(k);
            vector.add_to_bounds(&mut bounds, row);
            *target = cast(vector.map_to_frame::<PERIODIC>(map, rows.effective(k, row)));
        }
        bounds
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::Random;

    #[test]
    fn wrapping_agrees_with_the_space_at_any_distance() {
        let mut states = Random(5);
        let mut random = || (states.next() >> 33) as u32;
        for length in [1.0_f32, 0.1, 3.0, 10.0, 1.0 / 3.0, 7.7e-4, 16_777_215.0, 1e-44, 1e37] {
            let space =
                Space::periodic([Some(f64::from(length)), None, Some(f64::from(length))]).expect("a box");
            let wrapping = Wrapping::new(&space);
            let mut spheres: Vec<_> = (0..4000)
                .map(|k| {
                    let near = |word: u32| {
                        let at = (word % 41) as f32 * 0.5 * length;
                        [at, at.next_up(), at.next_down(), -at][word as usize % 4]
                    };
                    let anywhere =
                        f32::from_bits(random() % 0x7f00_0000) * if k % 2 == 0 { 1.0 } else { -1.0 };
                    Sphere::new(
                        [near(random()), anywhere, if k % 5 == 0 { anywhere } else { near(random()) }],
                        0.5,
                    )
                })
                .collect();
            spheres.push(Sphere::new([f32::NAN, f32::INFINITY, 0.0], f32::INFINITY));
            for simd in [Simd::detect(), Simd::Portable] {
                let mut found = vec![Sphere::default(); spheres.len()];
                copy((&spheres).into(), &mut found, Some(&space), simd, Executor::Caller);
                for (sphere, found) in spheres.iter().zip(&found).take(spheres.len() - 1) {
                    let expected = space.wrap(sphere.center);
                    for axis in [0, 2] {
                        let is_tie = (2.0 * f64::from(expected[axis])).abs() == f64::from(length);
                        let is_same = found.center[axis] == expected[axis]
                            || is_tie && found.center[axis] == -expected[axis];
                        assert!(is_same, "{sphere:?} in {length:e}: {found:?}, not {expected}");
                    }
                    assert_eq!((found.center.y, found.radius), (sphere.center.y, 0.5));
                }
                assert!(!found[spheres.len() - 1].is_valid());
            }
            assert!(wrapping.wrap(Sphere::new([length, 0.0, 0.0], 1.0)).center.x == 0.0);
        }
    }
}
