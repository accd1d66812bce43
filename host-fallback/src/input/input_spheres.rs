//! The spheres of a call in the caller's layout, and their map to the search frame.

use lazygrid_kernels::{Space, SpeciesRadius, SphereValues, Spheres, Strided, widened};

use crate::compare::{SimdWidth, Xyzr};
use crate::frame::{Bounds, FrameMap, SearchFrame};
use crate::memory::{prefetch, prefetch_address, prefetch_row};

#[derive(Clone, Copy, Debug)]
pub(crate) struct InputSpheres<'a> {
    spheres: Spheres<'a>,
    species: Option<(&'a [u32], &'a [SpeciesRadius])>,
    frame: &'a SearchFrame,
    space: &'a Space,
}

pub(crate) trait InputRows: Copy {
    fn prefetch(self, k: usize);
    fn get(self, k: usize) -> [f64; 4];

    #[inline(always)]
    fn effective(self, _: usize, row: [f64; 4]) -> [f64; 4] {
        row
    }
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
        species_radii: Option<&'a [SpeciesRadius]>,
        frame: &'a SearchFrame,
        space: &'a Space,
    ) -> Self {
        Self { spheres, species: spheres.species().zip(species_radii), frame, space }
    }

    pub(crate) fn frame_holds(&self, bounds: &Bounds) -> bool {
        self.frame.holds(bounds, self.space)
    }

    #[inline(always)]
    pub(crate) fn run<V: SimdWidth, L: InputLoop>(self, vector: V, task: L) -> L::Result {
        let run = Run { vector, task, map: &FrameMap::new(self.frame), species: self.species };
        match self.spheres.values() {
            SphereValues::RowsF32(rows) => run.on_f32(rows),
            SphereValues::StridedF32(columns) => run.on_f32(&columns),
            SphereValues::RowsF64(rows) => run.on_f64(rows),
            SphereValues::StridedF64(columns) => run.on_f64(&columns),
        }
    }

    pub(super) fn effective_row(self, k: usize) -> [f64; 4] {
        let row = self.spheres.get_f64(k);
        self.species
            .map_or(row, |(species, species_radii)| effective(row, species_radii[species[k] as usize]))
    }

    pub(crate) fn frame_map(&self) -> FrameMap<'a> {
        FrameMap::new(self.frame)
    }

    #[inline]
    pub(crate) fn searched(self, map: &FrameMap<'_>, k: usize) -> Xyzr {
        map.map::<true>(self.effective_row(k))
    }
}

struct Run<'a, V, L> {
    vector: V,
    task: L,
    map: &'a FrameMap<'a>,
    species: Option<(&'a [u32], &'a [SpeciesRadius])>,
}

impl<V: SimdWidth, L: InputLoop> Run<'_, V, L> {
    #[inline(always)]
    fn on_f64(self, rows: impl InputRows) -> L::Result {
        let Self { vector, task, map, species } = self;
        match (species, map.is_unbounded()) {
            (None, true) => task.run::<V, false>(vector, rows, map),
            (None, false) => task.run::<V, true>(vector, rows, map),
            (Some((ids, species_radii)), true) => {
                task.run::<V, false>(vector, SpeciesRows { rows, ids, species_radii }, map)
            }
            (Some((ids, species_radii)), false) => {
                task.run::<V, true>(vector, SpeciesRows { rows, ids, species_radii }, map)
            }
        }
    }

    /// Few unbounded spaces need a frame for `f32`, so they have no loop of their own.
    #[inline(always)]
    fn on_f32(self, rows: impl InputRows) -> L::Result {
        let Self { vector, task, map, species } = self;
        match species {
            None => task.run::<V, true>(vector, rows, map),
            Some((ids, species_radii)) => {
                task.run::<V, true>(vector, SpeciesRows { rows, ids, species_radii }, map)
            }
        }
    }
}

impl<T: Copy + Into<f64>> InputRows for &[[T; 4]] {
    #[inline(always)]
    fn prefetch(self, k: usize) {
        prefetch_row(self, k);
    }

    #[inline(always)]
    fn get(self, k: usize) -> [f64; 4] {
        widened(self[k])
    }
}

impl<T: Copy + Into<f64>> InputRows for &Strided<'_, T> {
    #[inline(always)]
    fn prefetch(self, k: usize) {
        self.addresses(k).into_iter().for_each(prefetch_address);
    }

    #[inline(always)]
    fn get(self, k: usize) -> [f64; 4] {
        widened(Strided::get(self, k))
    }
}

#[derive(Clone, Copy)]
struct SpeciesRows<'a, R> {
    rows: R,
    ids: &'a [u32],
    species_radii: &'a [SpeciesRadius],
}

impl<R: InputRows> InputRows for SpeciesRows<'_, R> {
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
        effective(row, self.species_radii[self.ids[k] as usize])
    }
}

/// Keeps an invalid radius, because the validity check must find it.
#[inline(always)]
fn effective([x, y, z, radius]: [f64; 4], species_radius: SpeciesRadius) -> [f64; 4] {
    let is_valid = (0.0..f64::INFINITY).contains(&radius);
    [x, y, z, if is_valid { species_radius.for_radius(radius) } else { radius }]
}
