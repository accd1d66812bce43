// Velocities stand in the second half of the buffers of particles.
fn velocity_at(at: u32) -> u32 {
    return arrayLength(&spheres) / 2u + at;
}
