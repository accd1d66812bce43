//! Operations on one row `x, y, z, r` per vector, which compilers do not find.

use std::arch::x86_64::*;

use bytemuck::cast;

use super::Xyzr;
use crate::frame::{Bounds, FrameMap, MAX_LENGTHS};

/// A load would wait for the stores of a row assembled in memory.
///
/// # Safety
/// The processor must have AVX.
#[inline(always)]
unsafe fn vector([x, y, z, radius]: [f64; 4]) -> __m256d {
    // SAFETY: AVX by the caller's promise.
    unsafe { _mm256_setr_pd(x, y, z, radius) }
}

/// # Safety
/// The processor must have FMA.
#[inline(always)]
pub(super) unsafe fn add_to_bounds(bounds: &mut Bounds, row: [f64; 4]) {
    let Bounds { min, max, zero } = bounds;
    // SAFETY: FMA, hence AVX, by the caller's promise; each array read or written has the vector's size.
    unsafe {
        let row = vector(row);
        // If one operand is NaN, the result is the second operand.
        _mm256_storeu_pd(min.as_mut_ptr(), _mm256_min_pd(row, _mm256_loadu_pd(min.as_ptr())));
        _mm256_storeu_pd(max.as_mut_ptr(), _mm256_max_pd(row, _mm256_loadu_pd(max.as_ptr())));
        let nothing = _mm256_fmadd_pd(row, _mm256_setzero_pd(), _mm256_loadu_pd(zero.as_ptr()));
        _mm256_storeu_pd(zero.as_mut_ptr(), nothing);
    }
}

/// Equals [`FrameMap::contains`].
///
/// # Safety
/// The processor must have AVX.
#[inline(always)]
pub(super) unsafe fn is_in_frame(map: &FrameMap<'_>, row: [f64; 4]) -> bool {
    let [low, high] = &map.limits;
    // SAFETY: AVX by the caller's promise; each array read has the vector's size.
    unsafe {
        let at = _mm256_sub_pd(vector(row), _mm256_loadu_pd(map.origin.as_ptr()));
        let is_above = _mm256_cmp_pd::<_CMP_GE_OQ>(at, _mm256_loadu_pd(low.as_ptr()));
        let is_below = _mm256_cmp_pd::<_CMP_LE_OQ>(at, _mm256_loadu_pd(high.as_ptr()));
        _mm256_movemask_pd(_mm256_and_pd(is_above, is_below)) == 0b1111
    }
}

/// Maps a sphere with the operations of [`FrameMap::map`], in the same order.
///
/// # Safety
/// The processor must have AVX.
#[inline(always)]
pub(super) unsafe fn map_to_frame<const PERIODIC: bool>(map: &FrameMap<'_>, row: [f64; 4]) -> Xyzr {
    if PERIODIC && let Some(cell) = map.cell {
        return map.map_to_cell(cell, row);
    }
    let [factor, summand] = &map.growth;
    let mut searched = [0.0; 4];
    // SAFETY: AVX by the caller's promise; each array read or written has the vector's size.
    unsafe {
        let mut at = _mm256_sub_pd(vector(row), _mm256_loadu_pd(map.origin.as_ptr()));
        if PERIODIC {
            let (sign, length) = (_mm256_set1_pd(-0.0), _mm256_loadu_pd(map.lengths.as_ptr()));
            let away = _mm256_andnot_pd(sign, at);
            let is_far =
                _mm256_cmp_pd::<_CMP_NLE_UQ>(away, _mm256_mul_pd(_mm256_set1_pd(MAX_LENGTHS), length));
            if _mm256_testz_pd(is_far, is_far) == 0 {
                return cast(map.frame.sphere(row));
            }
            let is_outside = _mm256_cmp_pd::<_CMP_GT_OQ>(away, _mm256_mul_pd(_mm256_set1_pd(0.5), length));
            let shift = _mm256_or_pd(length, _mm256_and_pd(sign, at));
            at = _mm256_sub_pd(at, _mm256_and_pd(is_outside, shift));
        }
        let at = _mm256_min_pd(at, _mm256_loadu_pd(map.limit.as_ptr()));
        let at = _mm256_mul_pd(at, _mm256_loadu_pd(factor.as_ptr()));
        let at = _mm256_add_pd(at, _mm256_loadu_pd(summand.as_ptr()));
        let mut sphere = _mm256_cvtpd_ps(at);
        if PERIODIC {
            let half = _mm_loadu_ps(map.half.as_ptr());
            sphere = _mm_max_ps(_mm_xor_ps(half, _mm_set1_ps(-0.0)), sphere);
            sphere = _mm_min_ps(half, sphere);
        }
        let next = _mm_add_epi32(_mm_castps_si128(sphere), _mm_setr_epi32(0, 0, 0, 1));
        _mm_storeu_ps(searched.as_mut_ptr(), _mm_castsi128_ps(next));
    }
    searched
}

/// Uses the operations of the scalar code.
///
/// # Safety
/// The processor must have SSE3.
#[inline(always)]
pub(super) unsafe fn squared_displacement<const PERIODIC: bool>(
    now: Xyzr,
    then: Xyzr,
    lengths: &[f32; 4],
) -> f32 {
    // SAFETY: SSE3 by the caller's promise; each array read has the vector's size.
    unsafe {
        let mut apart = _mm_sub_ps(_mm_loadu_ps(now.as_ptr()), _mm_loadu_ps(then.as_ptr()));
        if PERIODIC {
            let sign = _mm_set1_ps(-0.0);
            apart = _mm_andnot_ps(sign, apart);
            let other = _mm_andnot_ps(sign, _mm_sub_ps(_mm_loadu_ps(lengths.as_ptr()), apart));
            // If one operand is NaN, the minimum is the second operand.
            apart = _mm_min_ps(other, apart);
        }
        let squares = _mm_mul_ps(apart, apart);
        let sum = _mm_add_ss(squares, _mm_movehdup_ps(squares));
        _mm_cvtss_f32(_mm_add_ss(sum, _mm_movehl_ps(squares, squares)))
    }
}
