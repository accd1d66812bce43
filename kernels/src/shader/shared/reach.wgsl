#ifdef SPECIES
// Effective radius: half of the largest distance at which this sphere pairs, the radius where touching counts.
// `reach[s]` is (1 if some pair of s is decided by touching, half the largest interaction distance). Never -0.0, whose
// bits are above those of every radius.
fn effective_radius(index: u32, sphere: vec4<f32>) -> f32 {
    let r = reach[species[index]];
    return abs(select(r.y, max(r.y, sphere.w), r.x != 0.0));
}

fn is_accepted(index: u32, sphere: vec4<f32>) -> bool {
    return is_valid(sphere) && species[index] < call.species;
}
#else
// Never -0.0, whose bits are above those of every radius.
fn effective_radius(index: u32, sphere: vec4<f32>) -> f32 {
    return abs(sphere.w);
}

fn is_accepted(index: u32, sphere: vec4<f32>) -> bool {
    return is_valid(sphere);
}
#endif
