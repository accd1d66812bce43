use glam::{DVec3, Vec3};

use super::basis::{heights, inverse};
use crate::{Space, Sphere};

/// Growth of an orthogonalized sphere, as a fraction of its coordinates: four times the rounding to `f32`, on three
/// axes.
const ROUNDING: f64 = 1.0 / (1 << 21) as f64;
/// Fraction of a sphere's distance from the origin that counts in the length scale of its rounding. [`ROUNDING`] times
/// this fraction, 2⁻⁴¹, exceeds the rounding of coordinates in `f64`.
const FAR: f64 = 1.0 / (1 << 20) as f64;
/// Growth of orthogonalized radii: above the error of a GPU, 5 ulp of the squared cutoff.
const RADIUS_MARGIN: f64 = 1.0 + 1.0 / (1 << 20) as f64;

/// The map from a triclinic cell to distances from the planes that pairs of basis vectors span. Their space is periodic
/// along the axes, and distances grow at most by `stretch`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orthogonalization {
    rank: usize,
    unit: f64,
    inverse: [DVec3; 3],
    /// The columns of `inverse`, as vectors of four lanes.
    columns: [[f64; 4]; 3],
    /// `f32` numbers for periodic axes, scales for others.
    lengths: [f64; 3],
    /// Upper bound of the factor by which a distance grows.
    stretch: f64,
    /// Longest periodic axis, to which the rounding of near coordinates is relative.
    longest: f64,
    /// Largest component of a near center. 0 if an axis is unbounded.
    near: f64,
    distances: Option<DistanceMap>,
}

/// The upper triangular map from a difference of orthogonalized coordinates to a vector as long as the distance in the
/// space times the growth of radii.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceMap {
    /// The upper triangle, row by row.
    pub rows: [f64; 6],
    /// Upper bound of the factor by which a difference grows, at most [`MAX_NORM`](Self::MAX_NORM).
    pub norm: f64,
}

impl DistanceMap {
    /// With larger factors, the rounding of coordinates could exceed the growth of radii for it.
    pub const MAX_NORM: f64 = 4.0;

    /// Orthogonalizes the columns of the inverse of `map`, so that lengths stay those of `inverse · difference`.
    fn from_inverse(map: [DVec3; 3], stretch: f64) -> Option<Self> {
        let [a, b, c] = inverse(&map).map(|column| column * stretch);
        let norm = norm_bound([a, b, c]);
        let first = a.normalize();
        let second = (b - first * first.dot(b)).normalize();
        let third = first.cross(second);
        let rows = [first.dot(a), first.dot(b), first.dot(c), second.dot(b), second.dot(c), third.dot(c)];
        let is_accurate = rows.iter().all(|number| number.is_finite()) && norm <= Self::MAX_NORM;
        is_accurate.then_some(Self { rows, norm })
    }
}

impl Orthogonalization {
    /// Scale of orthogonalized coordinates of `f32` spheres. Distances grow by up to √3, and none may exceed `f32`.
    pub const SCALE: f64 = 0.25;

    /// Returns the map of the first `rank` vectors of a basis. `inverse` holds the rows of the inverse.
    pub(super) fn from_basis(rank: usize, unit: f64, inverse: [DVec3; 3], scale: f64) -> Self {
        let heights = heights(&inverse);
        // A power of two, so that nothing is rounded twice.
        let factor = scale / unit;
        let lengths = [0, 1, 2].map(|k| match k < rank {
            true => f64::from(((heights[k] * factor) as f32).max(f32::MIN_POSITIVE)),
            false => heights[k] * factor,
        });
        let rows = [0, 1, 2].map(|k| inverse[k] * lengths[k]);
        let growth = norm_bound(rows);
        let longest = lengths[..rank].iter().fold(0.0, |longest, &length| length.max(longest));
        // Products of three numbers neither overflow nor underflow.
        let is_moderate = (1e-60..1e60).contains(&factor);
        let distances = is_moderate.then(|| DistanceMap::from_inverse(rows, growth)).flatten();
        let along = inverse.map(|row| row.abs().element_sum());
        let near = if rank == 3 { 1.0 / (FAR * along.into_iter().fold(0.0, f64::max)) } else { 0.0 };
        let columns = [0, 1, 2].map(|axis| [inverse[0][axis], inverse[1][axis], inverse[2][axis], 0.0]);
        Self { rank, unit, inverse, columns, lengths, stretch: growth * unit, longest, near, distances }
    }

    /// Returns the space of these coordinates.
    pub fn space(&self) -> Space {
        let length = |k: usize| (k < self.rank).then_some(self.lengths[k] as f32);
        Space::from_lengths([0, 1, 2].map(length))
    }

    pub(super) fn is_normal(&self) -> bool {
        let is_normal = |length: &f64| (*length as f32).is_normal() && *length > f64::from(f32::MIN_POSITIVE);
        self.lengths[..self.rank].iter().all(is_normal)
    }

    /// Returns `None` for cells of extreme size or shape.
    pub fn distance_map(&self) -> Option<DistanceMap> {
        self.distances
    }

    /// Returns `true` if [`sphere`](Self::sphere) enlarges radii for the rounding of coordinates by the least possible
    /// amount, for centers with components up to `largest`. Never if an axis is unbounded.
    pub fn has_least_growth(&self, largest: [f64; 3]) -> bool {
        self.is_near(DVec3::from(largest) * self.unit)
    }

    #[inline]
    fn is_near(&self, center: DVec3) -> bool {
        center.abs().cmplt(DVec3::splat(self.near)).all()
    }

    /// Orthogonalizes and wraps a valid sphere. Radii grow by `stretch` and by more than rounding, so touching spheres
    /// still touch. This growth hardly depends on the position, so a moving sphere keeps its radius. A sphere of radius
    /// `limit`, the maximum, must touch all others.
    pub fn sphere(&self, center: [f64; 3], radius: f64, limit: f64) -> Sphere {
        self.near_sphere(center, radius, limit)
            .unwrap_or_else(|| self.distant_sphere(DVec3::from(center) * self.unit, radius, limit))
    }

    /// Returns [`sphere`](Self::sphere) if its radius has the least growth. Compiles to vector code in the caller.
    #[inline(always)]
    pub fn near_sphere(&self, center: [f64; 3], radius: f64, limit: f64) -> Option<Sphere> {
        let center = center.map(|coordinate| coordinate * self.unit);
        if !center.iter().all(|coordinate| coordinate.abs() < self.near) {
            return None;
        }
        let [x, y, z] = &self.columns;
        let [a, b, c] = self.lengths;
        let lengths = [a, b, c, 0.0];
        let mut wrapped = [0.0_f32; 4];
        for lane in 0..4 {
            let fraction = x[lane] * center[0] + y[lane] * center[1] + z[lane] * center[2];
            let (at, half) =
                ((lengths[lane] * (fraction - nearest(fraction))) as f32, 0.5 * lengths[lane] as f32);
            let at = if at < -half { -half } else { at };
            wrapped[lane] = if at > half { half } else { at };
        }
        let [x, y, z, _] = wrapped;
        Some(Sphere { center: Vec3::new(x, y, z), radius: self.enlarged(radius, self.longest, limit) })
    }

    fn distant_sphere(&self, center: DVec3, radius: f64, limit: f64) -> Sphere {
        let mut orthogonal = Vec3::ZERO;
        // The box, or more if the sphere is far away.
        let mut scale = self.longest;
        for k in 0..3 {
            let length = self.lengths[k];
            let fraction = self.inverse[k].dot(center);
            let from_origin = length * self.inverse[k].abs().dot(center.abs());
            if k < self.rank {
                orthogonal[k] = self.wrapped(k, fraction - fraction.round());
            } else {
                orthogonal[k] = (length * fraction) as f32;
            }
            scale = scale.max(if k < self.rank { FAR * from_origin } else { from_origin });
        }
        if !(scale.is_finite() && orthogonal.is_finite()) {
            return Sphere { center: Vec3::ZERO, radius: limit as f32 };
        }
        let mut rounding = self.longest;
        while rounding < scale {
            rounding *= 16.0;
        }
        Sphere { center: orthogonal, radius: self.enlarged(radius, rounding, limit) }
    }

    #[inline]
    fn wrapped(&self, k: usize, fraction: f64) -> f32 {
        let half = 0.5 * self.lengths[k] as f32;
        ((self.lengths[k] * fraction) as f32).clamp(-half, half)
    }

    #[inline(always)]
    fn enlarged(&self, radius: f64, rounding: f64, limit: f64) -> f32 {
        let radius = (self.stretch * radius + ROUNDING * rounding) * RADIUS_MARGIN;
        let radius = if radius < limit { radius } else { limit };
        // The next larger number of a positive one.
        f32::from_bits((radius as f32).to_bits() + 1)
    }
}

/// Rounds a number below 2⁵¹ to the nearest integer, ties to even. It compiles to two additions.
#[doc(hidden)]
#[inline(always)]
pub fn nearest(number: f64) -> f64 {
    const ROUND: f64 = 1.5 * (1_u64 << 52) as f64;
    (number + ROUND) - ROUND
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
    (0.5 * logarithm).exp() * RADIUS_MARGIN
}
