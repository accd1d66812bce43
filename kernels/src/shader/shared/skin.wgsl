// The candidate list: the pairs that touch if every radius is larger by half the skin. While no sphere has moved farther
// than that since the list was built, it holds every pair that touches.

struct SkinParams {
    // Half of the skin, which is added to radii.
    half_skin: f32,
    // The square of the displacement limit, a little less than half the skin.
    limit_squared: f32,
    // The number of candidates that the buffer holds.
    candidate_capacity: u32,
}

// The state that is kept between calls.
struct SkinState {
    // Bits of the square of the largest displacement since the list was built.
    displacement: atomic<u32>,
    // 1 if some sphere was exchanged.
    input_changed: atomic<u32>,
    // 1 if the list holds all candidates.
    is_complete: u32,
    // The number of spheres.
    spheres: u32,
    // The reason for the rebuild of this call; 0 without a rebuild.
    rebuild_reason: u32,
    // The number of calls since the rebuild.
    age: u32,
    // The number of candidates.
    candidates: u32,
    // `displacement` of the last call.
    last_displacement: u32,
}
