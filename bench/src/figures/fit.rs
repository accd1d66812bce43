/// Fits `k` of `time ≈ c·xᵏ` to points (x, seconds) by least squares of logarithms. Returns `None` for fewer
/// than three points above 0.
pub(super) fn exponent(points: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let above_zero = points.filter(|&(x, seconds)| x > 0.0 && seconds > 0.0);
    let logs: Vec<(f64, f64)> = above_zero.map(|(x, seconds)| (x.ln(), seconds.ln())).collect();
    if logs.len() < 3 {
        return None;
    }
    let count = logs.len() as f64;
    let mean = |coordinate: fn(&(f64, f64)) -> f64| logs.iter().map(coordinate).sum::<f64>() / count;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let (mut covariance, mut variance) = (0.0, 0.0);
    for (a, b) in &logs {
        covariance += (a - x) * (b - y);
        variance += (a - x) * (a - x);
    }
    Some(covariance / variance)
}

#[cfg(test)]
mod tests {
    use super::exponent;

    #[test]
    fn exponents_of_powers_are_fitted() {
        let points = || [10.0_f64, 100.0, 1000.0, 1e4, 1e5].into_iter().map(|n| (n, 3e-9 * n.powf(1.25)));
        assert!((exponent(points().skip(1)).unwrap() - 1.25).abs() < 1e-9);
        assert!((exponent(points().chain([(0.0, 1.0), (1.0, 0.0)])).unwrap() - 1.25).abs() < 1e-9);
        assert_eq!(exponent(points().skip(3)), None);
    }
}
