use glam::{DVec3, Vec3};

use super::basis::heights;
use crate::{Space, Sphere};

/// Growth of an orthogonalized sphere, as a fraction of its coordinates: four times the rounding to `f32`, on three
/// axes.
const ROUNDING: f64 = 1.0 / (1 << 21) as f64;
/// Fraction of a sphere's distance from the origin that counts in the length scale of its rounding. [`ROUNDING`] times
/// this fraction, 2⁻⁴¹, exceeds the rounding of coordinates in `f64`.
const FAR: f64 = 1.0 / (1 << 20) as f64;
/// Growth of orthogonalized radii: above the error of a GPU, 5 ulp of the squared cutoff.
const REACH_MARGIN: f64 = 1.0 + 1.0 / (1 << 20) as f64;

/// The map from a triclinic cell to distances from the planes that pairs of basis vectors span. Their space is periodic
/// along the axes, and distances grow at most by `stretch`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orthogonalization {
    rank: usize,
    unit: f64,
    inverse: [DVec3; 3],
    /// `f32` numbers for periodic axes, scales for others.
    lengths: [f64; 3],
    /// Upper bound of the factor by which a distance grows.
    stretch: f64,
}

impl Orthogonalization {
    /// Scale of orthogonalized coordinates of `f32` spheres. Distances grow by up to √3, and none may exceed `f32`.
    pub const SCALE: f64 = 0.25;

    /// Returns the map of the first `rank` vectors of a basis. `inverse` holds the rows of the inverse.
    pub(super) fn of_basis(rank: usize, unit: f64, inverse: [DVec3; 3], scale: f64) -> Self {
        let heights = heights(&inverse);
        // A power of two, so that nothing is rounded twice.
        let factor = scale / unit;
        let lengths = [0, 1, 2].map(|k| match k < rank {
            true => f64::from(((heights[k] * factor) as f32).max(f32::MIN_POSITIVE)),
            false => heights[k] * factor,
        });
        let rows = [0, 1, 2].map(|k| inverse[k] * lengths[k]);
        let stretch = norm_bound(rows) * unit;
        Self { rank, unit, inverse, lengths, stretch }
    }

    /// Returns the space of these coordinates.
    pub fn space(&self) -> Space {
        let length = |k: usize| (k < self.rank).then_some(self.lengths[k] as f32);
        Space::of_lengths([0, 1, 2].map(length))
    }

    pub(super) fn is_normal(&self) -> bool {
        let is_normal = |length: &f64| (*length as f32).is_normal() && *length > f64::from(f32::MIN_POSITIVE);
        self.lengths[..self.rank].iter().all(is_normal)
    }

    /// Orthogonalizes and wraps a valid sphere. Radii grow by `stretch` and by more than rounding, so touching spheres
    /// still touch. This growth hardly depends on the position, so a moving sphere keeps its radius. A sphere of radius
    /// `limit`, the maximum, must touch all others.
    pub fn sphere(&self, center: [f64; 3], radius: f64, limit: f64) -> Sphere {
        let center = DVec3::from(center) * self.unit;
        let mut orthogonal = Vec3::ZERO;
        // The box, or more if the sphere is far away.
        let mut scale = 0.0_f64;
        for k in 0..3 {
            let length = self.lengths[k];
            let part = self.inverse[k].dot(center);
            let from_origin = length * self.inverse[k].abs().dot(center.abs());
            if k < self.rank {
                let half = 0.5 * length as f32;
                orthogonal[k] = ((length * (part - part.round())) as f32).clamp(-half, half);
                scale = scale.max(length);
            } else {
                orthogonal[k] = (length * part) as f32;
            }
            scale = scale.max(if k < self.rank { FAR * from_origin } else { from_origin });
        }
        if !(scale.is_finite() && orthogonal.is_finite()) {
            return Sphere { center: Vec3::ZERO, radius: limit as f32 };
        }
        let base = self.lengths[..self.rank].iter().fold(0.0, |longest, &length| length.max(longest));
        let mut rounding = base;
        while rounding < scale {
            rounding *= 16.0;
        }
        let radius = (self.stretch * radius + ROUNDING * rounding) * REACH_MARGIN;
        Sphere { center: orthogonal, radius: (radius.min(limit) as f32).next_up() }
    }
}

/// Returns an upper bound of the largest singular value. The trace of the `p`-th power of a symmetric `n` × `n` matrix
/// lies between the `p`-th power of its largest eigenvalue and `n` times as much.
fn norm_bound(rows: [DVec3; 3]) -> f64 {
    const DOUBLINGS: i32 = 10;
    let mut products = glam::DMat3::from_cols(rows[0], rows[1], rows[2]);
    products = products.transpose() * products;
    let trace = |matrix: &glam::DMat3| matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z;
    let mut logarithm = 0.0_f64;
    for doubling in 0..=DOUBLINGS {
        // Keeps powers from overflowing.
        let size = trace(&products);
        logarithm += size.ln() / f64::from(1 << doubling);
        products *= size.recip();
        products = products * products;
    }
    (0.5 * logarithm).exp() * REACH_MARGIN
}
