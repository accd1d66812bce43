// What a particle is after its own step. One that is gone has a radius of -1 until the end of the step.
struct Moved {
    sphere: vec4<f32>,
    species: u32,
}

// The decay of a particle that nothing else befell.
fn decayed(sphere: vec4<f32>, species: u32, id: u32) -> Moved {
    let kind = kinds[species];
    if (kind.decays_begin == kind.fates_end) {
        return Moved(sphere, species);
    }
    let word = philox(vec4(id, 0u, control.step, PURPOSE_DECAY), params.key).x;
    for (var k = kind.decays_begin; k < kind.fates_end; k++) {
        let fate = fates[k];
        if (word > fate.up_to) {
            continue;
        }
        atomicAdd(&control.tallies[fate.tally], 1u);
        if (fate.product == NOTHING) {
            return Moved(vec4(sphere.xyz, -1.0), species);
        }
        // What is larger than it was may stand in a wall.
        let radius = kinds[fate.product].radius;
        return Moved(vec4(placed(sphere.xyz, radius), radius), fate.product);
    }
    return Moved(sphere, species);
}
