// Velocities of particles, as in release/mod.rs and simulation.rs.
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

// Returns the velocity after a change of species; swimmers keep their direction. `speeds` are the speed of the old
// species, then speed and thermal speed of the new one.
fn converted_velocity(velocity: vec3<f32>, speeds: vec3<f32>, id: u32, draw: u32) -> vec3<f32> {
    if (speeds.x == speeds.y) {
        return velocity;
    }
    if (speeds.x > 0.0 && speeds.y > 0.0) {
        return velocity * (speeds.y / speeds.x);
    }
    return drawn_velocity(speeds.y, speeds.z, id, draw);
}
