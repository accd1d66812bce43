//! Measures displacements of the spheres of a call and copies them in the order of the candidates.

use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

use super::CallSpheres;
use crate::Simd;
use crate::cell_list::SortRecord;
use crate::compare::{EffectiveLoop, EffectiveRows, PairTest, SimdTask, SimdWidth, Xyzr};
use crate::executor::Executor;
use crate::frame::{Bounds, FrameMap};
use crate::input::{InputLoop, InputRows, InputSpheres};

pub(super) const CHUNK_SPHERES: usize = 1 << 13;
/// Number of spheres that are prefetched ahead, because they may lie anywhere in memory.
const PREFETCH_SPHERES: usize = 128;

/// Copies the spheres to their positions in `rows`. `then` has each center at the build and, as its radius, the inverse
/// square of its displacement limit. Returns the largest used fraction of a limit (infinity for an invalid sphere), and
/// `true` if an effective radius has changed or the frame no longer fits.
pub(super) fn advance(
    CallSpheres { test, input, .. }: CallSpheres<'_>,
    then: &[SortRecord],
    rows: &mut [Xyzr],
    simd: Simd,
    executor: Executor,
) -> (f32, bool) {
    let (farthest, has_changed_radius) = (AtomicU32::new(0), AtomicBool::new(false));
    let all_bounds = Mutex::new(Bounds::EMPTY);
    executor.for_each_chunk(rows, CHUNK_SPHERES, |chunk, rows| {
        let then = &then[chunk * CHUNK_SPHERES..][..rows.len()];
        let largest = simd.run(Advance { test, input, then, rows }, None);
        // The bits of non-negative numbers are ordered like the numbers.
        farthest.fetch_max(largest.fraction_squared().to_bits(), Relaxed);
        has_changed_radius.fetch_or(largest.differing[3] != 0, Relaxed);
        if input.is_some() {
            let mut all = all_bounds.lock().unwrap_or_else(PoisonError::into_inner);
            *all = all.merge(largest.bounds);
        }
    });
    let bounds = all_bounds.into_inner().unwrap_or_else(PoisonError::into_inner);
    let is_in_frame = input.is_none_or(|input| input.frame_holds(&bounds));
    (f32::from_bits(farthest.into_inner()).sqrt(), has_changed_radius.into_inner() || !is_in_frame)
}

struct Advance<'a> {
    test: &'a PairTest<'a>,
    input: Option<InputSpheres<'a>>,
    then: &'a [SortRecord],
    rows: &'a mut [Xyzr],
}

impl<'a> SimdTask for Advance<'a> {
    type Result = AdvanceMaxima;

    #[inline(always)]
    fn run<V: SimdWidth>(self, vector: V) -> AdvanceMaxima {
        let largest = AdvanceMaxima::new(self.test);
        match self.input {
            Some(input) => input.run(vector, AdvanceInput { rows: self.rows, then: self.then, largest }),
            None if self.test.space().is_periodic() => self.advance::<V, true>(vector, largest),
            None => self.advance::<V, false>(vector, largest),
        }
    }
}

impl Advance<'_> {
    #[inline(always)]
    fn advance<V: SimdWidth, const PERIODIC: bool>(self, vector: V, largest: AdvanceMaxima) -> AdvanceMaxima {
        let Self { test, then, rows, .. } = self;
        test.for_rows(AdvanceEffective::<V, PERIODIC> { vector, rows, then, largest })
    }
}

struct AdvanceEffective<'a, V, const PERIODIC: bool> {
    vector: V,
    rows: &'a mut [Xyzr],
    then: &'a [SortRecord],
    largest: AdvanceMaxima,
}

impl<V: SimdWidth, const PERIODIC: bool> EffectiveLoop for AdvanceEffective<'_, V, PERIODIC> {
    type Result = AdvanceMaxima;

    #[inline(always)]
    fn run(self, now: impl EffectiveRows) -> AdvanceMaxima {
        let Self { vector, rows, then, mut largest } = self;
        for (k, row) in rows.iter_mut().enumerate() {
            now.prefetch(then.get(k + PREFETCH_SPHERES).unwrap_or(&then[k]).id as usize);
            largest.add::<V, PERIODIC>(vector, row, &then[k], now.row(then[k].id as usize));
        }
        largest
    }
}

struct AdvanceInput<'a> {
    then: &'a [SortRecord],
    rows: &'a mut [Xyzr],
    largest: AdvanceMaxima,
}

impl InputLoop for AdvanceInput<'_> {
    type Result = AdvanceMaxima;

    #[inline(always)]
    fn run<V: SimdWidth, const PERIODIC: bool>(
        self,
        vector: V,
        input: impl InputRows,
        map: &FrameMap<'_>,
    ) -> AdvanceMaxima {
        let Self { then, rows, mut largest } = self;
        for (k, row) in rows.iter_mut().enumerate() {
            input.prefetch(then.get(k + PREFETCH_SPHERES).unwrap_or(&then[k]).id as usize);
            let id = then[k].id as usize;
            let numbers = input.get(id);
            if !vector.is_in_frame(map, numbers) {
                vector.add_to_bounds(&mut largest.bounds, numbers);
            }
            let now = vector.map_to_frame::<PERIODIC>(map, input.effective(id, numbers));
            largest.add::<V, PERIODIC>(vector, row, &then[k], now);
        }
        largest.is_refused = !largest.bounds.are_valid();
        largest
    }
}

struct AdvanceMaxima {
    lengths: [f32; 4],
    /// Bits of the squared largest used fraction. Infinity and NaN have the largest bits.
    fraction: u32,
    differing: [u32; 4],
    is_refused: bool,
    bounds: Bounds,
}

impl AdvanceMaxima {
    #[inline(always)]
    fn new(test: &PairTest<'_>) -> Self {
        let [x, y, z] = test.lengths().map(|length| length.unwrap_or(f32::INFINITY));
        let lengths = [x, y, z, f32::INFINITY];
        Self { lengths, fraction: 0, differing: [0; 4], is_refused: false, bounds: Bounds::EMPTY }
    }

    fn fraction_squared(&self) -> f32 {
        let fraction = f32::from_bits(self.fraction);
        if self.is_refused || !fraction.is_finite() { f32::INFINITY } else { fraction }
    }

    #[inline(always)]
    fn add<V: SimdWidth, const PERIODIC: bool>(
        &mut self,
        vector: V,
        row: &mut Xyzr,
        then: &SortRecord,
        now: Xyzr,
    ) {
        let squared = vector.squared_displacement::<PERIODIC>(now, then.row, &self.lengths);
        self.fraction = self.fraction.max((squared * then.row[3]).to_bits());
        for component in 0..4 {
            self.differing[component] |= now[component].to_bits() ^ row[component].to_bits();
        }
        *row = now;
    }
}
