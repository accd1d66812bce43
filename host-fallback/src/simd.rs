//! One sphere against several: the vector code of every detector.
//!
//! The comparison is a filter in `f32` with an error band around tangency. What lies clear of the band is decided
//! here; what lies inside it is left to the exact test of [`Rule`](crate::contact::Rule). So vector width, fused
//! multiply-adds and the order of operations cannot change a result.

use std::ops::Range;

use lazygrid_kernels::Pair;

use crate::columns::Columns;

/// The most lanes of any vector; columns are padded by this many so that a load at their end stays inside.
pub(crate) const MAX_LANES: usize = 16;

/// Relative half-width of the band left to the exact test. Rounding in `f32` moves `d²` against `(ri + rj)²` by at
/// most 4 ulp, 2⁻²¹; twice that is safe and still leaves one comparison in 10⁶ to the exact test.
const BAND: f32 = 1.0 / (1 << 20) as f32;
/// Absolute half-width of the band: below it products underflow and relative error says nothing.
const FLOOR: f32 = f32::MIN_POSITIVE;

/// The widest vector code this processor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Simd {
    /// 16 lanes, x86-64 with AVX-512F.
    Avx512,
    /// 8 lanes, x86-64 with AVX2 and FMA.
    Avx2,
    /// 8 lanes as plain loops, which the compiler vectorises as the target allows.
    Portable,
}

impl Simd {
    /// Looks at the processor.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx2") {
                return Self::Avx512;
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                return Self::Avx2;
            }
        }
        Self::Portable
    }

    /// Runs `task` with this width, or the portable one where the processor lacks it.
    pub(crate) fn run<T: Task>(self, task: T) -> T::Result {
        match self.min_supported() {
            // SAFETY: `min_supported` returns a width only after seeing its features on this processor.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { x86::with_avx512(task) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { x86::with_avx2(task) },
            _ => task.run(Portable),
        }
    }

    /// Detection is cached by the standard library, so asking again costs a load.
    fn min_supported(self) -> Self {
        match (self, Self::detect()) {
            (Self::Portable, _) | (_, Self::Portable) => Self::Portable,
            (Self::Avx512, Self::Avx512) => Self::Avx512,
            _ => Self::Avx2,
        }
    }
}

/// Work that is compiled once per vector width, with that width's instructions throughout.
///
/// Only what is inlined into [`Task::run`] takes on the instructions: its callees are `#[inline(always)]`, and none
/// of them passes a closure to a function that is not.
pub(crate) trait Task {
    type Result;
    /// Must be `#[inline(always)]`, so that it takes on the features of its caller.
    fn run<V: Vector>(self, vector: V) -> Self::Result;
}

/// A vector width. A value of the type is proof that the processor has it.
pub(crate) trait Vector: Copy {
    /// Spheres per comparison, at most [`MAX_LANES`].
    const LANES: usize;
    /// One sphere in every lane.
    type Query: Copy;
    /// Squared distances and squared sums of radii.
    type Gaps: Copy;

    /// A sphere from its centre and radius.
    fn query(self, sphere: [f32; 4]) -> Self::Query;
    /// Compares with the spheres at `base..base + LANES`, which may reach into the padding.
    fn gaps(self, columns: &Columns, base: usize, query: Self::Query) -> Self::Gaps;
    /// Lanes that may be pairs: all that are, and those inside the band.
    fn possible(self, gaps: Self::Gaps) -> u32;
    /// Lanes that touch without doubt.
    fn certain(self, gaps: Self::Gaps) -> u32;
    /// The cell of the point `center + offset`, cut to the raster. Monotone along each axis, and the same operations
    /// in the same order for every width.
    fn cell(self, axes: &Axes, center: [f32; 3], offset: f64) -> [u32; 4];
    /// On which axes, as bits, the cell of `center - reach` lies before `cell`, and that of `center + reach` behind it.
    fn sides(self, axes: &Axes, center: [f32; 3], reach: f64, cell: [u32; 4]) -> [u32; 2];
    /// Appends those runs whose bits are set in `wanted` and which are not empty once they begin no earlier than the
    /// sphere behind `at`.
    fn append(self, jobs: &mut Jobs, at: u32, starts: &[u32; MAX_LANES], ends: &[u32; MAX_LANES], wanted: u32);
    /// Writes the pairs of sphere `id` with those lanes of `ids` whose bits are set in `lanes` to the front of
    /// `pairs`; what stands behind them is then of no meaning. Returns how many there are.
    fn pack(self, id: u32, ids: &[u32; MAX_LANES], lanes: u32, pairs: &mut [Pair; MAX_LANES]) -> usize;
}

/// From coordinates to cells, for `x`, `y` and `z`; the fourth lane only fills a vector.
#[derive(Clone, Debug)]
pub(crate) struct Axes {
    /// Cells per unit length.
    pub(crate) per_length: [f64; 4],
    /// The cell coordinates of the lowest corner.
    pub(crate) origin: [f64; 4],
    /// The highest cell of each axis, at most `i32::MAX`.
    pub(crate) last: [f64; 4],
}

/// Runs of spheres that are found but not compared yet: sphere `at` against those at `start..end`.
///
/// How many rows a sphere has to look at, and how many of them are empty, no branch predictor can tell. So finding
/// runs is kept apart from comparing: it appends without a branch.
pub(crate) struct Jobs {
    at: [u32; Self::ROOM],
    start: [u32; Self::ROOM],
    end: [u32; Self::ROOM],
    len: usize,
}

impl Jobs {
    /// 6 KiB in all, a small part of the first-level cache.
    const ROOM: usize = 512;
    /// The most before they must be worked off.
    const FULL: usize = Self::ROOM - MAX_LANES;

    pub(crate) fn new() -> Self {
        Self { at: [0; Self::ROOM], start: [0; Self::ROOM], end: [0; Self::ROOM], len: 0 }
    }

    /// Whether there may be no room for the runs of another vector.
    #[inline(always)]
    pub(crate) fn is_full(&self) -> bool {
        self.len >= Self::FULL
    }

    /// Appends one run, if it is wanted and not empty. They must not be full.
    #[inline(always)]
    pub(crate) fn push(&mut self, at: u32, run: Range<u32>, wanted: bool) {
        let len = self.len % Self::ROOM;
        (self.at[len], self.start[len], self.end[len]) = (at, run.start, run.end);
        self.len = len + usize::from(wanted & (run.start < run.end));
    }

    /// The sphere and the run of job `k`.
    #[inline(always)]
    pub(crate) fn get(&self, k: usize) -> (usize, Range<usize>) {
        (self.at[k] as usize, self.start[k] as usize..self.end[k] as usize)
    }

    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }
}

/// Plain loops over eight lanes.
#[derive(Clone, Copy)]
pub(crate) struct Portable;

impl Vector for Portable {
    const LANES: usize = 8;
    type Query = [f32; 4];
    type Gaps = ([f32; 8], [f32; 8]);

    #[inline(always)]
    fn query(self, sphere: [f32; 4]) -> [f32; 4] {
        sphere
    }

    #[inline(always)]
    fn gaps(self, columns: &Columns, base: usize, q: [f32; 4]) -> Self::Gaps {
        let [x, y, z, r] = columns.lanes::<8>(base);
        let (mut d2, mut s2) = ([0.0; 8], [0.0; 8]);
        for k in 0..8 {
            let (dx, dy, dz, s) = (x[k] - q[0], y[k] - q[1], z[k] - q[2], r[k] + q[3]);
            d2[k] = dx * dx + dy * dy + dz * dz;
            s2[k] = s * s;
        }
        (d2, s2)
    }

    #[inline(always)]
    fn possible(self, (d2, s2): Self::Gaps) -> u32 {
        (0..8).fold(0, |mask, k| mask | u32::from(d2[k] <= s2[k] * (1.0 + BAND) + FLOOR) << k)
    }

    #[inline(always)]
    fn certain(self, (d2, s2): Self::Gaps) -> u32 {
        (0..8).fold(0, |mask, k| mask | u32::from(d2[k] < s2[k] * (1.0 - BAND) - FLOOR) << k)
    }

    #[inline(always)]
    fn cell(self, axes: &Axes, center: [f32; 3], offset: f64) -> [u32; 4] {
        let mut cell = [0; 4];
        for axis in 0..3 {
            let at = (f64::from(center[axis]) + offset) * axes.per_length[axis] - axes.origin[axis];
            cell[axis] = at.max(0.0).min(axes.last[axis]) as u32;
        }
        cell
    }

    #[inline(always)]
    fn sides(self, axes: &Axes, center: [f32; 3], reach: f64, cell: [u32; 4]) -> [u32; 2] {
        let (low, high) = (self.cell(axes, center, -reach), self.cell(axes, center, reach));
        let bits = |side: fn(u32, u32) -> bool, at: [u32; 4]| {
            (0..3).fold(0, |bits, axis| bits | u32::from(side(at[axis], cell[axis])) << axis)
        };
        [bits(|a, b| a < b, low), bits(|a, b| a > b, high)]
    }

    #[inline(always)]
    fn append(self, jobs: &mut Jobs, at: u32, starts: &[u32; MAX_LANES], ends: &[u32; MAX_LANES], wanted: u32) {
        append(jobs, at, starts, ends, wanted);
    }

    #[inline(always)]
    fn pack(self, id: u32, ids: &[u32; MAX_LANES], lanes: u32, pairs: &mut [Pair; MAX_LANES]) -> usize {
        pack(id, ids, lanes, pairs)
    }
}

/// Appending run by run; five are the most that anybody wants.
#[inline(always)]
fn append(jobs: &mut Jobs, at: u32, starts: &[u32; MAX_LANES], ends: &[u32; MAX_LANES], wanted: u32) {
    for row in 0..5 {
        jobs.push(at, starts[row].max(at + 1)..ends[row], wanted >> row & 1 != 0);
    }
}

/// Packing lane by lane.
#[inline(always)]
fn pack(id: u32, ids: &[u32; MAX_LANES], lanes: u32, pairs: &mut [Pair; MAX_LANES]) -> usize {
    let (mut open, mut packed) = (lanes, 0);
    while open != 0 {
        pairs[packed % MAX_LANES] = Pair::new(id, ids[open.trailing_zeros() as usize % MAX_LANES]);
        packed += 1;
        open &= open - 1;
    }
    packed
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::{Axes, BAND, Columns, FLOOR, Jobs, MAX_LANES, Pair, Task, Vector};

    /// Proof that AVX-512F is there; made only by [`with_avx512`].
    #[derive(Clone, Copy)]
    pub(crate) struct Avx512(());

    /// Proof that AVX2 and FMA are there; made only by [`with_avx2`].
    #[derive(Clone, Copy)]
    pub(crate) struct Avx2(());

    /// One cell with AVX.
    ///
    /// # Safety
    /// The processor must have AVX2.
    #[inline(always)]
    unsafe fn cell(axes: &Axes, [x, y, z]: [f32; 3], offset: f64) -> [u32; 4] {
        let mut cell = [0; 4];
        // SAFETY: AVX2 by the caller's promise; each array read or written has the vector's size.
        unsafe {
            let at = _mm256_add_pd(_mm256_cvtps_pd(_mm_setr_ps(x, y, z, 0.0)), _mm256_set1_pd(offset));
            let at = _mm256_mul_pd(at, _mm256_loadu_pd(axes.per_length.as_ptr()));
            let at = _mm256_sub_pd(at, _mm256_loadu_pd(axes.origin.as_ptr()));
            let at = _mm256_max_pd(at, _mm256_setzero_pd());
            let at = _mm256_min_pd(at, _mm256_loadu_pd(axes.last.as_ptr()));
            _mm_storeu_si128(cell.as_mut_ptr().cast(), _mm256_cvttpd_epi32(at));
        }
        cell
    }

    /// Both sides with AVX2.
    ///
    /// # Safety
    /// The processor must have AVX2.
    #[inline(always)]
    unsafe fn sides(axes: &Axes, center: [f32; 3], reach: f64, cell: [u32; 4]) -> [u32; 2] {
        // SAFETY: AVX2 by the caller's promise; each array is one vector long. Cells fit an `i32`.
        unsafe {
            let own = _mm_loadu_si128(cell.as_ptr().cast());
            let low = _mm_loadu_si128(self::cell(axes, center, -reach).as_ptr().cast());
            let high = _mm_loadu_si128(self::cell(axes, center, reach).as_ptr().cast());
            let (before, behind) = (_mm_cmpgt_epi32(own, low), _mm_cmpgt_epi32(high, own));
            let bits = [_mm_movemask_ps(_mm_castsi128_ps(before)), _mm_movemask_ps(_mm_castsi128_ps(behind))];
            [bits[0] as u32, bits[1] as u32]
        }
    }

    #[target_feature(enable = "avx512f,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    pub(super) fn with_avx512<T: Task>(task: T) -> T::Result {
        task.run(Avx512(()))
    }

    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    pub(super) fn with_avx2<T: Task>(task: T) -> T::Result {
        task.run(Avx2(()))
    }

    impl Vector for Avx512 {
        const LANES: usize = 16;
        type Query = [__m512; 4];
        type Gaps = (__m512, __m512);

        #[inline(always)]
        fn query(self, [x, y, z, r]: [f32; 4]) -> [__m512; 4] {
            // SAFETY: `self` proves AVX-512F.
            unsafe { [_mm512_set1_ps(x), _mm512_set1_ps(y), _mm512_set1_ps(z), _mm512_set1_ps(r)] }
        }

        #[inline(always)]
        fn gaps(self, columns: &Columns, base: usize, q: [__m512; 4]) -> Self::Gaps {
            let [x, y, z, r] = columns.lanes::<16>(base);
            // SAFETY: `self` proves AVX-512F; each column's sixteen values are a reference's.
            unsafe {
                let dx = _mm512_sub_ps(_mm512_loadu_ps(x.as_ptr()), q[0]);
                let dy = _mm512_sub_ps(_mm512_loadu_ps(y.as_ptr()), q[1]);
                let dz = _mm512_sub_ps(_mm512_loadu_ps(z.as_ptr()), q[2]);
                let s = _mm512_add_ps(_mm512_loadu_ps(r.as_ptr()), q[3]);
                let d2 = _mm512_fmadd_ps(dx, dx, _mm512_fmadd_ps(dy, dy, _mm512_mul_ps(dz, dz)));
                (d2, _mm512_mul_ps(s, s))
            }
        }

        #[inline(always)]
        fn possible(self, (d2, s2): Self::Gaps) -> u32 {
            // SAFETY: `self` proves AVX-512F.
            unsafe {
                let bound = _mm512_fmadd_ps(s2, _mm512_set1_ps(1.0 + BAND), _mm512_set1_ps(FLOOR));
                u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(d2, bound))
            }
        }

        #[inline(always)]
        fn certain(self, (d2, s2): Self::Gaps) -> u32 {
            // SAFETY: `self` proves AVX-512F.
            unsafe {
                let bound = _mm512_fmsub_ps(s2, _mm512_set1_ps(1.0 - BAND), _mm512_set1_ps(FLOOR));
                u32::from(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(d2, bound))
            }
        }

        #[inline(always)]
        fn cell(self, axes: &Axes, center: [f32; 3], offset: f64) -> [u32; 4] {
            // SAFETY: `self` proves AVX2.
            unsafe { cell(axes, center, offset) }
        }

        #[inline(always)]
        fn sides(self, axes: &Axes, center: [f32; 3], reach: f64, cell: [u32; 4]) -> [u32; 2] {
            // SAFETY: `self` proves AVX2.
            unsafe { sides(axes, center, reach, cell) }
        }

        #[inline(always)]
        fn append(
            self,
            jobs: &mut Jobs,
            at: u32,
            starts: &[u32; MAX_LANES],
            ends: &[u32; MAX_LANES],
            wanted: u32,
        ) {
            // SAFETY: `self` proves AVX-512F; `starts` and `ends` are one vector long, and the columns of `jobs` have
            // room for one behind `len`, which the assertion holds below `FULL`.
            unsafe {
                assert!(jobs.len < Jobs::FULL, "jobs are worked off before they are full");
                let starts = _mm512_loadu_si512(starts.as_ptr().cast());
                let starts = _mm512_max_epu32(starts, _mm512_set1_epi32(at as i32 + 1));
                let ends = _mm512_loadu_si512(ends.as_ptr().cast());
                let runs = _mm512_cmplt_epu32_mask(starts, ends) & wanted as __mmask16;
                let len = jobs.len;
                _mm512_storeu_si512(jobs.at.as_mut_ptr().add(len).cast(), _mm512_set1_epi32(at as i32));
                _mm512_storeu_si512(jobs.start.as_mut_ptr().add(len).cast(), _mm512_maskz_compress_epi32(runs, starts));
                _mm512_storeu_si512(jobs.end.as_mut_ptr().add(len).cast(), _mm512_maskz_compress_epi32(runs, ends));
                jobs.len = len + runs.count_ones() as usize;
            }
        }

        #[inline(always)]
        fn pack(self, id: u32, ids: &[u32; MAX_LANES], lanes: u32, pairs: &mut [Pair; MAX_LANES]) -> usize {
            // SAFETY: `self` proves AVX-512F; `ids` is one vector long and `pairs` two.
            unsafe {
                let (id, ids) = (_mm512_set1_epi32(id as i32), _mm512_loadu_si512(ids.as_ptr().cast()));
                let lanes = lanes as __mmask16;
                let small = _mm512_maskz_compress_epi32(lanes, _mm512_min_epu32(id, ids));
                let large = _mm512_maskz_compress_epi32(lanes, _mm512_max_epu32(id, ids));
                let low = _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
                let high = _mm512_add_epi32(low, _mm512_set1_epi32(8));
                let out: *mut __m512i = pairs.as_mut_ptr().cast();
                _mm512_storeu_si512(out, _mm512_permutex2var_epi32(small, low, large));
                _mm512_storeu_si512(out.add(1), _mm512_permutex2var_epi32(small, high, large));
            }
            lanes.count_ones() as usize
        }
    }

    impl Vector for Avx2 {
        const LANES: usize = 8;
        type Query = [__m256; 4];
        type Gaps = (__m256, __m256);

        #[inline(always)]
        fn query(self, [x, y, z, r]: [f32; 4]) -> [__m256; 4] {
            // SAFETY: `self` proves AVX2.
            unsafe { [_mm256_set1_ps(x), _mm256_set1_ps(y), _mm256_set1_ps(z), _mm256_set1_ps(r)] }
        }

        #[inline(always)]
        fn gaps(self, columns: &Columns, base: usize, q: [__m256; 4]) -> Self::Gaps {
            let [x, y, z, r] = columns.lanes::<8>(base);
            // SAFETY: `self` proves AVX2 and FMA; each column's eight values are a reference's.
            unsafe {
                let dx = _mm256_sub_ps(_mm256_loadu_ps(x.as_ptr()), q[0]);
                let dy = _mm256_sub_ps(_mm256_loadu_ps(y.as_ptr()), q[1]);
                let dz = _mm256_sub_ps(_mm256_loadu_ps(z.as_ptr()), q[2]);
                let s = _mm256_add_ps(_mm256_loadu_ps(r.as_ptr()), q[3]);
                let d2 = _mm256_fmadd_ps(dx, dx, _mm256_fmadd_ps(dy, dy, _mm256_mul_ps(dz, dz)));
                (d2, _mm256_mul_ps(s, s))
            }
        }

        #[inline(always)]
        fn possible(self, (d2, s2): Self::Gaps) -> u32 {
            // SAFETY: `self` proves AVX2 and FMA.
            unsafe {
                let bound = _mm256_fmadd_ps(s2, _mm256_set1_ps(1.0 + BAND), _mm256_set1_ps(FLOOR));
                _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(d2, bound)) as u32
            }
        }

        #[inline(always)]
        fn certain(self, (d2, s2): Self::Gaps) -> u32 {
            // SAFETY: `self` proves AVX2 and FMA.
            unsafe {
                let bound = _mm256_fmsub_ps(s2, _mm256_set1_ps(1.0 - BAND), _mm256_set1_ps(FLOOR));
                _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(d2, bound)) as u32
            }
        }

        #[inline(always)]
        fn cell(self, axes: &Axes, center: [f32; 3], offset: f64) -> [u32; 4] {
            // SAFETY: `self` proves AVX2.
            unsafe { cell(axes, center, offset) }
        }

        #[inline(always)]
        fn sides(self, axes: &Axes, center: [f32; 3], reach: f64, cell: [u32; 4]) -> [u32; 2] {
            // SAFETY: `self` proves AVX2.
            unsafe { sides(axes, center, reach, cell) }
        }

        #[inline(always)]
        fn append(
            self,
            jobs: &mut Jobs,
            at: u32,
            starts: &[u32; MAX_LANES],
            ends: &[u32; MAX_LANES],
            wanted: u32,
        ) {
            super::append(jobs, at, starts, ends, wanted);
        }

        #[inline(always)]
        fn pack(self, id: u32, ids: &[u32; MAX_LANES], lanes: u32, pairs: &mut [Pair; MAX_LANES]) -> usize {
            super::pack(id, ids, lanes, pairs)
        }
    }
}
