struct Params {
    key: vec2<u32>,
    species: u32,
    tallies: u32,
    first_reaction: u32,
    is_open: u32,
    max_iterations: u32,
    // 1 if pairs are listed, 0 if they are only counted.
    lists_pairs: u32,
    max_requeries: u32,
    // 1 if particles have velocities, and if arrivals are logged.
    has_velocity: u32,
    logs_arrivals: u32,
    time_step: f32,
    // Per axis: 0 open, 1 reflecting, 2 periodic.
    axes: vec3<u32>,
    // 1 plus the axis of the vessel; 0 without a vessel.
    vessel_axis: u32,
    low: vec3<f32>,
    vessel_radius: f32,
    high: vec3<f32>,
    // The displacement of Poiseuille flow on the axis of the vessel in a step.
    peak_flow: f32,
    vessel_center: vec3<f32>,
    largest_radius: f32,
    // 1 if particles collide, and if they exchange momentum.
    collides: u32,
    is_elastic: u32,
}
