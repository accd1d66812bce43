//! Spheres as given, and their map to the search frame.

use lazygrid_kernels::{Space, Spheres};

use crate::compare::{SimdWidth, Xyzr};
use crate::frame::{Bounds, FrameMap, SearchFrame};
use crate::memory::prefetch;

/// Half the largest distance with any other species, and `true` if some pairs are decided by contact.
pub(super) type LargestHalf = (f64, bool);

#[derive(Clone, Copy, Debug)]
pub(crate) struct GivenSpheres<'a> {
    spheres: Spheres<'a>,
    species: Option<(&'a [u32], &'a [LargestHalf])>,
    frame: &'a SearchFrame,
    space: &'a Space,
}

/// One of the layouts for which loops are compiled.
pub(crate) trait GivenRows: Copy {
    fn prefetch(self, k: usize);
    fn get(self, k: usize) -> [f64; 4];
    /// Replaces the radius of sphere `k` by its effective radius.
    fn effective(self, k: usize, row: [f64; 4]) -> [f64; 4];
}

/// A loop over given spheres. Its callees are `#[inline(always)]`, as in a [`SimdTask`](crate::compare::SimdTask).
pub(crate) trait GivenLoop {
    type Result;
    /// Must be `#[inline(always)]`. `PERIODIC` is a parameter of the map.
    fn run<V: SimdWidth, const PERIODIC: bool>(
        self,
        vector: V,
        rows: impl GivenRows,
        map: &FrameMap<'_>,
    ) -> Self::Result;
}

impl<'a> GivenSpheres<'a> {
    pub(super) fn new(
        spheres: Spheres<'a>,
        halves: Option<&'a [LargestHalf]>,
        (frame, space): (&'a SearchFrame, &'a Space),
    ) -> Self {
        Self { spheres, species: spheres.species().zip(halves), frame, space }
    }

    pub(crate) fn fits(&self, bounds: &Bounds) -> bool {
        self.frame.is_narrow() || self.frame.fits(bounds, self.space)
    }

    #[inline(always)]
    pub(crate) fn run<V: SimdWidth, L: GivenLoop>(self, vector: V, task: L) -> L::Result {
        let map = FrameMap::new(self.frame);
        match (self.spheres.as_rows_f64().filter(|_| self.species.is_none()), map.is_unbounded()) {
            (Some(rows), true) => task.run::<V, false>(vector, rows, &map),
            (Some(rows), false) => task.run::<V, true>(vector, rows, &map),
            (None, _) => task.run::<V, true>(vector, self, &map),
        }
    }

    pub(crate) fn searched(self, k: usize) -> Xyzr {
        FrameMap::new(self.frame).map::<true>(self.effective(k, self.get(k)))
    }
}

impl GivenRows for &[[f64; 4]] {
    #[inline(always)]
    fn prefetch(self, k: usize) {
        // A row may lie in two cache lines.
        prefetch(self.as_flattened(), 4 * k);
        prefetch(self.as_flattened(), 4 * k + 3);
    }

    #[inline(always)]
    fn get(self, k: usize) -> [f64; 4] {
        self[k]
    }

    #[inline(always)]
    fn effective(self, _: usize, row: [f64; 4]) -> [f64; 4] {
        row
    }
}

impl GivenRows for GivenSpheres<'_> {
    #[inline(always)]
    fn prefetch(self, _: usize) {}

    #[inline(always)]
    fn get(self, k: usize) -> [f64; 4] {
        self.spheres.get_f64(k)
    }

    #[inline(always)]
    fn effective(self, k: usize, [x, y, z, radius]: [f64; 4]) -> [f64; 4] {
        let effective = match self.species {
            // The validity check finds other radii.
            Some((species, halves)) if (0.0..f64::INFINITY).contains(&radius) => {
                let (half, touches) = halves[species[k] as usize];
                if touches { half.max(radius) } else { half }
            }
            _ => radius,
        };
        [x, y, z, effective]
    }
}
