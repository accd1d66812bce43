//! The peers of lazygrid, each a [`PairFinder`](crate::measure::PairFinder) with the same exact test.

#[cfg(feature = "bullet")]
pub mod bullet;
pub mod cell_list;
pub mod lammps;
pub mod octree;
pub mod parry;
mod size_class_grid;
pub mod sweep_and_prune;
pub mod verlet;

use lazygrid::Sphere;

/// Decides in `f64` near tangency, as lazygrid does.
#[inline]
fn touch(a: &Sphere, b: &Sphere) -> bool {
    let cutoff = a.radius + b.radius;
    let gap = a.center.distance_squared(b.center) - cutoff * cutoff;
    if gap.abs() > 1e-6 * cutoff * cutoff {
        return gap < 0.0;
    }
    let cutoff = f64::from(a.radius) + f64::from(b.radius);
    a.center.as_dvec3().distance_squared(b.center.as_dvec3()) <= cutoff * cutoff
}

/// A few ulp above the radius, so rounding loses no tangent pair.
#[inline]
fn half_extent(sphere: &Sphere) -> f32 {
    sphere.radius + (sphere.center.abs().max_element() + sphere.radius) * f32::EPSILON
}

#[cfg(test)]
mod tests;
