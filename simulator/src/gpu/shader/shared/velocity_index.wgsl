fn velocity_at(at: u32) -> u32 {
    return arrayLength(&spheres) / 2u + at;
}
