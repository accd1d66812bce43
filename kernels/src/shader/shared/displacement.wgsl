#include evaluation_order
#include periods

#ifdef PERIODIC
// Both coordinates must lie within half a period of 0. Across the boundary, the result has no sign.
fn axis_displacement(a: f32, b: f32, period: f32) -> f32 {
    let half = 0.5 * period;
    let is_across = half > 0.0 && abs(a - b) > half;
    return select(a - b, across_boundary(a, b, half), is_across);
}

fn displacement(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    let lengths = periods();
    return vec3(
        axis_displacement(a.x, b.x, lengths.x),
        axis_displacement(a.y, b.y, lengths.y),
        axis_displacement(a.z, b.z, lengths.z),
    );
}
#else
fn axis_displacement(a: f32, b: f32, period: f32) -> f32 {
    return a - b;
}

fn displacement(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return a - b;
}
#endif
