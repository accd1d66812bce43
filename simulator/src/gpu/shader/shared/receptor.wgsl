struct Receptors {
    count: u32,
    // At the beginning of the step.
    bound: atomic<u32>,
    // Requests, and their beginning in the common list.
    requests: atomic<u32>,
    first: u32,
    // Tally of requests; the next one is of refused requests.
    tally: u32,
}

// The position of a bound particle is its direction from the center, its radius -2 minus its row in the table of
// events.
const BOUND_RADIUS: f32 = -2.0;

fn as_bound(direction: vec3<f32>, ligand: u32) -> vec4<f32> {
    return vec4(direction, BOUND_RADIUS - f32(ligand));
}

fn ligand_of_bound(sphere: vec4<f32>) -> u32 {
    return u32(BOUND_RADIUS - sphere.w);
}
