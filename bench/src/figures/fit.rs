//! How time grows with the number of spheres.

/// The exponent `k` of `time ≈ c·nᵏ`, fitted by least squares in logarithms over the points from `from` spheres on;
/// none where there are fewer than three.
pub(super) fn exponent(points: &[(usize, f64)], from: usize) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points
        .iter()
        .filter(|&&(n, seconds)| n >= from && seconds > 0.0)
        .map(|&(n, seconds)| ((n as f64).ln(), seconds.ln()))
        .collect();
    if logs.len() < 3 {
        return None;
    }
    let count = logs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / count;
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
    fn powers_are_found() {
        let points: Vec<(usize, f64)> =
            [10, 100, 1000, 10_000, 100_000].map(|n| (n, 3e-9 * (n as f64).powf(1.25))).into();
        assert!((exponent(&points, 100).unwrap() - 1.25).abs() < 1e-9);
        assert_eq!(exponent(&points, 10_000), None);
    }
}
