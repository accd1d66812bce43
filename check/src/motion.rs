//! Spheres that move, and candidates that are kept meanwhile.

use lazygrid::{Skin, Sphere};

/// A skin in proportion to the scene: this part of some sphere's radius, or of the distance of two neighbours in the
/// list where it has none.
pub fn skin_of(spheres: &[Sphere], part: f32) -> Skin {
    let radius = spheres.iter().map(|sphere| sphere.radius).find(|&radius| radius > 0.0);
    let apart = |two: &[Sphere]| two[0].center.distance(two[1].center);
    let distance = spheres.windows(2).map(apart).find(|&distance| distance > 0.0);
    // A distance may be more than `f32` holds.
    match part * radius.or(distance).unwrap_or(1.0).min(f32::MAX) {
        0.0 => Skin::Auto,
        distance => Skin::Fixed(distance.clamp(1e-14, 1e17).into()),
    }
}

/// The largest radius, or 1 where there is none: what [`walk`] takes a part of.
pub(crate) fn stride(spheres: &[Sphere]) -> f32 {
    let radius = spheres.iter().map(|sphere| sphere.radius).fold(0.0, f32::max);
    if radius > 0.0 { radius.min(1e30) } else { 1.0 }
}

/// Moves the spheres by about this part of the largest of their radii, or of 1 where they have none.
pub fn walk(spheres: &mut [Sphere], part: f32, step: u32) {
    let far = part * stride(spheres);
    for (sphere, k) in spheres.iter_mut().zip(0_u32..) {
        let word = k.wrapping_mul(0x9e37_79b9).wrapping_add(step.wrapping_mul(0x85eb_ca6b));
        let turn = |by: u32| f32::from((word.rotate_left(by) >> 16) as u16) / 32768.0 - 1.0;
        let moved = sphere.center + glam::Vec3::new(turn(0), turn(9), turn(21)) * far;
        sphere.center = if moved.is_finite() { moved } else { sphere.center };
    }
}
