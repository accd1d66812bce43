// The detector reads the particle count in the first word.
struct Control {
    count: u32,
    // At the beginning of the step, without bursts.
    alive: u32,
    incoming: u32,
    // Reasons of a halt, as bits that several threads may set.
    halted: atomic<u32>,
    step: u32,
    done: u32,
    logged: u32,
    // Bound particles, and those removed in this step: all pair with nothing.
    removed: atomic<u32>,
    pairs: u32,
    found_lo: u32,
    found_hi: u32,
    // Needed capacity, or the number of non-finite particles.
    missing_lo: u32,
    missing_hi: u32,
    // Surfaces near a particle, if above MAX_NEAR; requests, if above MAX_REQUESTS.
    near_surfaces: atomic<u32>,
    requests: atomic<u32>,
    // Remaining matching candidates, in either list.
    left: array<atomic<u32>, 2>,
    // Capacities: particles, second products, log entries.
    capacity: u32,
    max_births: u32,
    max_events: u32,
    // Factor of the top speed of collisions.
    speed_factor: f32,
    next_id: u32,
    born: atomic<u32>,
    // Log entries with this step's, and without.
    events: atomic<u32>,
    committed_events: u32,
    // Second products: output index, id, and log entry.
    born_at: u32,
    born_id: u32,
    born_event: u32,
    // Collisions and separated overlaps, now and in the last finished step.
    contacts: atomic<u32>,
    committed_contacts: u32,
    // This step's tallies, then all since the last readback.
    tallies: array<atomic<u32>>,
}

const PAIR_OVERFLOW: u32 = 1u;
const ENTRY_OVERFLOW: u32 = 2u;
const ROUNDS_LEFT: u32 = 4u;
const NOT_FINITE: u32 = 8u;
const TOO_MANY_SURFACES: u32 = 16u;
const TOO_MANY_REQUESTS: u32 = 32u;
const TOO_MANY_REQUERIES: u32 = 64u;
const UNFINISHED_SEARCH: u32 = 128u;
const BIRTH_OVERFLOW: u32 = 256u;
const PARTICLE_OVERFLOW: u32 = 512u;
const OUT_OF_IDS: u32 = 1024u;
const EVENT_OVERFLOW: u32 = 2048u;
const CANDIDATE_OVERFLOW: u32 = 4096u;
const WINDOW_ROUNDS_LEFT: u32 = 8192u;
const WINDOWS_LEFT: u32 = 16384u;
const TOO_FAST: u32 = 32768u;
const TOO_MANY_NEIGHBORS: u32 = 65536u;

const WORKGROUP_SIZE: u32 = 256u;
const NOTHING: u32 = 0xffffffffu;

fn global_index(group: vec3<u32>, groups: vec3<u32>, local_index: u32) -> u32 {
    return (group.x + group.y * groups.x) * WORKGROUP_SIZE + local_index;
}
