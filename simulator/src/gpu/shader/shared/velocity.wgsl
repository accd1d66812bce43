// Velocities of particles, as in release/mod.rs and simulation.rs.
const PURPOSE_VELOCITY: u32 = 2u;
// Draws for this purpose.
const VELOCITY_OF_PRODUCT: u32 = 1u;
const VELOCITY_OF_UNBOUND: u32 = 2u;

fn drawn_velocity(speed: f32, thermal_speed: f32, id: u32, draw: u32) -> vec3<f32> {
    let words = philox(vec4(id, draw, control.step, PURPOSE_VELOCITY), params.key);
    if (speed > 0.0) {
        return speed * direction_within(direction(words.x, words.y));
    }
    return thermal_speed * flattened(normals(words));
}

// Returns the velocity after a change of species; swimmers keep their direction.
fn converted_velocity(velocity: vec3<f32>, from_speed: f32, to_speed: f32, to_thermal: f32, id: u32) -> vec3<f32> {
    if (from_speed == to_speed) {
        return velocity;
    }
    if (from_speed > 0.0 && to_speed > 0.0) {
        return velocity * (to_speed / from_speed);
    }
    return drawn_velocity(to_speed, to_thermal, id, VELOCITY_OF_PRODUCT);
}
