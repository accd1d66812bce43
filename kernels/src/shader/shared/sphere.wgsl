#include evaluation_order

fn is_finite(value: f32) -> bool {
    return (bitcast<u32>(value) & 0x7f800000u) != 0x7f800000u;
}

// Compares bits: compilers may remove comparisons with NaN.
fn is_valid(sphere: vec4<f32>) -> bool {
    return is_finite(sphere.x) && is_finite(sphere.y) && is_finite(sphere.z) && is_finite(sphere.w)
        && bitcast<u32>(sphere.w) <= 0x80000000u;
}

const FARTHEST: f32 = 0x1.fffffcp+127;

// A box widened by a few ulp: two spheres that any rounding of the distance test accepts share a cell.
struct Box {
    low: vec3<f32>,
    high: vec3<f32>,
}

fn box_of(sphere: vec4<f32>, radius: f32) -> Box {
    let half = box_half_width(sphere.xyz, radius);
    return Box(
        clamp(sphere.xyz - half, vec3(-FARTHEST), vec3(FARTHEST)),
        clamp(sphere.xyz + half, vec3(-FARTHEST), vec3(FARTHEST)),
    );
}
