// Summand of radii. Devices may flush numbers below 2^-126, as operands and results. A box sums four numbers, and this
// summand exceeds the loss. It leaves radii of 2^-95 and above unchanged.
const FLUSHED: f32 = 0x1p-120;

#ifdef SPECIES
const TOUCHES: u32 = 1u;
const IDLE: u32 = 2u;
const SIDE_SHIFT: u32 = 8u;

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
