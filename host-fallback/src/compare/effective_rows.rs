use lazygrid_kernels::{SpeciesRadius, Sphere};

use super::{PairTest, Xyzr};
use crate::memory::{prefetch, prefetch_address};

pub(crate) trait EffectiveRows: Copy {
    fn prefetch(self, k: usize);
    fn get(self, k: usize) -> Xyzr;
    fn effective(self, k: usize, radius: f32) -> f32;

    #[inline(always)]
    fn row(self, k: usize) -> Xyzr {
        let [x, y, z, radius] = self.get(k);
        [x, y, z, self.effective(k, radius)]
    }
}

/// Callees are `#[inline(always)]`, as in a [`SimdTask`](super::SimdTask).
pub(crate) trait EffectiveLoop {
    type Result;
    /// Must be `#[inline(always)]`.
    fn run(self, rows: impl EffectiveRows) -> Self::Result;
}

impl PairTest<'_> {
    #[inline(always)]
    pub(crate) fn for_rows<L: EffectiveLoop>(&self, task: L) -> L::Result {
        let (rows, columns) = (self.spheres().as_rows(), self.spheres().as_columns());
        match (rows, columns, self.species_radii()) {
            _ if self.has_margin() => task.run(self),
            (Some(rows), _, None) => task.run(rows),
            (Some(rows), _, Some((ids, species_radii))) => task.run((rows, ids, species_radii)),
            (None, Some(columns), None) => task.run(columns),
            (None, Some(columns), Some((ids, species_radii))) => task.run((columns, ids, species_radii)),
            (None, None, _) => task.run(self),
        }
    }
}

impl EffectiveRows for &[Sphere] {
    #[inline(always)]
    fn prefetch(self, k: usize) {
        prefetch(self, k);
    }

    #[inline(always)]
    fn get(self, k: usize) -> Xyzr {
        bytemuck::cast(self[k])
    }

    #[inline(always)]
    fn effective(self, _: usize, radius: f32) -> f32 {
        radius
    }
}

impl EffectiveRows for [&[f32]; 4] {
    #[inline(always)]
    fn prefetch(self, k: usize) {
        self.into_iter().for_each(|column| prefetch(column, k));
    }

    #[inline(always)]
    fn get(self, k: usize) -> Xyzr {
        self.map(|column| column[k])
    }

    #[inline(always)]
    fn effective(self, _: usize, radius: f32) -> f32 {
        radius
    }
}

impl<R: EffectiveRows> EffectiveRows for (R, &[u32], &[SpeciesRadius]) {
    #[inline(always)]
    fn prefetch(self, k: usize) {
        self.0.prefetch(k);
        prefetch(self.1, k);
    }

    #[inline(always)]
    fn get(self, k: usize) -> Xyzr {
        self.0.get(k)
    }

    #[inline(always)]
    fn effective(self, k: usize, radius: f32) -> f32 {
        self.2[self.1[k] as usize].effective.for_radius(radius)
    }
}

impl EffectiveRows for &PairTest<'_> {
    #[inline(always)]
    fn prefetch(self, k: usize) {
        self.spheres().addresses(k).into_iter().for_each(prefetch_address);
    }

    #[inline(always)]
    fn get(self, k: usize) -> Xyzr {
        bytemuck::cast(self.spheres().get(k))
    }

    #[inline(always)]
    fn effective(self, k: usize, _: f32) -> f32 {
        self.radii(k as u32).widened
    }

    #[inline(always)]
    fn row(self, k: usize) -> Xyzr {
        PairTest::row(self, k as u32)
    }
}
