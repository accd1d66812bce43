//! Conversion of times to steps.

/// Returns the first step that begins at `time` or later, both in s; `None` if its number exceeds 32 bits.
pub fn step_of(time: f64, time_step: f64) -> Option<u32> {
    // A time that rounding separates from a multiple of Δt belongs to that multiple.
    let steps = (time / time_step - 1e-6).ceil().max(0.0);
    (steps < f64::from(u32::MAX)).then_some(steps as u32)
}
