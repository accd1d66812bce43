// The receptors of a receiver; it may have none.
struct Receptors {
    count: u32,
    // How many are taken at the beginning of the step.
    held: atomic<u32>,
    // Particles that are to bind, if receptors are free for them, and where those begin in the list of all.
    bids: atomic<u32>,
    first: u32,
}

// A particle that is held stands for itself with its direction from the centre in place of its position, and with a
// radius of -2 less the place of its fate, which names the receiver. Nothing pairs with a radius below 0.
const HELD: f32 = -2.0;

fn as_held(direction: vec3<f32>, fate: u32) -> vec4<f32> {
    return vec4(direction, HELD - f32(fate));
}

fn fate_of_held(sphere: vec4<f32>) -> u32 {
    return u32(HELD - sphere.w);
}
