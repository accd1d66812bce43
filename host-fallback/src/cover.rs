//! Which cells of an unbounded raster a sphere overlaps: the geometry of the paper's grids.
//!
//! A pair can share several cells. The one that reports it has, on each axis, the larger of the two spheres' lowest
//! cells. Every (cell, sphere) entry therefore carries a class: one bit per axis, set where the cell is the sphere's
//! lowest on that axis. Two spheres of a cell are that cell's own pair exactly if their classes have all three bits
//! between them, so no pair is compared twice, let alone reported twice.

use glam::{BVec3, DVec3, UVec3, Vec3};

use crate::survey::Survey;

/// The class of an entry whose cell is the sphere's lowest on every axis.
pub(crate) const HOME: u8 = 0b111;
/// Cells on either side of the origin that are counted. Farther out, different `f32` coordinates lie at least eight
/// cells apart and no sphere is larger than two, so only equal coordinates can meet: those cells are named by the
/// bits of the coordinate.
const COUNTED: u32 = 1 << 27;
/// Room between the counted cells and the named ones: spheres near the limit reach two cells beyond it.
const GAP: u32 = 16;
/// The number of the first cell at or above coordinate 0.
const MIDDLE: u32 = 1 << 31;
/// Relative widening of radii, far above the rounding of the exact test.
const WIDER: f64 = 1.0 + 1e-9;
/// How far rounding can move a coordinate, relative to it: some units in the last place of `f64`.
const ROUNDING: f64 = 1.0 / (1_u64 << 49) as f64;
/// Cells are this much larger than asked for, so that a widened sphere of one cell's diameter never spans three.
const EASE: f64 = 1.0 + 1.0 / (1 << 20) as f64;
/// Points per cell aimed at where no sphere has a size.
const POINTS_PER_CELL: f64 = 4.0;

/// Cells of one edge all over space, numbered per axis in ascending order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Raster {
    edge: f64,
    per_length: f64,
    /// The bits of the first coordinate whose cell is named, not counted.
    named: u32,
}

impl Raster {
    /// Cells of `ratio` × the largest diameter, or by density where all radii are zero.
    pub(crate) fn new(survey: &Survey, ratio: f32) -> Self {
        let diameter = 2.0 * f64::from(survey.largest_radius());
        let edge = match diameter > 0.0 {
            true => f64::from(ratio) * diameter,
            false => {
                let extent = (survey.max.as_dvec3() - survey.min.as_dvec3()).max_element();
                extent / (survey.spheres as f64 / POINTS_PER_CELL).cbrt().max(1.0)
            }
        };
        Self::of_edge(edge * EASE)
    }

    /// Subnormal edges are raised: so the names of far cells and the numbers of the others fit 32 bits together.
    pub(crate) fn of_edge(edge: f64) -> Self {
        let edge = edge.max(f64::from(f32::MIN_POSITIVE));
        let limit = (edge * f64::from(COUNTED)) as f32;
        Self { edge, per_length: edge.recip(), named: limit.next_down().min(f32::MAX).to_bits() }
    }

    pub(crate) fn edge(&self) -> f64 {
        self.edge
    }

    /// Lower and upper corner of the box around a sphere, in cells, moved outwards by more than rounding can move
    /// them. Both corners come from one monotone expression.
    #[inline(always)]
    pub(crate) fn bounds(&self, center: Vec3, radius: f32) -> (DVec3, DVec3) {
        let center = center.as_dvec3();
        let reach = center.abs() * ROUNDING + f64::from(radius) * WIDER;
        ((center - reach) * self.per_length, (center + reach) * self.per_length)
    }

    /// The cells a sphere overlaps.
    #[inline(always)]
    pub(crate) fn cover(&self, center: Vec3, radius: f32) -> Cover {
        let (low, high) = self.bounds(center, radius);
        // Rounding down after the addition: the cast alone does it. (A `floor` is a call where the target lacks one.)
        let counted = |at: DVec3| (at + f64::from(MIDDLE)).as_uvec3();
        let mut cover = Cover { low: counted(low), high: counted(high) };
        let far = self.is_far(center);
        if far.any() {
            for axis in 0..3 {
                if far.test(axis) {
                    let name = self.name(center[axis]);
                    (cover.low[axis], cover.high[axis]) = (name, name);
                }
            }
        }
        cover
    }

    /// The lowest and the highest cell of any sphere up to `largest` with its centre between these corners.
    pub(crate) fn bounds_of(&self, min: Vec3, max: Vec3, largest: f32) -> (UVec3, UVec3) {
        (self.cover(min, largest).low, self.cover(max, largest).high)
    }

    #[inline(always)]
    fn is_far(&self, center: Vec3) -> BVec3 {
        (center.as_dvec3() * self.per_length).abs().cmpge(DVec3::splat(f64::from(COUNTED)))
    }

    fn name(&self, coordinate: f32) -> u32 {
        let step = COUNTED + GAP + coordinate.abs().to_bits().saturating_sub(self.named);
        if coordinate > 0.0 { MIDDLE + step } else { MIDDLE - step }
    }

    /// The lower corner of a cell, in cells; `None` on an axis where it is named, so that all coordinates agree.
    pub(crate) fn corner(cell: UVec3) -> [Option<f64>; 3] {
        cell.to_array().map(|k| {
            let counted = k.abs_diff(MIDDLE) < COUNTED + GAP;
            counted.then_some(f64::from(k) - f64::from(MIDDLE))
        })
    }
}

/// A box of cells, both corners included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cover {
    pub(crate) low: UVec3,
    pub(crate) high: UVec3,
}

impl Cover {
    /// How many cells: at most 8 where the raster's edge is the largest diameter or more, 27 where it is half.
    #[inline(always)]
    pub(crate) fn cells(self) -> usize {
        let size = self.high - self.low + 1;
        (size.x * size.y * size.z) as usize
    }

    /// All cells with their classes.
    #[inline(always)]
    pub(crate) fn for_each(self, mut take: impl FnMut(UVec3, u8)) {
        let Self { low, high } = self;
        for z in low.z..=high.z {
            let class_z = u8::from(z == low.z) << 2;
            for y in low.y..=high.y {
                let class_y = class_z | u8::from(y == low.y) << 1;
                for x in low.x..=high.x {
                    take(UVec3::new(x, y, z), class_y | u8::from(x == low.x));
                }
            }
        }
    }
}
