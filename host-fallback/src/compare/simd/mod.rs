//! SIMD code of every detector: compares one sphere with several.
//!
//! It filters in `f32` with an error band around tangency. [`PairTest`](super::pair_test::PairTest) decides inside the
//! band, so SIMD width, fused multiply-adds and operation order cannot change a result.

use std::env;
use std::fmt;
use std::ops::Range;
use std::sync::OnceLock;

use lazygrid_kernels::Pair;

use super::columns::{Columns, MAX_LANES};
use crate::frame::{Bounds, FrameMap};
use minimum_image::MinimumImage;
pub(crate) use minimum_image::PeriodicBox;
pub(crate) use portable::Portable;
pub(crate) use run_queue::{NeighborRows, RunQueue, SphereRun};
pub(crate) use scalar::Xyzr;

mod minimum_image;
mod portable;
mod run_queue;
mod scalar;
#[cfg(target_arch = "x86_64")]
mod x86;
#[cfg(target_arch = "x86_64")]
mod x86_pairs;
#[cfg(target_arch = "x86_64")]
mod x86_rows;

/// Relative half-width of the band. `f32` rounding changes `d²` relative to `(ri + rj)²` by at most 4 ulp, 2⁻²¹; twice
/// that leaves one comparison in 10⁶ to the exact test. Between minimum images, with separate slack, it is at most
/// 11 of the 16 half ulps of the band.
const BAND: f32 = 1.0 / (1 << 20) as f32;
/// Absolute half-width of the band, below which products underflow.
const FLOOR: f32 = f32::MIN_POSITIVE;

#[cfg(target_arch = "x86_64")]
struct Feature {
    name: &'static str,
    is_detected: fn() -> bool,
}

/// The widest SIMD code to use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Simd {
    /// 16 lanes, x86-64 with AVX-512F and the sets of [`Avx2`](Self::Avx2).
    Avx512,
    /// 8 lanes, x86-64 with AVX2, FMA, BMI1, BMI2, LZCNT and POPCNT.
    Avx2,
    /// 8 lanes of the target's baseline vectors, such as SSE2 or NEON.
    Portable,
}

impl fmt::Display for Simd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Avx512 => "AVX-512, 16 lanes",
            Self::Avx2 => "AVX2, 8 lanes",
            Self::Portable => "portable vectors, 8 lanes",
        })
    }
}

impl Simd {
    /// Detects the instruction sets once. The environment variable `LAZYGRID_SIMD` restricts them to `avx2` or
    /// `portable`.
    pub fn detect() -> Self {
        static WIDEST: OnceLock<Simd> = OnceLock::new();
        #[cfg(target_arch = "x86_64")]
        let widest = || {
            for Feature { name, .. } in
                x86::Avx512::FEATURES.iter().filter(|feature| !(feature.is_detected)())
            {
                log::debug!("the processor has no {name}");
            }
            Self::widest(|feature| (feature.is_detected)())
        };
        #[cfg(not(target_arch = "x86_64"))]
        let widest = || Self::Portable;
        *WIDEST.get_or_init(|| widest().narrower(Self::allowed(env::var("LAZYGRID_SIMD").ok().as_deref())))
    }

    fn allowed(setting: Option<&str>) -> Self {
        match setting {
            None | Some("avx512") => Self::Avx512,
            Some("avx2") => Self::Avx2,
            Some("portable") => Self::Portable,
            Some(other) => {
                log::warn!("ignored LAZYGRID_SIMD=\"{other}\"; choose avx512, avx2 or portable");
                Self::Avx512
            }
        }
    }

    fn narrower(self, other: Self) -> Self {
        if self as u8 > other as u8 { self } else { other }
    }

    /// Tests each instruction set, because a virtual machine may hide any.
    #[cfg(target_arch = "x86_64")]
    fn widest(has: impl Fn(&Feature) -> bool) -> Self {
        if x86::Avx512::FEATURES.iter().all(&has) {
            Self::Avx512
        } else if x86::Avx2::FEATURES.iter().all(&has) {
            Self::Avx2
        } else {
            Self::Portable
        }
    }

    /// Runs `task` with this width, or a narrower one if it is unavailable.
    pub(crate) fn run<T: SimdTask>(self, task: T, periodic: Option<PeriodicBox>) -> T::Result {
        match self.narrower(Self::detect()) {
            // SAFETY: this width is no wider than `detect` returns, for which this processor has all features.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { x86::with_avx512(task, periodic) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { x86::with_avx2(task, periodic) },
            _ => over(task, Portable, periodic),
        }
    }
}

#[inline(always)]
fn over<T: SimdTask>(task: T, vector: impl PeriodicSimd, periodic: Option<PeriodicBox>) -> T::Result {
    match periodic {
        None => task.run(vector),
        Some(periodic) => task.run(MinimumImage { vector, periodic }),
    }
}

/// Work compiled for each SIMD width. Callees of [`SimdTask::run`] must be `#[inline(always)]` to use its instructions,
/// and must not pass closures to other functions.
pub(crate) trait SimdTask {
    type Result;
    /// Must be `#[inline(always)]`, to have its caller's features.
    fn run<V: SimdWidth>(self, vector: V) -> Self::Result;
}

/// A value proves that the processor supports the width.
pub(crate) trait SimdWidth: Copy {
    const LANES: usize;
    type Query: Copy;
    type SquaredDistances: Copy;

    /// Calls `task` without inlining, for long tasks with several callers. `vector` must have no more features than
    /// `self`.
    fn call<T: SimdTask>(self, task: T, vector: impl SimdWidth) -> T::Result;
    fn query(self, sphere: [f32; 4]) -> Self::Query;
    /// May read padding.
    fn squared_distances(self, columns: &Columns, base: usize, query: Self::Query) -> Self::SquaredDistances;
    /// Returns contacts, and all lanes inside the band.
    fn possible(self, distances: Self::SquaredDistances) -> u32;
    /// Returns certain contacts only.
    fn certain(self, distances: Self::SquaredDistances) -> u32;
    /// Returns possible and certain contacts of `pairs`.
    fn touching(self, rows: &[Xyzr], pairs: &[Pair; MAX_LANES]) -> [u32; 2];
    /// Returns the cell of `center + offset`, clamped to the grid. Monotone along each axis, with equal operations for
    /// every width.
    fn cell(self, axes: &Axes, center: [f32; 3], offset: f64) -> [u32; 4];
    fn add_to_bounds(self, bounds: &mut Bounds, row: [f64; 4]);
    /// Equals [`FrameMap::contains`].
    fn is_in_frame(self, map: &FrameMap<'_>, row: [f64; 4]) -> bool;
    fn map_to_frame<const PERIODIC: bool>(self, map: &FrameMap<'_>, row: [f64; 4]) -> Xyzr;
    /// The last lane has no effect.
    fn squared_displacement<const PERIODIC: bool>(self, now: Xyzr, then: Xyzr, lengths: &[f32; 4]) -> f32;
    /// Appends up to five runs per sphere of one cell, the first starting after it. `spheres` are at most
    /// [`MAX_LANES`].
    fn find_neighbor_runs(
        self,
        columns: &Columns,
        spheres: Range<usize>,
        neighbors: &NeighborRows,
        queue: &mut RunQueue,
    );
    /// Writes pairs of `id` with the selected `lanes`; the rest is arbitrary. Returns their number.
    fn pack(self, id: u32, ids: &[u32; MAX_LANES], lanes: u32, pairs: &mut [Pair; MAX_LANES]) -> usize;
    /// Compacts pairs of selected `lanes`, like [`pack`](Self::pack).
    fn compact(self, pairs: &[Pair; MAX_LANES], lanes: u32, packed: &mut [Pair; MAX_LANES]) -> usize;
}

pub(crate) trait PeriodicSimd: SimdWidth {
    fn minimum_image_touching(
        self,
        rows: &[Xyzr],
        pairs: &[Pair; MAX_LANES],
        periodic: &PeriodicBox,
    ) -> [u32; 2];
    /// Returns [`squared_distances`](SimdWidth::squared_distances) of minimum images with the slack added to the sum of
    /// radii, and subtracted, but not below zero.
    fn minimum_image_distances(
        self,
        columns: &Columns,
        base: usize,
        query: Self::Query,
        periodic: &PeriodicBox,
    ) -> [Self::SquaredDistances; 2];
}

/// The fourth lane fills a vector.
#[derive(Clone, Debug)]
pub(crate) struct Axes {
    pub(crate) per_length: [f64; 4],
    pub(crate) origin: [f64; 4],
    /// Highest cell, at most `i32::MAX`.
    pub(crate) last: [f64; 4],
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::Sphere;

    use super::*;
    use crate::compare::PairTest;

    const AXES: Axes = Axes {
        per_length: [0.7, 0.7, 0.7, 0.0],
        origin: [-30.0, 2.0, 1e6, 0.0],
        last: [90.0, 5.0, 7.0, 0.0],
    };
    const POINTS: [[f32; 3]; 5] = [
        [0.0; 3],
        [-1e-30, 3.0, 1_428_573.0],
        [f32::MAX, f32::MIN, f32::MIN_POSITIVE],
        [20.5, 8.571_428, 1_428_571.5],
        [-42.857_14, 4.285_714, 1_428_580.0],
    ];
    const IDS: [u32; MAX_LANES] = [3, 9, 0, u32::MAX - 2, 7, 8, 1, 2, 40, 30, 20, 10, 11, 12, 13, 6];
    const LANES: [u32; 6] = [0, 1, 0x8000, 0xffff, 0x5a5a, 0x0ff0];

    struct Everything;

    impl SimdTask for Everything {
        type Result = Vec<u32>;

        #[inline(always)]
        fn run<V: SimdWidth>(self, vector: V) -> Vec<u32> {
            let mut all = Vec::new();
            for point in POINTS {
                for offset in [0.0, 1.5, -1.5, 1e10] {
                    all.extend(vector.cell(&AXES, point, offset));
                }
            }
            let rows = [[2.5, -3.0, 0.1, 0.5], [-7e5, 60.0, -1e-9, 3e8], [9.9, 0.0, 4.999, 0.0]];
            for space in [[None; 3], [Some(10.1), None, Some(10.0)]] {
                let space = lazygrid_kernels::Space::periodic(space).expect("a box");
                let mut bounds = Bounds::EMPTY;
                rows.iter().for_each(|&row| vector.add_to_bounds(&mut bounds, row));
                all.extend([bounds.min, bounds.max].as_flattened().iter().map(|&bound| bound as f32 as u32));
                let frame = crate::frame::SearchFrame::new(&bounds, &space);
                let map = FrameMap::new(&frame);
                let mapped = rows.map(|row| match map.is_unbounded() {
                    true => vector.map_to_frame::<false>(&map, row),
                    false => vector.map_to_frame::<true>(&map, row),
                });
                let far = [[1e9, 0.0, 0.0, 1.0], [0.0, f64::NAN, 0.0, 1.0], [0.0, 0.0, 0.0, -1e-300]];
                for row in rows.iter().chain(&far) {
                    assert_eq!(vector.is_in_frame(&map, *row), map.contains(*row), "{row:?}");
                    all.push(vector.is_in_frame(&map, *row).into());
                }
                all.extend(mapped.as_flattened().iter().map(|number| number.to_bits()));
                let [x, y, z] = space.lengths_f32().map(|length| length.unwrap_or(f32::INFINITY));
                let lengths = [x, y, z, f32::INFINITY];
                all.push(vector.squared_displacement::<false>(mapped[0], mapped[2], &lengths).to_bits());
                all.push(vector.squared_displacement::<true>(mapped[0], mapped[2], &lengths).to_bits());
            }
            let mut pairs = [Pair::default(); MAX_LANES];
            for lanes in LANES {
                let count = vector.pack(5, &IDS, lanes, &mut pairs);
                all.extend(pairs[..count].iter().flat_map(|pair| [pair.i, pair.j]));
                let input_pairs = IDS.map(|id| Pair { i: id, j: !id });
                let count = vector.compact(&input_pairs, lanes, &mut pairs);
                all.extend(pairs[..count].iter().flat_map(|pair| [pair.i, pair.j]));
            }
            let mut columns = Columns::default();
            let spheres: Vec<_> =
                (0..40).map(|k| Sphere::new([k as f32, 39.0 - k as f32, 0.3], 0.5)).collect();
            columns.gather(&PairTest::new((&spheres).into(), None), 0..40).expect("there is memory");
            let mut queue = RunQueue::new();
            for count in [1, 2, 15, 16] {
                for (low, high) in [(8.0, 12.0), (f32::NEG_INFINITY, 30.5), (20.0, f32::INFINITY)] {
                    let rows =
                        [[0, 0, 20, 25], [30, 31, 35, 40], [28, 30, 30, 30], [1, 1, 1, 2], [36, 36, 40, 40]];
                    let neighbors = NeighborRows { low: [low; 3], high: [high, high, 0.5], rows };
                    queue.clear();
                    vector.find_neighbor_runs(&columns, 10..10 + count, &neighbors, &mut queue);
                    let found = |k| {
                        let SphereRun { at, run } = queue.get(k);
                        [at, run.start, run.end]
                    };
                    let mut found: Vec<_> = (0..queue.len()).map(found).collect();
                    found.sort_unstable();
                    all.push(queue.len() as u32);
                    all.extend(found.as_flattened().iter().map(|&k| k as u32));
                }
            }
            all
        }
    }

    #[test]
    fn all_widths_agree() {
        let expected = Simd::Portable.run(Everything, None);
        for simd in [Simd::Avx2, Simd::Avx512] {
            assert_eq!(simd.run(Everything, None), expected, "{simd:?}, on {:?}", Simd::detect());
        }
    }

    struct Contacts<'c>(&'c [Xyzr], &'c [[Pair; MAX_LANES]]);

    impl SimdTask for Contacts<'_> {
        type Result = Vec<[u32; 2]>;

        #[inline(always)]
        fn run<V: SimdWidth>(self, vector: V) -> Vec<[u32; 2]> {
            self.1.iter().map(|pairs| vector.touching(self.0, pairs)).collect()
        }
    }

    #[test]
    fn every_width_finds_contacts_and_is_certain_of_contacts_only() {
        let mut random = crate::test_support::Random(9);
        let mut sphere = || {
            let [x, y, z] = random.point(4.0);
            [x, y, z, 0.3 + 0.2 * random.unit()]
        };
        let rows: Vec<Xyzr> = (0..400).map(|_| sphere()).collect();
        let mut at = || (200.0 + 199.9 * random.unit()) as u32;
        let pairs: Vec<[Pair; MAX_LANES]> =
            (0..3000).map(|_| std::array::from_fn(|_| Pair { i: at(), j: at() })).collect();
        for lengths in [[None; 3], [Some(8.0); 3], [Some(8.0), None, Some(9.5)]] {
            let space = lazygrid_kernels::Space::periodic(lengths).expect("a box");
            let touch = |pair: &Pair| {
                let [a, b] = [pair.i, pair.j].map(|at| rows[at as usize].map(f64::from));
                let apart = [0, 1, 2].map(|axis| {
                    let apart = (a[axis] - b[axis]).abs();
                    apart.min((lengths[axis].unwrap_or(f64::INFINITY) - apart).abs())
                });
                apart.iter().map(|d| d * d).sum::<f64>() <= (a[3] + b[3]).powi(2)
            };
            let mut certain_contacts = 0;
            for simd in [Simd::Portable, Simd::Avx2, Simd::Avx512] {
                let found = simd.run(Contacts(&rows, &pairs), PeriodicBox::from_space(&space));
                for (pairs, [possible, certain]) in pairs.iter().zip(found) {
                    for (lane, pair) in pairs.iter().enumerate() {
                        let [possible, certain] = [possible, certain].map(|mask| mask >> lane & 1 == 1);
                        assert!(possible || !touch(pair), "{simd:?} {lengths:?}: {pair:?} is lost");
                        assert!(touch(pair) || !certain, "{simd:?} {lengths:?}: {pair:?} is certain");
                        certain_contacts += u32::from(certain);
                    }
                }
            }
            assert!(certain_contacts > 100);
        }
    }

    #[test]
    fn environment_variable_limits_the_width() {
        let runs = |has, said| Simd::narrower(has, Simd::allowed(said));
        for has in [Simd::Avx512, Simd::Avx2, Simd::Portable] {
            assert_eq!([None, Some("avx512"), Some("sse9")].map(|said| runs(has, said)), [has; 3]);
            assert_eq!(runs(has, Some("portable")), Simd::Portable);
        }
        assert_eq!([Simd::Avx512, Simd::Avx2].map(|has| runs(has, Some("avx2"))), [Simd::Avx2; 2]);
        assert_eq!(runs(Simd::Portable, Some("avx2")), Simd::Portable);
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn width_runs_only_with_all_its_instruction_sets() {
        let without = |hidden: &str| Simd::widest(|feature| feature.name != hidden);
        assert_eq!(without(""), Simd::Avx512);
        assert_eq!(without("avx512f"), Simd::Avx2);
        for name in ["avx2", "fma", "bmi1", "bmi2", "lzcnt", "popcnt"] {
            assert_eq!(without(name), Simd::Portable, "without {name}");
        }
        for feature in x86::Avx2::FEATURES {
            assert_eq!(without(feature.name), Simd::Portable, "without {}", feature.name);
        }
        for feature in x86::Avx512::FEATURES {
            assert_ne!(without(feature.name), Simd::Avx512, "without {}", feature.name);
        }
    }
}
