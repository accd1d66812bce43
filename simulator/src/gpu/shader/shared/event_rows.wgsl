struct ChemotaxisRow {
    center: vec3<f32>,
    profile: u32,
    gradient: vec3<f32>,
    // At the center, or at the surface of a source.
    level: f32,
    // Width, or radius of a source.
    size: f32,
    sensitivity: f32,
    saturates: u32,
    // Per step without a gradient.
    probability: f32,
}

struct SpeciesRow {
    drift: vec3<f32>,
    // Standard deviation along each axis.
    length: f32,
    diffusion: f32,
    radius: f32,
    // Rows in the table of events: receivers, decays, absorbing walls.
    events_begin: u32,
    decays_begin: u32,
    walls_begin: u32,
    events_end: u32,
    // Bound of the distance of a path from its chord.
    bend: f32,
    // Bounds the displacement of almost all particles.
    search_distance: f32,
    // Index among species with lists of receivers, or NOTHING.
    cell_lists: u32,
    speed: f32,
    thermal_speed: f32,
    // 1 if the species tumbles, and the largest word at which it does.
    tumbles: u32,
    tumble_threshold: u32,
    decay_rate: f32,
    // Per step, or 0; and the largest word at which the particle dissociates.
    dissociation_rate: f32,
    dissociation_threshold: u32,
    mobility: f32,
    // Bits of axes whose walls reflect diffusion with drift.
    drifts_at_wall: u32,
    // First row and number, of planes and of spheres.
    membrane_planes: vec2<u32>,
    membrane_spheres: vec2<u32>,
    taxis: ChemotaxisRow,
}

// A possible event of a species, in the order of precedence.
struct EventRow {
    drift: vec3<f32>,
    radius: f32,
    // D dt of the receiver.
    diffusion: f32,
    kind: u32,
    receiver: u32,
    // Largest word at which the particle decays or adsorbs.
    threshold: u32,
    product: u32,
    tally: u32,
    // sqrt(D dt) of particle and receiver together.
    length: f32,
    // Reactivity of a surface or of a free receptor: kappa sqrt(dt / D).
    scaled_reactivity: f32,
    unbinding: f32,
    // Fraction of the decay rate up to this channel.
    cumulative_fraction: f32,
    // Rows of receptors that bind the species, each with type and tally of occupied receptors.
    ligands_begin: u32,
    ligands_end: u32,
    receptor: u32,
    occupied: u32,
    // Concentration of the cosines in surface diffusion; 0 without.
    concentration: f32,
}

// Center at the beginning of a step.
struct ReceiverRow {
    center: vec3<f32>,
    displacement: vec3<f32>,
}

// Zero cells without lists.
struct ReceiverCellsHeader {
    low: vec3<f32>,
    cells_per_length: vec3<f32>,
    counts: vec3<u32>,
}

struct TrajectoryHeader {
    first: u32,
    // Rows of a step; 0 if all receivers rest.
    stride: u32,
    max_displacement: f32,
    // First row of the lists of receivers.
    cells_at: u32,
    cells: ReceiverCellsHeader,
}

struct Path {
    before: vec3<f32>,
    // Without walls and periodic images.
    end: vec3<f32>,
    after: vec3<f32>,
    velocity: vec3<f32>,
    // Without reflection.
    free_end: vec3<f32>,
    // Displacement apart from diffusion.
    drift: vec3<f32>,
}

fn at_rest(path: Path) -> Path {
    return Path(path.before, path.before, path.before, path.velocity, path.before, path.drift);
}

const ABSORBING: u32 = 0u;
const ENDPOINT: u32 = 1u;
const REFLECTING: u32 = 2u;
// Adsorption: by reactivity, by probability per step, by receptors.
const PARTIAL: u32 = 3u;
const PER_STEP: u32 = 4u;
const RECEPTORS: u32 = 5u;
const DECAY: u32 = 6u;
// The first face of the boundary, then the others.
const WALL: u32 = 7u;
