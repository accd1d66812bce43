/// States of a linear congruential generator, whose upper bits are random.
pub(super) fn random_states(seed: u64) -> impl FnMut() -> u64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state
    }
}

pub(super) fn random_fractions(seed: u64) -> impl FnMut() -> f64 {
    let mut states = random_states(seed);
    move || (states() >> 11) as f64 / (1_u64 << 53) as f64
}
