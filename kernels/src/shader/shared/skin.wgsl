// See layout.rs.

struct SkinParams {
    half_skin: f32,
    limit_squared: f32,
    candidate_capacity: u32,
}

struct SkinState {
    displacement: atomic<u32>,
    input_changed: atomic<u32>,
    is_complete: u32,
    spheres: u32,
    rebuild_reason: u32,
    age: u32,
    candidates: u32,
    last_displacement: u32,
}
