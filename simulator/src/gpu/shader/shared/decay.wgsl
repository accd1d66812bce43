// A particle after its own step. A removed particle has a radius of -1 until the end of the step.
struct Moved {
    sphere: vec4<f32>,
    species: u32,
}

// Decays a particle that had no other event.
fn decay(sphere: vec4<f32>, species: u32, id: u32) -> Moved {
    let kind = species_rows[species];
    if (kind.decays_begin == kind.events_end) {
        return Moved(sphere, species);
    }
    let word = philox(vec4(id, 0u, control.step, PURPOSE_DECAY), params.key).x;
    for (var k = kind.decays_begin; k < kind.events_end; k++) {
        let event = event_rows[k];
        if (word > event.threshold) {
            continue;
        }
        atomicAdd(&control.tallies[event.tally], 1u);
        if (event.product == NOTHING) {
            return Moved(vec4(sphere.xyz, -1.0), species);
        }
        // A larger product may overlap a wall.
        let radius = species_rows[event.product].radius;
        return Moved(vec4(confined(sphere.xyz, radius), radius), event.product);
    }
    return Moved(sphere, species);
}
