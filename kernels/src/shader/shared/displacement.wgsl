#ifdef PERIODIC
// How far apart coordinates are along an axis with this period, or an unbounded one where it is 0. Both lie within
// half a period of 0, and across the seam parts are added that are not negative, so that no digits cancel.
fn axis_displacement(a: f32, b: f32, period: f32) -> f32 {
    let half = 0.5 * period;
    let across = (half - abs(a)) + (half - abs(b));
    return select(a - b, across, half > 0.0 && abs(a - b) > half);
}

fn periods() -> vec3<f32> {
    return vec3(params.period_x, params.period_y, params.period_z);
}

fn displacement(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    let lengths = periods();
    return vec3(axis_displacement(a.x, b.x, lengths.x), axis_displacement(a.y, b.y, lengths.y), axis_displacement(a.z, b.z, lengths.z));
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
