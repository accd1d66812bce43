use std::arch::x86_64::*;
use std::ops::Range;

use lazygrid_kernels::Pair;

use super::super::columns::Columns;
use super::{
    Axes, BAND, FLOOR, Feature, MAX_LANES, NeighborRows, PeriodicBox, PeriodicSimd, RunQueue, SimdTask,
    SimdWidth, Xyzr, over, portable, x86_pairs, x86_rows,
};
use crate::frame::{Bounds, FrameMap};

/// Defines a width from one list of instruction sets, including those that `rustc` enables implicitly.
macro_rules! width {
    ($(#[$doc:meta])* $name:ident, $run:ident, $call:ident: $($feature:tt)+) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(crate) struct $name(());

        impl $name {
            pub(super) const FEATURES: &[Feature] =
                &[$(Feature { name: $feature, is_detected: || is_x86_feature_detected!($feature) }),+];
        }

        #[target_feature($(enable = $feature),+)]
        pub(super) fn $run<T: SimdTask>(task: T, periodic: Option<PeriodicBox>) -> T::Result {
            over(task, $name(()), periodic)
        }

        #[target_feature($(enable = $feature),+)]
        #[inline(never)]
        fn $call<T: SimdTask>(task: T, vector: impl SimdWidth) -> T::Result {
            task.run(vector)
        }
    };
}

width! {
    /// Proof of the features of [`with_avx512`], its only constructor.
    Avx512, with_avx512, call_avx512:
    "sse3" "ssse3" "sse4.1" "sse4.2" "popcnt" "avx" "f16c" "fma" "avx2" "bmi1" "bmi2" "lzcnt" "avx512f"
}

width! {
    /// Proof of the features of [`with_avx2`], its only constructor.
    Avx2, with_avx2, call_avx2:
    "sse3" "ssse3" "sse4.1" "sse4.2" "popcnt" "avx" "fma" "avx2" "bmi1" "bmi2" "lzcnt"
}

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

/// Methods that need only AVX2 and FMA.
macro_rules! methods_of_avx2 {
    () => {
        #[inline(always)]
        fn touching(self, rows: &[Xyzr], pairs: &[Pair; MAX_LANES]) -> [u32; 2] {
            // SAFETY: `self` proves FMA.
            unsafe { x86_pairs::touching(rows, pairs) }
        }

        #[inline(always)]
        fn cell(self, axes: &Axes, center: [f32; 3], offset: f64) -> [u32; 4] {
            // SAFETY: `self` proves AVX2.
            unsafe { cell(axes, center, offset) }
        }

        #[inline(always)]
        fn add_to_bounds(self, bounds: &mut Bounds, row: [f64; 4]) {
            // SAFETY: `self` proves FMA.
            unsafe { x86_rows::add_to_bounds(bounds, row) }
        }

        #[inline(always)]
        fn is_in_frame(self, map: &FrameMap<'_>, row: [f64; 4]) -> bool {
            // SAFETY: `self` proves AVX2.
            unsafe { x86_rows::is_in_frame(map, row) }
        }

        #[inline(always)]
        fn map_to_frame<const PERIODIC: bool>(self, map: &FrameMap<'_>, row: [f64; 4]) -> Xyzr {
            // SAFETY: `self` proves AVX2.
            unsafe { x86_rows::map_to_frame::<PERIODIC>(map, row) }
        }

        #[inline(always)]
        fn squared_displacement<const PERIODIC: bool>(
            self,
            now: Xyzr,
            then: Xyzr,
            lengths: &[f32; 4],
        ) -> f32 {
            // SAFETY: `self` proves AVX2, hence SSE3.
            unsafe { x86_rows::squared_displacement::<PERIODIC>(now, then, lengths) }
        }
    };
}

impl SimdWidth for Avx512 {
    const LANES: usize = 16;
    type Query = [__m512; 4];
    type SquaredDistances = (__m512, __m512);

    #[inline(always)]
    fn call<T: SimdTask>(self, task: T, vector: impl SimdWidth) -> T::Result {
        // SAFETY: `self` proves the features of `call_avx512`, which are those of `with_avx512`.
        unsafe { call_avx512(task, vector) }
    }

    #[inline(always)]
    fn query(self, [x, y, z, r]: [f32; 4]) -> [__m512; 4] {
        // SAFETY: `self` proves AVX-512F.
        unsafe { [_mm512_set1_ps(x), _mm512_set1_ps(y), _mm512_set1_ps(z), _mm512_set1_ps(r)] }
    }

    #[inline(always)]
    fn squared_distances(self, columns: &Columns, base: usize, q: [__m512; 4]) -> Self::SquaredDistances {
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
    fn possible(self, (d2, s2): Self::SquaredDistances) -> u32 {
        // SAFETY: `self` proves AVX-512F.
        unsafe {
            let bound = _mm512_fmadd_ps(s2, _mm512_set1_ps(1.0 + BAND), _mm512_set1_ps(FLOOR));
            u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(d2, bound))
        }
    }

    #[inline(always)]
    fn certain(self, (d2, s2): Self::SquaredDistances) -> u32 {
        // SAFETY: `self` proves AVX-512F.
        unsafe {
            let bound = _mm512_fmsub_ps(s2, _mm512_set1_ps(1.0 - BAND), _mm512_set1_ps(FLOOR));
            u32::from(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(d2, bound))
        }
    }

    methods_of_avx2!();

    #[inline(always)]
    fn find_neighbor_runs(
        self,
        columns: &Columns,
        spheres: Range<usize>,
        neighbors: &NeighborRows,
        queue: &mut RunQueue,
    ) {
        let (at, count) = (spheres.start, spheres.end - spheres.start);
        assert!(!queue.is_full() && count <= MAX_LANES, "the queue has capacity for the runs of a vector");
        let [x, y, z, r] = columns.lanes::<16>(at);
        let NeighborRows { low, high, rows } = neighbors;
        // SAFETY: `self` proves AVX-512F. Each array read is one vector long. `len` starts below `FULL` and grows by at
        // most sixteen for each of five rows, so every vector is inside the arrays of `queue`.
        unsafe {
            let [x, y] = [_mm512_loadu_ps(x.as_ptr()), _mm512_loadu_ps(y.as_ptr())];
            let [z, r] = [_mm512_loadu_ps(z.as_ptr()), _mm512_loadu_ps(r.as_ptr())];
            let lower_x = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(_mm512_sub_ps(x, r), _mm512_set1_ps(low[0]));
            let lower_y = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(_mm512_sub_ps(y, r), _mm512_set1_ps(low[1]));
            let higher_x = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(_mm512_add_ps(x, r), _mm512_set1_ps(high[0]));
            let higher_y = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(_mm512_add_ps(y, r), _mm512_set1_ps(high[1]));
            let higher_z = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(_mm512_add_ps(z, r), _mm512_set1_ps(high[2]));
            let live = (u32::MAX >> (32 - count)) as __mmask16;
            let wanted = [live, higher_y, higher_z & lower_y, higher_z, higher_z & higher_y];

            let lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
            let ats = _mm512_add_epi32(_mm512_set1_epi32(at as i32), lanes);
            let own = _mm512_add_epi32(ats, _mm512_set1_epi32(1));
            let mut len = queue.len;
            for (row, &[lower, same, higher, end]) in rows.iter().enumerate() {
                let (lower, same) = (_mm512_set1_epi32(lower as i32), _mm512_set1_epi32(same as i32));
                let (higher, end) = (_mm512_set1_epi32(higher as i32), _mm512_set1_epi32(end as i32));
                let starts = match row {
                    0 => own,
                    _ => _mm512_mask_blend_epi32(lower_x, same, lower),
                };
                let ends = _mm512_mask_blend_epi32(higher_x, higher, end);
                let runs = _mm512_cmplt_epu32_mask(starts, ends) & wanted[row] & live;
                let (to_at, to_start) = (queue.at.as_mut_ptr().add(len), queue.start.as_mut_ptr().add(len));
                let to_end = queue.end.as_mut_ptr().add(len);
                _mm512_storeu_si512(to_at.cast(), _mm512_maskz_compress_epi32(runs, ats));
                _mm512_storeu_si512(to_start.cast(), _mm512_maskz_compress_epi32(runs, starts));
                _mm512_storeu_si512(to_end.cast(), _mm512_maskz_compress_epi32(runs, ends));
                len += runs.count_ones() as usize;
            }
            queue.len = len;
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

    #[inline(always)]
    fn compact(self, pairs: &[Pair; MAX_LANES], lanes: u32, packed: &mut [Pair; MAX_LANES]) -> usize {
        let [low, high] = [lanes as __mmask8, (lanes >> 8) as __mmask8];
        // SAFETY: `self` proves AVX-512F; both arrays are two vectors of eight pairs long, and the second store begins
        // after at most eight pairs.
        unsafe {
            let (from, to): (*const __m512i, *mut Pair) = (pairs.as_ptr().cast(), packed.as_mut_ptr());
            _mm512_storeu_si512(to.cast(), _mm512_maskz_compress_epi64(low, _mm512_loadu_si512(from)));
            let upper = _mm512_maskz_compress_epi64(high, _mm512_loadu_si512(from.add(1)));
            _mm512_storeu_si512(to.add(low.count_ones() as usize).cast(), upper);
        }
        lanes.count_ones() as usize
    }
}

impl SimdWidth for Avx2 {
    const LANES: usize = 8;
    type Query = [__m256; 4];
    type SquaredDistances = (__m256, __m256);

    #[inline(always)]
    fn call<T: SimdTask>(self, task: T, vector: impl SimdWidth) -> T::Result {
        // SAFETY: `self` proves the features of `call_avx2`, which are those of `with_avx2`.
        unsafe { call_avx2(task, vector) }
    }

    #[inline(always)]
    fn query(self, [x, y, z, r]: [f32; 4]) -> [__m256; 4] {
        // SAFETY: `self` proves AVX2.
        unsafe { [_mm256_set1_ps(x), _mm256_set1_ps(y), _mm256_set1_ps(z), _mm256_set1_ps(r)] }
    }

    #[inline(always)]
    fn squared_distances(self, columns: &Columns, base: usize, q: [__m256; 4]) -> Self::SquaredDistances {
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
    fn possible(self, (d2, s2): Self::SquaredDistances) -> u32 {
        // SAFETY: `self` proves AVX2 and FMA.
        unsafe {
            let bound = _mm256_fmadd_ps(s2, _mm256_set1_ps(1.0 + BAND), _mm256_set1_ps(FLOOR));
            _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(d2, bound)) as u32
        }
    }

    #[inline(always)]
    fn certain(self, (d2, s2): Self::SquaredDistances) -> u32 {
        // SAFETY: `self` proves AVX2 and FMA.
        unsafe {
            let bound = _mm256_fmsub_ps(s2, _mm256_set1_ps(1.0 - BAND), _mm256_set1_ps(FLOOR));
            _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(d2, bound)) as u32
        }
    }

    methods_of_avx2!();

    #[inline(always)]
    fn find_neighbor_runs(
        self,
        columns: &Columns,
        spheres: Range<usize>,
        neighbors: &NeighborRows,
        queue: &mut RunQueue,
    ) {
        portable::find_neighbor_runs(columns, spheres, neighbors, queue);
    }

    #[inline(always)]
    fn pack(self, id: u32, ids: &[u32; MAX_LANES], lanes: u32, pairs: &mut [Pair; MAX_LANES]) -> usize {
        portable::pack(id, ids, lanes, pairs)
    }

    #[inline(always)]
    fn compact(self, pairs: &[Pair; MAX_LANES], lanes: u32, packed: &mut [Pair; MAX_LANES]) -> usize {
        portable::compact(pairs, lanes, packed)
    }
}

impl PeriodicSimd for Avx512 {
    #[inline(always)]
    fn minimum_image_touching(
        self,
        rows: &[Xyzr],
        pairs: &[Pair; MAX_LANES],
        periodic: &PeriodicBox,
    ) -> [u32; 2] {
        // SAFETY: `self` proves FMA.
        unsafe { x86_pairs::minimum_image_touching(rows, pairs, periodic) }
    }

    #[inline(always)]
    fn minimum_image_distances(
        self,
        columns: &Columns,
        base: usize,
        q: Self::Query,
        periodic: &PeriodicBox,
    ) -> [Self::SquaredDistances; 2] {
        let [x, y, z, r] = columns.lanes::<16>(base);
        // SAFETY: `self` proves AVX-512F; each column's sixteen values are a reference's.
        unsafe {
            let nearest = |column: &[f32; 16], own, length| {
                let a = _mm512_sub_ps(_mm512_loadu_ps(column.as_ptr()), own);
                let apart = _mm512_abs_ps(a);
                _mm512_min_ps(_mm512_sub_ps(_mm512_set1_ps(length), apart), apart)
            };
            let [dx, dy] = [nearest(x, q[0], periodic.lengths[0]), nearest(y, q[1], periodic.lengths[1])];
            let dz = nearest(z, q[2], periodic.lengths[2]);
            let d2 = _mm512_fmadd_ps(dx, dx, _mm512_fmadd_ps(dy, dy, _mm512_mul_ps(dz, dz)));
            let s = _mm512_add_ps(_mm512_loadu_ps(r.as_ptr()), q[3]);
            let slack = _mm512_set1_ps(periodic.slack);
            let wide = _mm512_add_ps(s, slack);
            let narrow = _mm512_max_ps(_mm512_sub_ps(s, slack), _mm512_setzero_ps());
            [(d2, _mm512_mul_ps(wide, wide)), (d2, _mm512_mul_ps(narrow, narrow))]
        }
    }
}

impl PeriodicSimd for Avx2 {
    #[inline(always)]
    fn minimum_image_touching(
        self,
        rows: &[Xyzr],
        pairs: &[Pair; MAX_LANES],
        periodic: &PeriodicBox,
    ) -> [u32; 2] {
        // SAFETY: `self` proves FMA.
        unsafe { x86_pairs::minimum_image_touching(rows, pairs, periodic) }
    }

    #[inline(always)]
    fn minimum_image_distances(
        self,
        columns: &Columns,
        base: usize,
        q: Self::Query,
        periodic: &PeriodicBox,
    ) -> [Self::SquaredDistances; 2] {
        let [x, y, z, r] = columns.lanes::<8>(base);
        // SAFETY: `self` proves AVX2 and FMA; each column's eight values are a reference's.
        unsafe {
            let nearest = |column: &[f32; 8], own, length| {
                let a = _mm256_sub_ps(_mm256_loadu_ps(column.as_ptr()), own);
                let apart = _mm256_andnot_ps(_mm256_set1_ps(-0.0), a);
                _mm256_min_ps(_mm256_sub_ps(_mm256_set1_ps(length), apart), apart)
            };
            let [dx, dy] = [nearest(x, q[0], periodic.lengths[0]), nearest(y, q[1], periodic.lengths[1])];
            let dz = nearest(z, q[2], periodic.lengths[2]);
            let d2 = _mm256_fmadd_ps(dx, dx, _mm256_fmadd_ps(dy, dy, _mm256_mul_ps(dz, dz)));
            let s = _mm256_add_ps(_mm256_loadu_ps(r.as_ptr()), q[3]);
            let slack = _mm256_set1_ps(periodic.slack);
            let wide = _mm256_add_ps(s, slack);
            let narrow = _mm256_max_ps(_mm256_sub_ps(s, slack), _mm256_setzero_ps());
            [(d2, _mm256_mul_ps(wide, wide)), (d2, _mm256_mul_ps(narrow, narrow))]
        }
    }
}
