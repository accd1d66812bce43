use std::ops::Range;

use lazygrid_kernels::{Pair, Space};

use super::super::columns::Columns;
use super::{Axes, MAX_LANES, NeighborRows, PeriodicSimd, RunQueue, SimdTask, SimdWidth, Xyzr};
use crate::frame::{Bounds, FrameMap, SearchFrame};

#[derive(Clone, Copy, Debug)]
pub(crate) struct PeriodicBox {
    /// Infinite for an unbounded axis.
    pub(super) lengths: [f32; 3],
    /// Bounds the error of a distance. Coordinates within half a length are exact; their difference rounds to 2⁻²⁴ of a
    /// length, and subtracting it from the length rounds no more. The slack is over twice that for three axes together.
    pub(super) slack: f32,
}

impl PeriodicBox {
    pub(crate) fn from_space(space: &Space) -> Option<Self> {
        let lengths = space.lengths_f32();
        let longest = lengths.into_iter().flatten().fold(0.0, f32::max);
        let periodic = Self {
            lengths: lengths.map(|length| length.unwrap_or(f32::INFINITY)),
            slack: longest / (1 << 22) as f32,
        };
        space.is_periodic().then_some(periodic)
    }

    pub(crate) fn from_frame(space: &Space, largest: f32) -> Self {
        let lengths = space.lengths_f32().map(|length| length.unwrap_or(f32::INFINITY));
        Self { lengths, slack: SearchFrame::slack(largest) }
    }
}

/// Compiled separately, so that unbounded spaces pay nothing.
#[derive(Clone, Copy)]
pub(super) struct MinimumImage<V> {
    pub(super) vector: V,
    pub(super) periodic: PeriodicBox,
}

impl<V: PeriodicSimd> SimdWidth for MinimumImage<V> {
    const LANES: usize = V::LANES;
    type Query = V::Query;
    type SquaredDistances = [V::SquaredDistances; 2];

    #[inline(always)]
    fn call<T: SimdTask>(self, task: T, vector: impl SimdWidth) -> T::Result {
        self.vector.call(task, vector)
    }

    #[inline(always)]
    fn query(self, sphere: [f32; 4]) -> V::Query {
        self.vector.query(sphere)
    }

    #[inline(always)]
    fn squared_distances(self, columns: &Columns, base: usize, query: V::Query) -> Self::SquaredDistances {
        self.vector.minimum_image_distances(columns, base, query, &self.periodic)
    }

    #[inline(always)]
    fn possible(self, [wide, _]: Self::SquaredDistances) -> u32 {
        self.vector.possible(wide)
    }

    #[inline(always)]
    fn certain(self, [_, narrow]: Self::SquaredDistances) -> u32 {
        self.vector.certain(narrow)
    }

    #[inline(always)]
    fn touching(self, rows: &[Xyzr], pairs: &[Pair; MAX_LANES]) -> [u32; 2] {
        self.vector.minimum_image_touching(rows, pairs, &self.periodic)
    }

    #[inline(always)]
    fn cell(self, axes: &Axes, center: [f32; 3], offset: f64) -> [u32; 4] {
        self.vector.cell(axes, center, offset)
    }

    #[inline(always)]
    fn add_to_bounds(self, bounds: &mut Bounds, row: [f64; 4]) {
        self.vector.add_to_bounds(bounds, row);
    }

    #[inline(always)]
    fn is_in_frame(self, map: &FrameMap<'_>, row: [f64; 4]) -> bool {
        self.vector.is_in_frame(map, row)
    }

    #[inline(always)]
    fn map_to_frame<const PERIODIC: bool>(self, map: &FrameMap<'_>, row: [f64; 4]) -> Xyzr {
        self.vector.map_to_frame::<PERIODIC>(map, row)
    }

    #[inline(always)]
    fn squared_displacement<const PERIODIC: bool>(self, now: Xyzr, then: Xyzr, lengths: &[f32; 4]) -> f32 {
        self.vector.squared_displacement::<PERIODIC>(now, then, lengths)
    }

    #[inline(always)]
    fn find_neighbor_runs(
        self,
        columns: &Columns,
        spheres: Range<usize>,
        neighbors: &NeighborRows,
        queue: &mut RunQueue,
    ) {
        self.vector.find_neighbor_runs(columns, spheres, neighbors, queue);
    }

    #[inline(always)]
    fn pack(self, id: u32, ids: &[u32; MAX_LANES], lanes: u32, pairs: &mut [Pair; MAX_LANES]) -> usize {
        self.vector.pack(id, ids, lanes, pairs)
    }

    #[inline(always)]
    fn compact(self, pairs: &[Pair; MAX_LANES], lanes: u32, packed: &mut [Pair; MAX_LANES]) -> usize {
        self.vector.compact(pairs, lanes, packed)
    }
}
