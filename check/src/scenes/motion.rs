use lazygrid::{Skin, Sphere};

/// Returns a skin of `skin_in_radii` times the first nonzero radius, clamped to 10⁻¹⁴ to 10¹⁷, or [`Skin::Auto`] if
/// the product is 0. Without such a radius, uses the first nonzero distance of consecutive spheres, or 1.
pub fn skin_of(spheres: &[Sphere], skin_in_radii: f32) -> Skin {
    let radius = spheres.iter().map(|sphere| sphere.radius).find(|&radius| radius > 0.0);
    let apart = |two: &[Sphere]| two[0].center.distance(two[1].center);
    let distance = spheres.windows(2).map(apart).find(|&distance| distance > 0.0);
    // `f32` may not hold the distance.
    match skin_in_radii * radius.or(distance).unwrap_or(1.0).min(f32::MAX) {
        0.0 => Skin::Auto,
        distance => Skin::Fixed(distance.clamp(1e-14, 1e17).into()),
    }
}

/// Returns the largest radius, at most 1e30, or 1 if all radii are 0.
pub(crate) fn stride(spheres: &[Sphere]) -> f32 {
    let radius = spheres.iter().map(|sphere| sphere.radius).fold(0.0, f32::max);
    if radius > 0.0 { radius.min(1e30) } else { 1.0 }
}

/// Moves each sphere by up to `strides` times the `stride` along each axis.
pub fn walk(spheres: &mut [Sphere], strides: f32, step: u32) {
    let far = strides * stride(spheres);
    for (sphere, k) in spheres.iter_mut().zip(0_u32..) {
        let word = k.wrapping_mul(0x9e37_79b9).wrapping_add(step.wrapping_mul(0x85eb_ca6b));
        let offset = |by: u32| f32::from((word.rotate_left(by) >> 16) as u16) / 32768.0 - 1.0;
        let moved = sphere.center + glam::Vec3::new(offset(0), offset(9), offset(21)) * far;
        sphere.center = if moved.is_finite() { moved } else { sphere.center };
    }
}
