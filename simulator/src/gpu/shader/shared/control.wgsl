// Where the run stands, on the device. The first word is how many particles the step in hand has; the detector
// reads it there.
struct Control {
    count: u32,
    // Particles at the beginning of the step, in front of those that a burst adds.
    alive: u32,
    incoming: u32,
    // Why the run stands still; 0 while it goes on.
    frozen: u32,
    // The step in hand, and how many are done.
    step: u32,
    done: u32,
    // Rows of the log that are filled.
    logged: u32,
    // Particles that a receiver or a decay removed in this step, and those that receptors hold: all that pair with nothing.
    gone: atomic<u32>,
    // Pairs that were written, and found, in this step.
    pairs: u32,
    found_lo: u32,
    found_hi: u32,
    // Entries of the detector's grid, particles that are not finite, surfaces near a particle, particles that come to the
    // receptors of one receiver, or looks around of a particle: what a frozen run lacks.
    lacking_lo: u32,
    lacking_hi: u32,
    // Candidates that are left to the matching, in either list.
    left: array<atomic<u32>, 2>,
    // Those of the step in hand, then those of all steps since the host looked.
    tallies: array<atomic<u32>>,
}

const NO_ROOM_FOR_PAIRS: u32 = 1u;
const NO_ROOM_FOR_ENTRIES: u32 = 2u;
const ROUNDS_LEFT: u32 = 4u;
const NOT_FINITE: u32 = 8u;
const TOO_MANY_NEAR: u32 = 16u;
const TOO_MANY_BIDS: u32 = 32u;
const THROWN_TOO_FAR: u32 = 64u;

const GROUP: u32 = 256u;
// No species, and nobody.
const NOTHING: u32 = 0xffffffffu;

// The place of a thread in a dispatch that may be laid out in two dimensions.
fn place_of(group: vec3<u32>, groups: vec3<u32>, lane: u32) -> u32 {
    return (group.x + group.y * groups.x) * GROUP + lane;
}
