// What does not change in a run.
struct Params {
    key: vec2<u32>,
    species: u32,
    // How many tallies a step has, and where those of reactions begin.
    tallies: u32,
    first_reaction: u32,
    is_open: u32,
    // The most loop turns of the last rounds of a matching.
    turns: u32,
    // Whether pairs are listed, and not only counted.
    lists_pairs: u32,
    // How often a particle may look around for surfaces in a step.
    looks: u32,
    // By axis: 0 open, 1 reflecting, 2 periodic.
    axes: vec3<u32>,
    low: vec3<f32>,
    high: vec3<f32>,
}
