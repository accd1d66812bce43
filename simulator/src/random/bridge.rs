//! The minimum of a path between the ends of a step.

use super::gaussian::ln;
use super::philox::open_unit;

/// Exponent x at or above which exp(−x) is below the smallest number of [`open_unit`].
pub(crate) const NEVER: f32 = 17.0;

/// Returns the lowest point of a Brownian bridge if it is below 0. `spread` is √(2DΔt); `word` returns random bits.
/// `wall.wgsl` has the same operations.
#[inline]
pub(crate) fn lowest([a, b]: [f32; 2], spread: f32, word: impl FnOnce() -> u32) -> Option<f32> {
    let square = spread * spread;
    if 2.0 * a * b >= NEVER * square {
        return None;
    }
    let lowest = 0.5 * (a + b - ((b - a) * (b - a) - 2.0 * square * ln(open_unit(word()))).sqrt());
    (lowest < 0.0).then_some(lowest)
}
