// Whether a particle of a step that had `count` is still there at its end.
fn survives(at: u32, count: u32) -> bool {
    if (at >= count) {
        return false;
    }
    // Below that are those that receptors hold.
    let radius = moved[at].w;
    if (radius < 0.0 && radius > -2.0) {
        return false;
    }
    return atomicLoad(&claims[at].is_taken) == 0u || claims[at].product != NOTHING;
}
