use std::arch::x86_64::*;

use lazygrid_kernels::Pair;

use super::{BAND, FLOOR, MAX_LANES, PeriodicBox, Xyzr};

/// Tests four pairs at a time, one vector each until coordinates are transposed.
///
/// # Safety
/// The processor must have FMA.
#[inline(always)]
pub(super) unsafe fn touching(rows: &[Xyzr], pairs: &[Pair; MAX_LANES]) -> [u32; 2] {
    let last = pairs.iter().fold(0, |last, pair| last.max(pair.i).max(pair.j));
    assert!((last as usize) < rows.len(), "every position has a row");
    let mut masks = [0; 2];
    for (k, four) in pairs.chunks_exact(4).enumerate() {
        // SAFETY: FMA, hence SSE, by the caller's promise; no position is above the last, which has a row.
        unsafe {
            let negative = _mm_setr_ps(0.0, 0.0, 0.0, -0.0);
            let squares = |pair: &Pair| {
                let [a, b] = [pair.i, pair.j].map(|at| rows.get_unchecked(at as usize));
                let other = _mm_xor_ps(_mm_loadu_ps(b.as_ptr()), negative);
                let gap = _mm_sub_ps(_mm_loadu_ps(a.as_ptr()), other);
                _mm_mul_ps(gap, gap)
            };
            let [a, b, c, d] = [squares(&four[0]), squares(&four[1]), squares(&four[2]), squares(&four[3])];
            let (xy, zs) = (_mm_unpacklo_ps(a, b), _mm_unpackhi_ps(a, b));
            let (other_xy, other_zs) = (_mm_unpacklo_ps(c, d), _mm_unpackhi_ps(c, d));
            let (x2, y2) = (_mm_movelh_ps(xy, other_xy), _mm_movehl_ps(other_xy, xy));
            let (z2, s2) = (_mm_movelh_ps(zs, other_zs), _mm_movehl_ps(other_zs, zs));
            let d2 = _mm_add_ps(_mm_add_ps(x2, y2), z2);
            let most = _mm_fmadd_ps(s2, _mm_set1_ps(1.0 + BAND), _mm_set1_ps(FLOOR));
            let least = _mm_fmsub_ps(s2, _mm_set1_ps(1.0 - BAND), _mm_set1_ps(FLOOR));
            masks[0] |= (_mm_movemask_ps(_mm_cmple_ps(d2, most)) as u32) << (4 * k);
            masks[1] |= (_mm_movemask_ps(_mm_cmplt_ps(d2, least)) as u32) << (4 * k);
        }
    }
    masks
}

/// Tests minimum images, like [`touching`].
///
/// # Safety
/// The processor must have FMA.
#[inline(always)]
pub(super) unsafe fn minimum_image_touching(
    rows: &[Xyzr],
    pairs: &[Pair; MAX_LANES],
    periodic: &PeriodicBox,
) -> [u32; 2] {
    let last = pairs.iter().fold(0, |last, pair| last.max(pair.i).max(pair.j));
    assert!((last as usize) < rows.len(), "every position has a row");
    let mut masks = [0; 2];
    for (k, four) in pairs.chunks_exact(4).enumerate() {
        // SAFETY: FMA, hence SSE, by the caller's promise; no position is above the last, which has a row.
        unsafe {
            let negative = _mm_setr_ps(0.0, 0.0, 0.0, -0.0);
            let [x, y, z] = periodic.lengths;
            let lengths = _mm_setr_ps(x, y, z, f32::INFINITY);
            let apart = |pair: &Pair| {
                let [a, b] = [pair.i, pair.j].map(|at| rows.get_unchecked(at as usize));
                let other = _mm_xor_ps(_mm_loadu_ps(b.as_ptr()), negative);
                let apart = _mm_andnot_ps(_mm_set1_ps(-0.0), _mm_sub_ps(_mm_loadu_ps(a.as_ptr()), other));
                _mm_min_ps(_mm_sub_ps(lengths, apart), apart)
            };
            let [a, b, c, d] = [apart(&four[0]), apart(&four[1]), apart(&four[2]), apart(&four[3])];
            let (xy, zs) = (_mm_unpacklo_ps(a, b), _mm_unpackhi_ps(a, b));
            let (other_xy, other_zs) = (_mm_unpacklo_ps(c, d), _mm_unpackhi_ps(c, d));
            let (x, y) = (_mm_movelh_ps(xy, other_xy), _mm_movehl_ps(other_xy, xy));
            let (z, s) = (_mm_movelh_ps(zs, other_zs), _mm_movehl_ps(other_zs, zs));
            let d2 = _mm_fmadd_ps(x, x, _mm_fmadd_ps(y, y, _mm_mul_ps(z, z)));
            let slack = _mm_set1_ps(periodic.slack);
            let wide = _mm_add_ps(s, slack);
            let narrow = _mm_max_ps(_mm_sub_ps(s, slack), _mm_setzero_ps());
            let (wide, narrow) = (_mm_mul_ps(wide, wide), _mm_mul_ps(narrow, narrow));
            let most = _mm_fmadd_ps(wide, _mm_set1_ps(1.0 + BAND), _mm_set1_ps(FLOOR));
            let least = _mm_fmsub_ps(narrow, _mm_set1_ps(1.0 - BAND), _mm_set1_ps(FLOOR));
            masks[0] |= (_mm_movemask_ps(_mm_cmple_ps(d2, most)) as u32) << (4 * k);
            masks[1] |= (_mm_movemask_ps(_mm_cmplt_ps(d2, least)) as u32) << (4 * k);
        }
    }
    masks
}
