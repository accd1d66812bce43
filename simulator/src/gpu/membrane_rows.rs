use glam::UVec2;

use crate::model::membrane::{MAX_SUBSTEPS, MembraneSurface, narrowest_gaps, substep_count};
use crate::{Axis, Boundary, Model, Species};

pub(super) type MembraneRow = [u32; 4];

/// Largest number for a species, as in `membrane_spheres.wgsl`.
pub(super) const MAX_SPHERES: usize = 100;

/// Lowest bit of a membrane's index in the row of a plane, above the bits of the axis and of [`MAX_SUBSTEPS`].
const MEMBRANE_SHIFT: u32 = 11;
const _: () = assert!(MAX_SUBSTEPS << 2 < 1 << MEMBRANE_SHIFT);

/// Rounding of a distance from a surface, in radii and in lengths of a periodic box.
const ROUNDING: [f32; 2] = [1e-6, 2e-7];

#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct MembraneRows {
    pub(super) planes: Vec<MembraneRow>,
    /// Two rows each.
    pub(super) spheres: Vec<MembraneRow>,
}

impl MembraneRows {
    pub(super) fn new(model: &Model, species: usize) -> Self {
        let mut rows = Self::default();
        let seen = (0..).zip(&model.membranes).filter(|(_, membrane)| membrane.sees[species]);
        let Species { diffusion, radius, .. } = model.species[species];
        let gaps = narrowest_gaps(&model.membranes, &model.boundary.inset(radius), species);
        let spread = (2.0 * diffusion * model.time_step).sqrt() as f32;
        for (k, membrane) in seen {
            match membrane.surface {
                MembraneSurface::Plane { axis, position } => {
                    let rate = (2.0 * membrane.permeability / diffusion) as f32;
                    let index = axis as u32 | substep_count(gaps[axis], spread) << 2 | k << MEMBRANE_SHIFT;
                    let row = |at: f32| [at.to_bits(), below(at).to_bits(), rate.to_bits(), index];
                    rows.planes.extend(model.boundary.axes[axis].plane_images(position).map(row));
                }
                MembraneSurface::Sphere { center: [x, y, z], radius } => {
                    let scaled_permeability =
                        2.0 * membrane.permeability * (model.time_step / diffusion).sqrt();
                    let rounding = rounding(&model.boundary, radius);
                    rows.spheres.push([x, y, z, radius].map(f32::to_bits));
                    rows.spheres.push([(scaled_permeability as f32).to_bits(), k, rounding.to_bits(), 0]);
                }
            }
        }
        rows
    }

    /// Planes are counted with their images.
    pub(super) fn counts(&self) -> (usize, usize) {
        (self.planes.len(), self.spheres.len() / 2)
    }

    pub(super) fn max_substeps(&self) -> usize {
        self.planes.iter().map(|row| (row[3] % (1 << MEMBRANE_SHIFT)) >> 2).max().unwrap_or(0) as usize
    }

    /// Returns first row and number of planes, then of spheres, after `first` other rows.
    pub(super) fn ranges(&self, first: usize) -> [UVec2; 2] {
        let (planes, spheres) = self.counts();
        [[first, planes], [first + planes, spheres]].map(|range| UVec2::from(range.map(|n| n as u32)))
    }
}

/// Returns the rounding of the distance from a sphere, in µm.
fn rounding(boundary: &Boundary, radius: f32) -> f32 {
    let longest = boundary.axes.map(Axis::period).into_iter().fold(0.0, f32::max);
    ROUNDING[0] * radius + ROUNDING[1] * longest
}

/// Returns the next number below, which devices do not flush to zero.
fn below(x: f32) -> f32 {
    let next = x.next_down();
    if next.is_subnormal() { -f32::MIN_POSITIVE } else { next }
}
