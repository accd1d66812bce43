//! One sphere against several: the vector code of every detector.
//!
//! The comparison is a filter in `f32` with an error band around tangency. What lies clear of the band is decided
//! here; what lies inside it is left to the exact test of [`Rule`](crate::contact::Rule). So vector width, fused
//! multiply-adds and the order of operations cannot change a result.

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
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::{BAND, Columns, FLOOR, Task, Vector};

    /// Proof that AVX-512F is there; made only by [`with_avx512`].
    #[derive(Clone, Copy)]
    pub(crate) struct Avx512(());

    /// Proof that AVX2 and FMA are there; made only by [`with_avx2`].
    #[derive(Clone, Copy)]
    pub(crate) struct Avx2(());

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
    }
}
