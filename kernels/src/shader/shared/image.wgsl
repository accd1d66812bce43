#ifdef PERIODIC
#include wrap

fn wrapped(coordinate: f32, period: f32) -> f32 {
    return bitcast<f32>(wrap(bitcast<u32>(coordinate), bitcast<u32>(period)));
}

// The sphere's image nearest to the origin.
fn image_of(sphere: vec4<f32>) -> vec4<f32> {
    return vec4(
        wrapped(sphere.x, call.period_x),
        wrapped(sphere.y, call.period_y),
        wrapped(sphere.z, call.period_z),
        sphere.w,
    );
}

#else
fn image_of(sphere: vec4<f32>) -> vec4<f32> {
    return sphere;
}
#endif
