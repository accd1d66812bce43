//! Planar and spherical (`sphere.rs`) membranes.
//!
//! The flux is κ times the difference of the concentrations on both sides. The distance |x| from the plane is a
//! reflected Brownian motion. Each time its local time L has grown by D/(2κ) on average, the particle takes either
//! side with equal probability (A. Lejay, *The snapping out Brownian motion*, The Annals of Applied Probability 26
//! (2016) 1727). It has then changed sides with the probability
//!
//! ```text
//! ½(1 − exp(−2κL/D)),   L = max(0, −min over s ≤ t of X(s)),   |x(t)| = X(t) + L
//! ```
//!
//! with the free path X, a Brownian bridge whose minimum has a closed form (`bridge.rs`). L, |x| and the side are
//! exact for steps of any length that reach one membrane and no wall.
//!
//! *Narrow gaps.* A step that is long compared with the gap between two membranes, or a membrane and a wall, is divided
//! into substeps of a Brownian bridge, or more particles would enter the gap than leave it.

mod check;
mod gaps;
mod receiver;
mod sphere;

#[cfg(feature = "gpu")]
pub(crate) use self::gaps::substep_count;
pub(crate) use self::gaps::{MAX_SUBSTEPS, narrowest_gaps};
use self::sphere::SphereEnd;
use crate::model::boundary::{Axis, Boundary};
use crate::random::bridge::lowest;
use crate::random::philox::{DrawContext, Purpose, fine_unit};

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Membrane {
    pub name: String,
    pub surface: MembraneSurface,
    /// Permeability κ, in µm/s.
    pub permeability: f64,
    /// `true` for the species that the membrane holds back.
    pub sees: Vec<bool>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MembraneSurface {
    Plane {
        /// Axis of the normal: 0, 1 or 2.
        axis: usize,
        position: f32,
    },
    Sphere {
        center: [f32; 3],
        radius: f32,
    },
}

impl Default for MembraneSurface {
    fn default() -> Self {
        Self::Plane { axis: 0, position: 0.0 }
    }
}

/// The end of a step, in µm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepEnds {
    /// Without periodic images; see [`Path::end`](crate::motion::path_hit::Path::end).
    pub(crate) end: [f32; 3],
    /// Without periodic images and walls.
    pub(crate) free: [f32; 3],
    /// Within the boundary.
    pub(crate) after: [f32; 3],
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct MembraneStep<'a> {
    pub(crate) membranes: &'a [Membrane],
    /// Boundary of the center.
    pub(crate) domain: &'a Boundary,
    pub(crate) species: usize,
    /// D, in µm²/s.
    pub(crate) diffusion: f64,
    /// √(2DΔt), in µm.
    pub(crate) spread: f32,
    /// Narrowest gap along each axis, in µm; see [`narrowest_gaps`].
    pub(crate) gaps: [f32; 3],
}

/// A step's end along an axis, in µm: `free` without walls and images, `confined` with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HeldEnd {
    pub(crate) free: f32,
    pub(crate) confined: f32,
}

/// The interval between two membranes. A membrane belongs to the side above it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Slab {
    low: f32,
    high: f32,
}

impl MembraneStep<'_> {
    /// Replaces the ends of a step by those that membranes allow.
    pub(crate) fn hold_back(&self, before: [f32; 3], ends: &mut StepEnds, context: DrawContext) {
        let words = |membrane: u32, event: u32| context.draw_part(membrane, event, Purpose::Membrane);
        let around = self.sphere_end([before, ends.free], |membrane, event| words(membrane as u32, event)[0]);
        if let Some(SphereEnd { free, confined }) = around {
            *ends = StepEnds { end: free, free, after: confined };
        }
        let side = around.map_or(before, |around| around.confined);
        let held = self.ends([before, ends.free], words);
        for (axis, held) in (0..3).zip(held).filter_map(|(axis, held)| Some((axis, held?))) {
            (ends.end[axis], ends.free[axis], ends.after[axis]) = (held.free, held.free, held.confined);
        }
        // Reflection or rounding may carry the end across a sphere. The particle then stays.
        if self.is_across_sphere([side, ends.after]) {
            *ends = StepEnds { end: before, free: before, after: before };
        }
    }

    /// `words` returns random words by membrane, or a number above all membranes, and substep.
    fn ends(
        &self,
        [before, end]: [[f32; 3]; 2],
        words: impl Fn(u32, u32) -> [u32; 4],
    ) -> [Option<HeldEnd>; 3] {
        std::array::from_fn(|axis| {
            self.planes(axis).next()?;
            Some(self.end(axis, [before[axis], end[axis]], &words))
        })
    }

    /// Returns the end of a substep with this standard deviation, in µm.
    fn substep_end(
        &self,
        axis: usize,
        [before, end]: [f32; 2],
        spread: f32,
        words: impl Fn(u32) -> [u32; 4],
    ) -> HeldEnd {
        let below = self.planes(axis).filter(|&(_, at)| at <= before).max_by(|a, b| a.1.total_cmp(&b.1));
        let above = self.planes(axis).filter(|&(_, at)| at > before).min_by(|a, b| a.1.total_cmp(&b.1));
        let [low, high] = [below, above].map(|next| next.map(|(_, at)| at));
        let slab = Slab { low: low.unwrap_or(f32::NEG_INFINITY), high: high.unwrap_or(f32::INFINITY) };
        let is_low = (before - slab.low) + (end - slab.low) < (slab.high - before) + (slab.high - end);
        let Some((membrane, at)) = (if is_low { below } else { above }) else {
            return self.end_within(axis, slab, end);
        };
        let sign = if is_low { 1.0 } else { -1.0 };
        let heights = [before, end].map(|x| sign * (x - at));
        let Some(lowest) = lowest(heights, spread, || words(membrane as u32)[0]) else {
            return self.end_within(axis, slab, end);
        };
        let (height, local_time) = (heights[1] - lowest, -lowest);
        let rate = 2.0 * self.membranes[membrane].permeability / self.diffusion;
        let changes = -0.5 * libm::expm1(-rate * f64::from(local_time));
        if fine_unit(words(membrane as u32)[1]) >= changes {
            return self.end_within(axis, slab, at + sign * height);
        }
        let others = self.planes(axis).map(|(_, at)| at);
        let other = match is_low {
            true => Slab { low: others.filter(|&x| x < at).fold(f32::NEG_INFINITY, f32::max), high: at },
            false => Slab { low: at, high: others.filter(|&x| x > at).fold(f32::INFINITY, f32::min) },
        };
        self.end_within(axis, other, at - sign * height)
    }

    /// Returns the indices of planar membranes, and the coordinates of their images.
    fn planes(&self, axis: usize) -> impl Iterator<Item = (usize, f32)> {
        let domain = self.domain.axes[axis];
        let plane = move |(k, membrane): (usize, &Membrane)| match membrane.surface {
            MembraneSurface::Plane { axis: across, position } if across == axis => {
                membrane.sees[self.species].then_some((k, position))
            }
            _ => None,
        };
        let all = self.membranes.iter().enumerate().filter_map(plane);
        all.flat_map(move |(k, position)| domain.plane_images(position).map(move |at| (k, at)))
    }

    fn end_within(&self, axis: usize, slab: Slab, end: f32) -> HeldEnd {
        let free = slab.mirrored(end);
        let confined = self.domain.axes[axis].confine(free);
        match self.domain.axes[axis] {
            Axis::Periodic { .. } => HeldEnd { free, confined },
            // A wall may have mirrored the end past a membrane.
            _ => HeldEnd { free, confined: slab.mirrored(confined) },
        }
    }

    pub(crate) fn separates(&self, [a, b]: [[f32; 3]; 2]) -> bool {
        let displacement = self.domain.displacement(a, b);
        let is_across_plane = (0..3).any(|axis| {
            let is_above = |at: f32| [a[axis] >= at, a[axis] + displacement[axis] >= at];
            self.planes(axis).map(|(_, at)| is_above(at)).any(|[a, b]| a != b)
        });
        is_across_plane || self.is_across_sphere([a, b])
    }
}

impl Slab {
    fn mirrored(self, x: f32) -> f32 {
        let Self { low, high } = self;
        let x = if x < low { 2.0 * low - x } else { x };
        let x = if x >= high { 2.0 * high - x } else { x };
        let x = if x < low && high < f32::INFINITY { Axis::Reflecting { low, high }.confine(x) } else { x };
        x.min(high.next_down()).max(low)
    }
}

#[cfg(test)]
mod tests;
