#include evaluation_order

#ifdef PERIODIC
// For an axis with this period, 0 for an unbounded axis; both coordinates lie within half a period of 0. Across the
// boundary the result is a distance, without a sign.
fn axis_displacement(a: f32, b: f32, period: f32) -> f32 {
    let half = 0.5 * period;
    let is_across = half > 0.0 && abs(a - b) > half;
    return select(a - b, across_boundary(a, b, half), is_across);
}

fn periods() -> vec3<f32> {
    return vec3(params.period_x, params.period_y, params.period_z);
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

fn periods() -> vec3<f32> {
    return vec3(0.0);
}

fn displacement(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return a - b;
}
#endif
