pub(crate) const ROOT_PI: f64 = 1.772_453_850_905_516;

/// Returns exp(x²)·erfc(x) for x ≥ 0.
pub(crate) fn erfcx(x: f64) -> f64 {
    if x < 25.0 {
        return libm::exp(x * x) * libm::erfc(x);
    }
    let s = 1.0 / (2.0 * x * x);
    (1.0 - s * (1.0 - 3.0 * s * (1.0 - 5.0 * s))) / (x * ROOT_PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scaled_error_function_joins_its_series() {
        assert_eq!(erfcx(0.0), 1.0);
        // Abramowitz and Stegun, table 7.1, and the limit 1/(x√π).
        assert!((erfcx(1.0) - 0.427_583_576_2).abs() < 1e-9);
        assert!((erfcx(25.0) / erfcx(24.999_999) - 1.0).abs() < 1e-7);
        assert!((erfcx(1e6) * 1e6 * ROOT_PI - 1.0).abs() < 1e-12);
    }
}
