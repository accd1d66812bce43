struct Params {
    key: vec2<u32>,
    species: u32,
    tallies: u32,
    first_reaction: u32,
    is_open: u32,
    max_iterations: u32,
    lists_pairs: u32,
    max_requeries: u32,
    has_velocity: u32,
    logs_arrivals: u32,
    time_step: f32,
    // Per axis: 0 open, 1 reflecting, 2 periodic, 3 frozen.
    axes: vec3<u32>,
    // 1 plus the axis of a cylinder; 4 for a sphere, 0 without a vessel.
    vessel_axis: u32,
    low: vec3<f32>,
    vessel_radius: f32,
    high: vec3<f32>,
    // Displacement on the axis in a step.
    peak_flow: f32,
    vessel_center: vec3<f32>,
    largest_radius: f32,
    collides: u32,
    is_elastic: u32,
    // Time in which the flow is on, and the first row of a flow field.
    flow_duration: f32,
    field_at: u32,
    field_origin: vec3<f32>,
    field_spacing: vec3<f32>,
    // Zeros without a flow field.
    field_points: vec3<u32>,
}
