// Devices may take any number below 2^-126 for 0, as an operand and as a result. A box is a sum of four, so that it has
// lost less than this when it is made of a radius that is so much larger. To a radius from 2^-96 on it adds nothing.
const FLUSHED: f32 = 0x1p-120;

#ifdef SPECIES
// Effective radius: half of the largest distance at which this sphere pairs, the radius where touching counts.
// `reach[s]` is (1 if some pair of s is decided by touching, half the largest interaction distance).
fn effective_radius(index: u32, sphere: vec4<f32>) -> f32 {
    let r = reach[species[index]];
    return select(r.y, max(r.y, sphere.w), r.x != 0.0) + FLUSHED;
}

fn is_accepted(index: u32, sphere: vec4<f32>) -> bool {
    return is_valid(sphere) && species[index] < call.species;
}
#else
fn effective_radius(index: u32, sphere: vec4<f32>) -> f32 {
    return sphere.w + FLUSHED;
}

fn is_accepted(index: u32, sphere: vec4<f32>) -> bool {
    return is_valid(sphere);
}
#endif
