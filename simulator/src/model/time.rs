/// Returns the first step at `time` or later, both in s; `None` above 32 bits.
pub fn step_of(time: f64, time_step: f64) -> Option<u32> {
    // Rounding may separate a time from its multiple of Δt.
    let steps = (time / time_step - 1e-6).ceil().max(0.0);
    (steps < f64::from(u32::MAX)).then_some(steps as u32)
}

/// Returns about the longest time step below one that does not fit, in s. It fits also if printed with three digits.
pub(crate) fn longest_step(time_step: f64, fits: impl Fn(f64) -> bool) -> f64 {
    let [mut low, mut high] = [0.0, time_step];
    while high - low > 1e-3 * high && high > f64::MIN_POSITIVE {
        let middle = 0.5 * (low + high);
        if fits(middle) { low = middle } else { high = middle }
    }
    // Rounding to three digits adds at most 0.5 %.
    0.995 * low
}
