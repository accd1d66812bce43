// Summand of radii. Devices may flush any number below 2^-126, as operand and as result. A box is a sum of four
// numbers, and this summand exceeds the loss. It does not change radii of 2^-96 and above.
const FLUSHED: f32 = 0x1p-120;

#ifdef SPECIES
// `species_params[s]` holds the flags of species s, and the bits of half the largest distance at which it pairs.
// TOUCHES: the species has pairs decided by contact. Above SIDE_SHIFT: the side of a cell list.
const TOUCHES: u32 = 1u;
const IDLE: u32 = 2u;
const SIDE_SHIFT: u32 = 8u;

// Half of the largest distance at which the sphere pairs, and at least its radius if contact decides some pairs.
fn effective_radius(index: u32, sphere: vec4<f32>) -> f32 {
    let own = species_params[species[index]];
    let half = bitcast<f32>(own.y);
    return select(half, max(half, sphere.w), (own.x & TOUCHES) != 0u) + FLUSHED;
}

fn is_accepted(index: u32, sphere: vec4<f32>) -> bool {
    return is_valid(sphere) && species[index] < params.species;
}

fn may_pair(index: u32, sphere: vec4<f32>) -> bool {
    return is_accepted(index, sphere) && (species_params[species[index]].x & IDLE) == 0u;
}
#else
fn effective_radius(index: u32, sphere: vec4<f32>) -> f32 {
    return sphere.w + FLUSHED;
}

fn is_accepted(index: u32, sphere: vec4<f32>) -> bool {
    return is_valid(sphere);
}

fn may_pair(index: u32, sphere: vec4<f32>) -> bool {
    return is_valid(sphere);
}
#endif
