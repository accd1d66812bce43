//! The spheres of a call in the caller's layout, and their map to the search frame.

use lazygrid_kernels::{Space, SpeciesReach, Spheres, Strided};

use crate::compare::{SimdWidth, Xyzr};
use crate::frame::{Bounds, FrameMap, SearchFrame};
use crate::memory::{prefetch, prefetch_address, prefetch_row};

#[derive(Clone, Copy, Debug)]
pub(crate) struct InputSpheres<'a> {
    spheres: Spheres<'a>,
    species: Option<(&'a [u32], &'a [SpeciesReach])>,
    frame: &'a SearchFrame,
    space: &'a Space,
}

pub(crate) trait InputRows: Copy {
    fn prefetch(self, k: usize);
    fn get(self, k: usize) -> [f64; 4];
    fn effective(self, k: usize, row: [f64; 4]) -> [f64; 4];
}

/// Callees are `#[inline(always)]`, as in a [`SimdTask`](crate::compare::SimdTask).
pub(crate) trait InputLoop {
    type Result;
    /// Must be `#[inline(always)]`.
    fn run<V: SimdWidth, const PERIODIC: bool>(
        self,
        vector: V,
        rows: impl InputRows,
        map: &FrameMap<'_>,
    ) -> Self::Result;
}

impl<'a> InputSpheres<'a> {
    pub(super) fn new(
        spheres: Spheres<'a>,
        reaches: Option<&'a [SpeciesReach]>,
        frame: &'a SearchFrame,
        space: &'a Space,
    ) -> Self {
        Self { spheres, species: spheres.species().zip(reaches), frame, space }
    }

    pub(crate) fn frame_holds(&self, bounds: &Bounds) -> bool {
        self.frame.holds(bounds, self.space)
    }

    #[inline(always)]
    pub(crate) fn run<V: SimdWidth, L: InputLoop>(self, vector: V, task: L) -> L::Result {
        let map = FrameMap::new(self.frame);
        let (rows, strided) = (self.spheres.as_rows_f64(), self.spheres.as_strided_f64());
        match (rows, &strided, self.species) {
            (Some(rows), _, None) => run_mapped(vector, task, rows, &map),
            (_, Some(rows), None) => run_mapped(vector, task, rows, &map),
            (Some(rows), _, Some((ids, reaches))) => {
                run_mapped(vector, task, OfSpecies { rows, ids, reaches }, &map)
            }
            (_, Some(rows), Some((ids, reaches))) => {
                run_mapped(vector, task, OfSpecies { rows, ids, reaches }, &map)
            }
            (None, None, _) => task.run::<V, true>(vector, &self, &map),
        }
    }

    pub(super) fn effective_row(self, k: usize) -> [f64; 4] {
        (&self).effective(k, self.spheres.get_f64(k))
    }

    pub(crate) fn frame_map(&self) -> FrameMap<'a> {
        FrameMap::new(self.frame)
    }

    #[inline]
    pub(crate) fn searched(self, map: &FrameMap<'_>, k: usize) -> Xyzr {
        map.map::<true>(self.effective(k, self.get(k)))
    }
}

#[inline(always)]
fn run_mapped<V: SimdWidth, L: InputLoop>(
    vector: V,
    task: L,
    rows: impl InputRows,
    map: &FrameMap<'_>,
) -> L::Result {
    match map.is_unbounded() {
        true => task.run::<V, false>(vector, rows, map),
        false => task.run::<V, true>(vector, rows, map),
    }
}

impl InputRows for &[[f64; 4]] {
    #[inline(always)]
    fn prefetch(self, k: usize) {
        prefetch_row(self, k);
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

impl InputRows for &Strided<'_, f64> {
    #[inline(always)]
    fn prefetch(self, k: usize) {
        self.addresses(k).into_iter().for_each(prefetch_address);
    }

    #[inline(always)]
    fn get(self, k: usize) -> [f64; 4] {
        Strided::get(self, k)
    }

    #[inline(always)]
    fn effective(self, _: usize, row: [f64; 4]) -> [f64; 4] {
        row
    }
}

#[derive(Clone, Copy)]
struct OfSpecies<'a, R> {
    rows: R,
    ids: &'a [u32],
    reaches: &'a [SpeciesReach],
}

impl<R: InputRows> InputRows for OfSpecies<'_, R> {
    #[inline(always)]
    fn prefetch(self, k: usize) {
        self.rows.prefetch(k);
        prefetch(self.ids, k);
    }

    #[inline(always)]
    fn get(self, k: usize) -> [f64; 4] {
        self.rows.get(k)
    }

    #[inline(always)]
    fn effective(self, k: usize, row: [f64; 4]) -> [f64; 4] {
        effective(row, self.reaches[self.ids[k] as usize])
    }
}

impl InputRows for &InputSpheres<'_> {
    #[inline(always)]
    fn prefetch(self, k: usize) {
        self.spheres.addresses(k).into_iter().for_each(prefetch_address);
        self.species.iter().for_each(|(ids, _)| prefetch(ids, k));
    }

    #[inline(always)]
    fn get(self, k: usize) -> [f64; 4] {
        self.spheres.get_f64(k)
    }

    #[inline(always)]
    fn effective(self, k: usize, row: [f64; 4]) -> [f64; 4] {
        self.species.map_or(row, |(species, reaches)| effective(row, reaches[species[k] as usize]))
    }
}

/// Keeps an invalid radius, because the validity check must find it.
#[inline(always)]
fn effective([x, y, z, radius]: [f64; 4], reach: SpeciesReach) -> [f64; 4] {
    let is_valid = (0.0..f64::INFINITY).contains(&radius);
    [x, y, z, if is_valid { reach.for_radius(radius) } else { radius }]
}
