// Expressions whose results depend on the order of evaluation.
//
// WGSL compilers may fuse and reorder floating-point operations; Metal's and DirectX's do by default. `opaque` hides a
// value by an exclusive or with a word that only the host knows to be 0. Other expressions stay within the tolerance in
// any order. `check/tests/gpu/fast_math.rs` reorders all kernels, with and without these guards.

fn opaque(value: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(value) ^ params.opaque_zero);
}

fn opaque3(value: vec3<f32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(value) ^ vec3(params.opaque_zero));
}

// Both terms are non-negative and nearly exact. Reordered as `2 * half - (|a| + |b|)`, small distances cancel: the
// relative error is 6e-4 at a period of 1000 and a distance of 0.1.
fn across_boundary(a: f32, b: f32, half: f32) -> f32 {
    return opaque(half - abs(a)) + opaque(half - abs(b));
}

// If the factor were distributed over the difference, the products would be infinite.
fn magnified(difference: f32, factor: f32) -> f32 {
    return opaque(difference) * factor;
}

// Adds a few ulp. Factored as `(|x| + r) * 2^-21`, the largest float would give an infinite sum.
fn box_half_width(position: vec3<f32>, radius: f32) -> vec3<f32> {
    return vec3(radius) + (opaque3(abs(position) * 0x1p-21) + vec3(radius) * 0x1p-21);
}

// Two kernels compare the bits of this product. If one distributed it, every call would rebuild the candidate list.
fn inflated_sum(radius: f32, half_skin: f32, factor: f32) -> f32 {
    return opaque(radius + half_skin) * factor;
}

// Returns a value below 2^27 times 2^100, through the exponent, or through the digits of subnormal values, which
// devices may flush. Compilers may combine two multiplications into one, which may be subnormal.
fn scaled_up(value: f32) -> f32 {
    let bits = bitcast<u32>(value);
    let subnormal = select(0x1p-49, -0x1p-49, bits >= 0x80000000u) * f32(bits & 0x007fffffu);
    return select(bitcast<f32>(bits + (100u << 23u)), subnormal, (bits & 0x7f800000u) == 0u);
}

// Returns a value times 2^-70, or 0 below the normal numbers. Compilers may combine two multiplications into one by an
// infinite factor.
fn scaled_down(value: f32) -> f32 {
    let bits = bitcast<u32>(value);
    return select(0.0, bitcast<f32>(bits - (70u << 23u)), (bits & 0x7f800000u) > (70u << 23u));
}
