// The receptors of a receiver; it may have none.
struct Receptors {
    count: u32,
    // Occupied receptors at the beginning of the step.
    bound: atomic<u32>,
    // Particles that request a receptor, and the beginning of their list in the list of all requests.
    requests: atomic<u32>,
    first: u32,
}

// A bound particle has its direction from the center in place of its position, and a radius of -2 minus the index of
// its event, which names the receiver. The detector pairs negative radii with nothing.
const BOUND_RADIUS: f32 = -2.0;

fn as_bound(direction: vec3<f32>, event: u32) -> vec4<f32> {
    return vec4(direction, BOUND_RADIUS - f32(event));
}

fn event_of_bound(sphere: vec4<f32>) -> u32 {
    return u32(BOUND_RADIUS - sphere.w);
}
