#include displacement

// Returns the difference, which must be at most 2^-40, times 2^100.
fn scaled_axis_displacement(a: f32, b: f32, period: f32) -> f32 {
    if (max(abs(a), abs(b)) < 0x1p20) {
        // A periodic boundary farther away has no effect. Integers, because NVIDIA's compiler turns a `select` into a
        // minimum of floats, which flushes subnormal periods.
        let near_period = bitcast<f32>(min(bitcast<u32>(period), bitcast<u32>(0x1p22f)));
        return axis_displacement(scaled_up(a), scaled_up(b), scaled_up(near_period));
    }
    return magnified(axis_displacement(a, b, period), 0x1p100);
}

fn is_within_scaled(a: vec3<f32>, b: vec3<f32>, radii: vec2<f32>, large: bool) -> bool {
    let lengths = periods();
    if (large) {
        let d = vec3(
            axis_displacement(scaled_down(a.x), scaled_down(b.x), scaled_down(lengths.x)),
            axis_displacement(scaled_down(a.y), scaled_down(b.y), scaled_down(lengths.y)),
            axis_displacement(scaled_down(a.z), scaled_down(b.z), scaled_down(lengths.z)),
        );
        let s = scaled_down(radii.x) + scaled_down(radii.y);
        return dot(d, d) <= s * s;
    }
    let d = vec3(
        scaled_axis_displacement(a.x, b.x, lengths.x),
        scaled_axis_displacement(a.y, b.y, lengths.y),
        scaled_axis_displacement(a.z, b.z, lengths.z),
    );
    let s = scaled_up(radii.x) + scaled_up(radii.y);
    return dot(d, d) <= s * s;
}

fn is_within(a: vec3<f32>, b: vec3<f32>, radii: vec2<f32>) -> bool {
    let d = displacement(a, b);
    let s = radii.x + radii.y;
    let largest = max(max(abs(d.x), abs(d.y)), max(abs(d.z), s));
    if (largest < 0x1p60 && largest > 0x1p-40) {
        return dot(d, d) <= s * s;
    }
    return is_within_scaled(a, b, radii, largest >= 1.0);
}

// Tests without guards, for calls without extreme values.
fn is_within_ordinary(a: vec4<f32>, b: vec4<f32>) -> bool {
    let d = displacement(a.xyz, b.xyz);
    let s = a.w + b.w;
    return dot(d, d) <= s * s;
}

#ifdef SPECIES
// `table` holds a distance for each pair of species, or NEVER or TOUCH.
fn is_pair(a: vec4<f32>, b: vec4<f32>, species_a: u32, species_b: u32) -> bool {
    let distance = table[species_a * params.species + species_b];
    if (distance == NEVER) {
        return false;
    }
    return is_within(a.xyz, b.xyz, select(vec2(distance, 0.0), vec2(a.w, b.w), distance == TOUCH));
}
#else
fn is_pair(a: vec4<f32>, b: vec4<f32>) -> bool {
    return is_within(a.xyz, b.xyz, vec2(a.w, b.w));
}
#endif
