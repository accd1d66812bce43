fn survives(at: u32, count: u32) -> bool {
    if (at >= count) {
        return false;
    }
    // Smaller values mark bound particles.
    let radius = moved[at].w;
    if (radius < 0.0 && radius > -2.0) {
        return false;
    }
    return atomicLoad(&claims[at].is_taken) == 0u || claims[at].product != NOTHING;
}
