pub(crate) use lazygrid_kernels::nearest;

/// Returns the largest integer at most `at`. Unlike `f64::floor`, it is never a function call.
#[inline(always)]
pub(crate) fn floor(at: f64) -> i64 {
    let whole = at as i64;
    whole.saturating_sub(i64::from(at < whole as f64))
}
