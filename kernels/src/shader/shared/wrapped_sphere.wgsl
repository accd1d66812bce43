#ifdef PERIODIC
#include wrap

fn wrapped(coordinate: f32, period: f32) -> f32 {
    return bitcast<f32>(wrap(bitcast<u32>(coordinate), bitcast<u32>(period)));
}

fn wrapped_sphere(sphere: vec4<f32>) -> vec4<f32> {
    return vec4(
        wrapped(sphere.x, params.period_x),
        wrapped(sphere.y, params.period_y),
        wrapped(sphere.z, params.period_z),
        sphere.w,
    );
}

#else
fn wrapped_sphere(sphere: vec4<f32>) -> vec4<f32> {
    return sphere;
}
#endif
