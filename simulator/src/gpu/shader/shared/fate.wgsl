#include fate_rows

fn body_in(receiver: u32, step: u32) -> Body {
    return bodies[(step - journey.first) * journey.stride + receiver];
}

// Distance of a point from the surface of a sphere, negative inside.
fn height(radius: f32, center: vec3<f32>, point: vec3<f32>) -> f32 {
    let d = nearest(point - center);
    return sqrt(d.x * d.x + d.y * d.y + d.z * d.z) - radius;
}
