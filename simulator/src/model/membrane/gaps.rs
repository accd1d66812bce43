//! Steps in narrow gaps between membranes, or a membrane and a wall.

use super::{HeldEnd, Membrane, MembraneStep, MembraneSurface};
use crate::model::boundary::{Axis, Boundary};
use crate::random::bridge::NEVER;
use crate::random::gaussian::normals;

/// Least width of a gap, in standard deviations of a substep: from one side to the other with a probability of 6 in
/// 100 000.
const MIN_GAP_WIDTH: f32 = 4.0;
pub(crate) const MAX_SUBSTEPS: u32 = 256;

/// Returns the narrowest gap along each axis, in µm; infinite without one.
pub(crate) fn narrowest_gaps(membranes: &[Membrane], domain: &Boundary, species: usize) -> [f32; 3] {
    std::array::from_fn(|axis| {
        let plane = |membrane: &Membrane| match membrane.surface {
            MembraneSurface::Plane { axis: across, position } if across == axis => {
                membrane.sees[species].then_some(position)
            }
            _ => None,
        };
        let planes = membranes.iter().filter_map(plane);
        let mut all: Vec<f32> = planes.flat_map(|at| domain.axes[axis].plane_images(at)).collect();
        if all.is_empty() {
            return f32::INFINITY;
        }
        if let Axis::Reflecting { low, high } = domain.axes[axis] {
            all.extend([low, high]);
        }
        all.sort_unstable_by(f32::total_cmp);
        all.windows(2).map(|ends| ends[1] - ends[0]).fold(f32::INFINITY, f32::min)
    })
}

pub(crate) fn substep_count(gap: f32, spread: f32) -> u32 {
    let ratio = MIN_GAP_WIDTH * spread / gap;
    (ratio * ratio).ceil().clamp(1.0, MAX_SUBSTEPS as f32) as u32
}

impl MembraneStep<'_> {
    pub(super) fn end(
        &self,
        axis: usize,
        [before, end]: [f32; 2],
        words: impl Fn(u32, u32) -> [u32; 4],
    ) -> HeldEnd {
        let substeps = substep_count(self.gaps[axis], self.spread);
        if substeps == 1 || self.is_clear(axis, [before, end]) {
            return self.substep_end(axis, [before, end], self.spread, |membrane| words(membrane, 0));
        }
        let spread = self.spread / (substeps as f32).sqrt();
        let (mut at, mut free, mut sign, mut rest) = (before, before, 1.0, end - before);
        for substep in 0..substeps {
            let left = (substeps - substep) as f32;
            let z = normals(words(u32::MAX - axis as u32, substep))[0];
            let displacement = rest / left + spread * (1.0 - 1.0 / left).sqrt() * z;
            rest -= displacement;
            let held =
                self.substep_end(axis, [at, at + displacement], spread, |membrane| words(membrane, substep));
            free += sign * (held.free - at);
            sign = if self.domain.axes[axis].reverses(held.free) { -sign } else { sign };
            at = held.confined;
        }
        HeldEnd { free, confined: at }
    }

    /// Returns `true` if a path reaches no plane with a probability above that of the smallest random number.
    fn is_clear(&self, axis: usize, [before, end]: [f32; 2]) -> bool {
        let square = self.spread * self.spread;
        self.planes(axis).all(|(_, at)| 2.0 * (before - at) * (end - at) >= NEVER * square)
    }
}
