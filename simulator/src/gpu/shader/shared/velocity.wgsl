// See release/mod.rs and simulation.rs.
const PURPOSE_VELOCITY: u32 = 2u;
// Draws for this purpose.
const VELOCITY_OF_PRODUCT: u32 = 1u;
const VELOCITY_OF_UNBOUND: u32 = 2u;
const VELOCITY_OF_SECOND_PRODUCT: u32 = 3u;

fn drawn_velocity(speed: f32, thermal_speed: f32, id: u32, draw: u32) -> vec3<f32> {
    let words = philox(vec4(id, draw, control.step, PURPOSE_VELOCITY), params.key);
    if (speed > 0.0) {
        return speed * direction_within(direction(words.x, words.y));
    }
    return thermal_speed * flattened(normals(words));
}

// Scales the velocity between two swimmers or two thermal speeds, else draws it.
fn converted_velocity(velocity: vec3<f32>, before: vec2<f32>, after: vec2<f32>, id: u32, draw: u32) -> vec3<f32> {
    if (all(before == after)) {
        return velocity;
    }
    if (before.x > 0.0 && after.x > 0.0) {
        return velocity * (after.x / before.x);
    }
    if (before.y > 0.0 && after.y > 0.0) {
        return velocity * (after.y / before.y);
    }
    return drawn_velocity(after.x, after.y, id, draw);
}
