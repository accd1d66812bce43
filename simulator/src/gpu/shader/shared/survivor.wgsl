// Whether a particle is still there at the end of the step.
fn survives(at: u32) -> bool {
    if (at >= control.count || moved[at].w < 0.0) {
        return false;
    }
    return atomicLoad(&claims[at].is_taken) == 0u || claims[at].product != NOTHING;
}
