// The part of a step in which the neighbor lists are complete; see collisions/mod.rs. Zeros begin a step.
struct Window {
    // 0 if the step is over, the run is halted or no particle moves. The detector reads this word.
    count: u32,
    // Fractions of the step.
    now: f32,
    horizon: f32,
    // Path length of the lists, the largest useful one, and the largest permitted speed.
    allowance: f32,
    largest_allowance: f32,
    top_speed: f32,
    pairs: u32,
    listed: atomic<u32>,
    fastest: atomic<u32>,
    // Bits of the earliest event's time, by parity of the round.
    earliest: array<atomic<u32>, 2>,
    // Keys descend with the coordinate for the lower corner of the box around all, and ascend for the upper one.
    lows: array<atomic<u32>, 3>,
    highs: array<atomic<u32>, 3>,
}

const LATER: u32 = 0x7f800000u;

fn is_over(source: u32) -> bool {
    return window.count == 0u || bitcast<f32>(atomicLoad(&window.earliest[source])) > window.horizon;
}
