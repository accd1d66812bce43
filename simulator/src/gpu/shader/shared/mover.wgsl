// See collisions/mover.rs and rules.rs.
struct Mover {
    // At the beginning of the step; the displacement until `time` is apart, for precision.
    base: vec3<f32>,
    id: u32,
    offset: vec3<f32>,
    time: f32,
    motion: vec3<f32>,
    radius: f32,
    own: vec3<f32>,
    mobility: f32,
}

struct NextEvent {
    time: f32,
    // The other particle, with PASSES if both overlapped at the beginning; a wall; or NOTHING.
    partner: u32,
    // 1 if the event happens in this round, or just happened.
    happens: u32,
    collided: u32,
    // Least id of an overlapping particle left to bounce.
    bounces_from: u32,
    begin: u32,
    count: u32,
}

// Walls, by axis and side, then the vessel.
const WALLS: u32 = 0x7ffffff0u;
const VESSEL_WALL: u32 = 0x7ffffff6u;
// An overlapping neighbor, which is passed through.
const PASSES: u32 = 0x80000000u;
const NEVER: f32 = 3e38;
const SLACK: f32 = 1.0 / 256.0;

fn offset_at(mover: Mover, time: f32) -> vec3<f32> {
    return mover.offset + (time - mover.time) * mover.motion;
}
