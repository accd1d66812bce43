/// Returns the first step at `time` or later, both in s; `None` above 32 bits.
pub fn step_of(time: f64, time_step: f64) -> Option<u32> {
    // Rounding may separate a time from its multiple of Δt.
    let steps = (time / time_step - 1e-6).ceil().max(0.0);
    (steps < f64::from(u32::MAX)).then_some(steps as u32)
}
