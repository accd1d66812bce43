// The step of one species.
struct Kind {
    drift: vec3<f32>,
    // Standard deviation along each axis.
    length: f32,
    // D dt.
    diffusion: f32,
    radius: f32,
    // Its part of the table of fates: receivers, then decays.
    fates_begin: u32,
    decays_begin: u32,
    fates_end: u32,
    // By how far diffusion bends its way, beside a receiver that diffuses as well.
    bend: f32,
    // How far it gets about in a step, but for few, and where receivers come towards it farther by three ways of theirs: what
    // is in that reach is listed.
    reach: f32,
    // Its place among the species for which receivers are listed; NOTHING where they are not.
    lists: u32,
}

// What may befall a particle of one species, in the order of their precedence.
struct Fate {
    // Of a receiver: its drift in a step.
    drift: vec3<f32>,
    radius: f32,
    // D dt of the receiver.
    diffusion: f32,
    kind: u32,
    // The receiver's place in the model.
    receiver: u32,
    // The largest word at which it decays, or stays on a surface.
    up_to: u32,
    product: u32,
    tally: u32,
    // The square root of D dt of particle and receiver together.
    length: f32,
    // The reactivity of a surface, or of one free receptor, as adsorption.rs scales it: kappa sqrt(dt / D).
    own: f32,
    // How often what is bound comes off in a step.
    unbinding: f32,
}

// Where a receiver is at the beginning of a step, and where it goes in it.
struct Body {
    center: vec3<f32>,
    way: vec3<f32>,
}

// The cells by which receivers are listed; none if there are no lists.
struct Lists {
    low: vec3<f32>,
    per_edge: vec3<f32>,
    cells: vec3<u32>,
}

// The steps for which it is known where receivers are.
struct Journey {
    first: u32,
    // Rows of a step; 0 where all rest, and are where they are.
    stride: u32,
    // The longest way of one in a step.
    longest: f32,
    // Where in the rows the lists of receivers begin.
    lists_at: u32,
    lists: Lists,
}

// The way of a particle in a step.
struct Path {
    before: vec3<f32>,
    // Where it would be without walls and images.
    end: vec3<f32>,
    after: vec3<f32>,
}

const ABSORBING: u32 = 0u;
const ENDPOINT: u32 = 1u;
const REFLECTING: u32 = 2u;
// At a reactivity, with a probability per step, and by receptors.
const PARTIAL: u32 = 3u;
const PER_STEP: u32 = 4u;
const RECEPTORS: u32 = 5u;
const DECAY: u32 = 6u;

// Beyond this exponent the probability is below the smallest random number.
const NEVER: f32 = 17.0;
