// The part of a step in which the neighbor lists are complete, as in collisions/mod.rs. Zeros begin a step.
struct Window {
    // Particles, or 0 if the step is over or the run is halted. The detector reads this word.
    count: u32,
    // Beginning and end, as fractions of the step.
    now: f32,
    horizon: f32,
    // Path length for which the lists suffice, the largest useful one, and the largest permitted speed.
    allowance: f32,
    largest_allowance: f32,
    top_speed: f32,
    pairs: u32,
    listed: atomic<u32>,
    fastest: atomic<u32>,
    // Bits of the earliest event's time, by parity of the round.
    earliest: array<atomic<u32>, 2>,
    // Box around all particles. Keys ascend from the highest coordinate down for the lower corner, up for the upper
    // one.
    lows: array<atomic<u32>, 3>,
    highs: array<atomic<u32>, 3>,
}

const LATER: u32 = 0x7f800000u;

// Returns true if the events of a round of this parity are after the window.
fn is_over(source: u32) -> bool {
    return window.count == 0u || bitcast<f32>(atomicLoad(&window.earliest[source])) > window.horizon;
}
