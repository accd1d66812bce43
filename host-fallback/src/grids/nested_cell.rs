//! Cells of grids that nest in the cells of the top grid.

use glam::{BVec3, DVec3, UVec3, Vec3};

use super::entries::KeyLayout;
use super::uniform_grid::{CellBox, UniformGrid};

/// Maximum number of finer cells from the origin to a coordinate. Boxes are widened by 2⁻⁴⁹ of the coordinate for
/// rounding, at most an eighth of a cell. Different coordinates are 2²² such cells apart, so along such an axis all
/// spheres of a cell agree, and no split is needed.
const MAX_FINENESS: f64 = (1_u64 << 46) as f64;

#[derive(Clone, Copy, Debug)]
pub(super) struct NestedCell {
    /// Corner of the top cell, in top cells.
    top: DVec3,
    /// Cells per axis of a top cell, a power of two.
    pub(super) fineness: f64,
    /// `fineness`, or 0 on an axis with one coordinate for all spheres, or with a ring of one cell.
    scale: DVec3,
    /// Relative to `top`, in cells of this size.
    corner: DVec3,
    /// Maximum distance of a coordinate inside from the origin, or from the ring's start, in top cells.
    away: DVec3,
}

impl NestedCell {
    pub(super) fn top(grid: &UniformGrid, cell: UVec3) -> Self {
        let corner = grid.corner(cell);
        let top = DVec3::from_array(corner.map(|at| at.unwrap_or(0.0)));
        let scale = DVec3::from_array(corner.map(|at| f64::from(u8::from(at.is_some()))));
        Self { top, fineness: 1.0, scale, corner: DVec3::ZERO, away: grid.away(top) }
    }

    fn finer(&self, divisions: f64, at: DVec3) -> Self {
        let (fineness, scale) = (self.fineness * divisions, self.scale * divisions);
        Self { fineness, scale, corner: self.corner * divisions + at, ..*self }
    }

    fn halvings(&self) -> DVec3 {
        (MAX_FINENESS / (self.away * self.fineness)).map(|divisions| divisions.log2().floor())
    }

    /// Returns the axes that can be halved, and how often all of them can.
    pub(super) fn divisible(&self) -> (BVec3, f64) {
        let halvings = self.halvings();
        let axes = self.scale.cmpgt(DVec3::ZERO) & halvings.cmpge(DVec3::ONE);
        (axes, DVec3::select(axes, halvings, DVec3::INFINITY).min_element())
    }

    fn along(&self, axes: BVec3) -> Self {
        Self { scale: DVec3::select(axes, self.scale, DVec3::ZERO), ..*self }
    }

    #[inline(always)]
    pub(super) fn bounds<const PERIODIC: bool>(
        &self,
        grid: &UniformGrid,
        center: Vec3,
        radius: f32,
    ) -> (DVec3, DVec3) {
        let bounds = grid.bounds::<PERIODIC>(center, radius);
        if PERIODIC { grid.image_at(self.top, bounds) } else { bounds }
    }

    /// The map is monotone, so the larger of two lower bounds never exceeds either upper bound. A coordinate keeps its
    /// cell in further splits: all but the first subtraction are exact inside the cell.
    #[inline(always)]
    fn child_at(&self, at: DVec3, divisions: f64) -> DVec3 {
        let at = ((at - self.top) * self.scale - self.corner) * divisions;
        // `floor` may be a function call.
        at.max(DVec3::ZERO).min(DVec3::splat(divisions - 1.0)).map(|k| k as i64 as f64)
    }
}

pub(super) struct FinerCells {
    cell: NestedCell,
    /// Number of finer cells per axis.
    divisions: f64,
    first: DVec3,
    pub(super) layout: KeyLayout,
}

impl FinerCells {
    pub(super) fn new(cell: &NestedCell, divisions: f64, low: DVec3, high: DVec3) -> Self {
        let cell = cell.along(cell.divisible().0);
        // One more cell on either side covers rounding.
        let first = cell.child_at(low, divisions) - 1.0;
        let last = cell.child_at(high, divisions) + 1.0;
        let layout = KeyLayout::new(UVec3::ZERO, (last - first).as_uvec3());
        Self { cell, divisions, first, layout }
    }

    #[inline(always)]
    pub(super) fn cover<const PERIODIC: bool>(
        &self,
        grid: &UniformGrid,
        center: Vec3,
        radius: f32,
    ) -> CellBox {
        let (low, high) = self.cell.bounds::<PERIODIC>(grid, center, radius);
        let within = |at| (self.cell.child_at(at, self.divisions) - self.first).as_uvec3();
        CellBox { low: within(low), high: within(high) }
    }

    pub(super) fn cell_of(&self, key: u32) -> NestedCell {
        self.cell.finer(self.divisions, self.first + self.layout.cell(key).as_dvec3())
    }
}
