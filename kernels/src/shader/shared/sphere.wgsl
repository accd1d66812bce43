fn is_finite(value: f32) -> bool {
    return (bitcast<u32>(value) & 0x7f800000u) != 0x7f800000u;
}

// Tested by bits: comparisons with NaN may be optimised away.
fn is_valid(sphere: vec4<f32>) -> bool {
    return is_finite(sphere.x) && is_finite(sphere.y) && is_finite(sphere.z) && is_finite(sphere.w)
        && bitcast<u32>(sphere.w) <= 0x80000000u;
}

// Half extent of a sphere's box on each axis: a few ulp more than the radius, so that two spheres which any
// rounding of the distance test accepts always share a cell.
fn widened_radius(sphere: vec4<f32>, radius: f32) -> vec3<f32> {
    return vec3(radius) + (abs(sphere.xyz) + vec3(radius)) * 0x1p-21;
}
