/// Normal quantile for 95 %.
const Z: f64 = 1.959_963_984_540_054;

/// Returns the 95 % Wilson interval of a probability after `hits` in independent `trials`.
pub fn wilson(hits: u64, trials: u64) -> [f64; 2] {
    if trials == 0 {
        return [0.0, 1.0];
    }
    let (n, fraction) = (trials as f64, hits as f64 / trials as f64);
    let middle = fraction + Z * Z / (2.0 * n);
    let half = Z * (fraction * (1.0 - fraction) / n + Z * Z / (4.0 * n * n)).sqrt();
    let [low, high] = [middle - half, middle + half].map(|end| end / (1.0 + Z * Z / n));
    [if hits == 0 { 0.0 } else { low }, if hits == trials { 1.0 } else { high }]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The ends solve (p̂ − p)² = z²·p(1 − p)/n.
    #[test]
    fn ends_solve_the_equation_of_the_score_test() {
        for trials in [1, 10, 192, 100_000] {
            for hits in [0, 1, trials / 3, trials - 1, trials] {
                let fraction = hits as f64 / trials as f64;
                let [low, high] = wilson(hits, trials);
                assert!(
                    low <= fraction && fraction <= high && low >= 0.0 && high <= 1.0,
                    "{hits} of {trials}"
                );
                for end in [low, high].into_iter().filter(|end| (1e-12..1.0 - 1e-12).contains(end)) {
                    let [off, allowed] =
                        [(fraction - end).powi(2), Z * Z * end * (1.0 - end) / trials as f64];
                    assert!((off / allowed - 1.0).abs() < 1e-9, "{hits} of {trials}: {end}");
                }
            }
        }
        let [low, high] = wilson(0, 192);
        assert_eq!(low, 0.0);
        assert!((high - 0.019_615).abs() < 1e-5, "{high}");
        assert_eq!(wilson(0, 0), [0.0, 1.0]);
    }
}
