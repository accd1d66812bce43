// The constants of a run.
struct Params {
    key: vec2<u32>,
    species: u32,
    // Tallies of a step, and the first tally of reactions.
    tallies: u32,
    first_reaction: u32,
    is_open: u32,
    // The most loop iterations of the last rounds of a matching.
    max_iterations: u32,
    // 1 if pairs are listed, 0 if they are only counted.
    lists_pairs: u32,
    // The most searches for surfaces by a particle in a step.
    max_requeries: u32,
    // By axis: 0 open, 1 reflecting, 2 periodic.
    axes: vec3<u32>,
    low: vec3<f32>,
    high: vec3<f32>,
}
