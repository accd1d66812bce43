// Candidates that outlive a call: the pairs that touch when every radius is larger by half the skin. As long as no sphere has
// gone farther than that since they were found, every pair that touches is among them.

struct SkinParams {
    // Half of the skin, by which radii grow.
    half_skin: f32,
    // The square of how far a sphere may go: a little less than that half.
    limit_squared: f32,
    // Candidates that there is room for.
    candidate_capacity: u32,
}

// What is known from call to call.
struct SkinState {
    // Bits of the square of how far the farthest sphere has gone since the candidates were found.
    displacement: atomic<u32>,
    // 1 where some sphere is not the one it was.
    input_changed: atomic<u32>,
    // 1 where the candidates are all that there are.
    is_complete: u32,
    // How many spheres there were.
    spheres: u32,
    // Why this call finds candidates anew; 0 where it keeps them.
    rebuild_reason: u32,
    // Calls since then.
    age: u32,
    // How many candidates there are.
    candidates: u32,
    // `moved` as the last call found it.
    last_displacement: u32,
}
