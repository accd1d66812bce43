#include fate_rows

fn body_in(receiver: u32, step: u32) -> Body {
    let row = 2u * ((step - journey.first) * journey.stride + receiver);
    return Body(bitcast<vec3<f32>>(bodies[row].xyz), bitcast<vec3<f32>>(bodies[row + 1u].xyz));
}

// Distance of a point from the surface of a sphere, negative inside.
fn height(radius: f32, center: vec3<f32>, point: vec3<f32>) -> f32 {
    let d = nearest(point - center);
    return sqrt(d.x * d.x + d.y * d.y + d.z * d.z) - radius;
}
