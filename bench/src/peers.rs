//! What lazygrid is compared with: the trees that C++ and Rust programs take, the ways of earlier nanosimulators, and
//! a plain cell list as the yardstick. Each is a [`Search`](crate::measure::Search) with one exact test.

#[cfg(feature = "bullet")]
pub mod bullet;
pub mod cell_list;
mod class;
pub mod lammps;
pub mod octree;
pub mod parry;
pub mod sweep;
pub mod verlet;

use lazygrid::Sphere;

/// The exact test of all lazygrid detectors: in `f64`, which is needed only next to tangency.
#[inline]
fn touch(a: &Sphere, b: &Sphere) -> bool {
    let reach = a.radius + b.radius;
    let gap = a.center.distance_squared(b.center) - reach * reach;
    if gap.abs() > 1e-6 * reach * reach {
        return gap < 0.0;
    }
    let reach = f64::from(a.radius) + f64::from(b.radius);
    a.center.as_dvec3().distance_squared(b.center.as_dvec3()) <= reach * reach
}

/// Half the edge of a box around a sphere: a few ulp more than its radius, as the box's own rounding might lose a
/// pair in contact.
#[inline]
fn half_extent(sphere: &Sphere) -> f32 {
    sphere.radius + (sphere.center.abs().max_element() + sphere.radius) * f32::EPSILON
}

#[cfg(test)]
mod tests;
