/// The whole number at or below; not that of `f64`, which is a call where the target lacks it.
#[inline(always)]
pub(crate) fn floor(at: f64) -> i64 {
    let whole = at as i64;
    whole.saturating_sub(i64::from(at < whole as f64))
}
