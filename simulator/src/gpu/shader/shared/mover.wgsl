// Particles in motion, their next events and neighbors, as in collisions/mover.rs and rules.rs.
struct Mover {
    // The position at the beginning of the step, and the displacement from there at the time of the particle's clock. So
    // differences are exact to the last digits of displacements.
    base: vec3<f32>,
    id: u32,
    offset: vec3<f32>,
    time: f32,
    // The displacement per step.
    motion: vec3<f32>,
    radius: f32,
    // Its own velocity.
    own: vec3<f32>,
    // Reciprocal mass.
    mobility: f32,
}

struct NextEvent {
    time: f32,
    // Index of the other particle, with PASSES if both overlapped at the beginning of the step; a wall; or NOTHING.
    partner: u32,
    // 1 if the event happens in this round, or has just happened.
    happens: u32,
    collided: u32,
    // The least id of an overlapping particle that is left to bounce.
    bounces_from: u32,
    // Its list of neighbors.
    begin: u32,
    count: u32,
}

// Walls, by axis and side, then that of the vessel.
const WALLS: u32 = 0x7ffffff0u;
const VESSEL_WALL: u32 = 0x7ffffff6u;
// A neighbor that a particle passes through, listed because it overlaps.
const PASSES: u32 = 0x80000000u;
const NEVER: f32 = 3e38;
// See rounds.rs.
const SLACK: f32 = 1.0 / 256.0;

fn offset_at(mover: Mover, time: f32) -> vec3<f32> {
    return mover.offset + (time - mover.time) * mover.motion;
}
