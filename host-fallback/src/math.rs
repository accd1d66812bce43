/// Returns the largest integer at most `at`. Unlike `f64::floor`, it is never a function call.
#[inline(always)]
pub(crate) fn floor(at: f64) -> i64 {
    let whole = at as i64;
    whole.saturating_sub(i64::from(at < whole as f64))
}

/// Returns the integer nearest to a number below 2⁵¹, or the even one of two. It compiles to two additions.
#[inline(always)]
pub(crate) fn nearest(at: f64) -> f64 {
    const ROUND: f64 = 1.5 * (1_u64 << 52) as f64;
    (at + ROUND) - ROUND
}
