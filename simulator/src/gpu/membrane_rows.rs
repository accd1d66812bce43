//! Rows of the membranes that hold back a species.

use glam::UVec2;

use crate::model::membrane::{Membrane, MembraneSurface};
use crate::{Axis, Model};

pub(super) type Row = [u32; 4];

/// Largest number of spherical membranes of a species, as in `membrane_spheres.wgsl`.
pub(super) const MAX_SPHERES: usize = 100;

/// Rounding of a distance from a surface in single precision, in radii and in lengths of a periodic box.
const ROUNDING: [f32; 2] = [1e-6, 2e-7];

#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct MembraneRows {
    pub(super) planes: Vec<Row>,
    /// Two rows of each sphere.
    pub(super) spheres: Vec<Row>,
}

impl MembraneRows {
    pub(super) fn new(model: &Model, species: usize) -> Self {
        let mut rows = Self::default();
        let seen = (0..).zip(&model.membranes).filter(|(_, membrane)| membrane.sees[species]);
        for (k, membrane) in seen {
            match membrane.surface {
                MembraneSurface::Plane { axis, position } => {
                    rows.add_plane(model, species, (k, membrane), (axis, position));
                }
                MembraneSurface::Sphere { center, radius } => {
                    rows.add_sphere(model, species, (k, membrane), (center, radius));
                }
            }
        }
        rows
    }

    /// Adds a plane and its images in a periodic box.
    fn add_plane(
        &mut self,
        model: &Model,
        species: usize,
        (k, membrane): (u32, &Membrane),
        (axis, position): (usize, f32),
    ) {
        let (images, period) = match model.boundary.axes[axis] {
            Axis::Periodic { low, high } => (&[-1.0, 0.0, 1.0][..], high - low),
            _ => (&[0.0][..], 0.0),
        };
        let rate = (2.0 * membrane.permeability / model.species[species].diffusion) as f32;
        for image in images {
            let position = position + image * period;
            let row = [position, below(position), rate].map(f32::to_bits);
            self.planes.push([row[0], row[1], row[2], axis as u32 | k << 2]);
        }
    }

    fn add_sphere(
        &mut self,
        model: &Model,
        species: usize,
        (k, membrane): (u32, &Membrane),
        ([x, y, z], radius): ([f32; 3], f32),
    ) {
        let own = 2.0 * membrane.permeability * (model.time_step / model.species[species].diffusion).sqrt();
        let period = |axis: &Axis| match *axis {
            Axis::Periodic { low, high } => high - low,
            _ => 0.0,
        };
        let longest = model.boundary.axes.iter().map(period).fold(0.0, f32::max);
        let rounding = ROUNDING[0] * radius + ROUNDING[1] * longest;
        self.spheres.push([x, y, z, radius].map(f32::to_bits));
        self.spheres.push([(own as f32).to_bits(), k, rounding.to_bits(), 0]);
    }

    /// Returns the numbers of planes, with their images, and of spheres.
    pub(super) fn counts(&self) -> (usize, usize) {
        (self.planes.len(), self.spheres.len() / 2)
    }

    /// Returns the first row and the number of planes, then of spheres, after `first` other rows.
    pub(super) fn ranges(&self, first: usize) -> [UVec2; 2] {
        let (planes, spheres) = self.counts();
        [[first, planes], [first + planes, spheres]].map(|range| UVec2::from(range.map(|n| n as u32)))
    }
}

/// Returns the next number below, which devices do not flush to zero.
fn below(x: f32) -> f32 {
    let next = x.next_down();
    if next.is_subnormal() { -f32::MIN_POSITIVE } else { next }
}
