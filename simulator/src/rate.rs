//! From a rate constant to a binding radius, for steps of any length.
//!
//! With steps of length s = √(2DΔt) along each axis, partners that react when they *end* a step within σ of each other
//! react more slowly than Smoluchowski's k = 4πDσ, since they jump over the boundary and back. Andrews and Bray
//! (*Phys. Biol.* 1, 137, 2004), whose method Smoldyn uses, tabulate the rate at which a step of this kind reaches a
//! steady state. Here the same steady state is solved for: with u(r) = r·ρ(r), ρ the density of partners right after
//! a step, at distances above σ,
//!
//! ```text
//! u(r) = ∫ from σ to ∞ of u(r′)·[G(r − r′) − G(r + r′)] dr′,    u(r) → r − c far away,
//! ```
//!
//! G being the normal density of width s. Then k = 4πDc. Short steps give c = σ − 0.5826·s, long ones k = (4/3)πσ³/Δt.

use crate::Error;

/// Where √(2DΔt), D being the sum of both diffusion coefficients, is more than this part of the binding radius, partners
/// are so likely to jump over each other that the rate is right only for well-mixed partners; what happens near a
/// partner or a surface is not resolved.
pub const LONG_STEP: f64 = 1.0;

/// The longest time step, in s, that is not long beside the binding radius.
pub fn longest_step(binding_radius: f64, diffusion: f64) -> f64 {
    (LONG_STEP * binding_radius).powi(2) / (2.0 * diffusion)
}

/// The longest time step, in s, that is not long beside the binding radius that has the rate constant at that very
/// step: where the step is as long as it may be, a radius σ has the constant 4πDσ·c with a c that is known.
pub fn longest_step_for(rate: f64, diffusion: f64) -> f64 {
    let radius = rate / (4.0 * std::f64::consts::PI * diffusion * absorbed(LONG_STEP));
    longest_step(radius, diffusion)
}

/// The binding radius, in µm, that gives the rate constant `rate`, in µm³/s, to partners whose diffusion coefficients
/// add up to `diffusion`, in µm²/s, in steps of `time_step` s.
///
/// The rate constant is that per pair: with concentrations a and b, k·a·b reactions per volume and time, and for A + A
/// half of k·a².
///
/// # Errors
/// [`Error::Model`] where one of them is not positive and finite.
pub fn binding_radius(rate: f64, diffusion: f64, time_step: f64) -> Result<f64, Error> {
    for (what, value) in
        [("rate constant", rate), ("diffusion coefficient", diffusion), ("time step", time_step)]
    {
        if !(value.is_finite() && value > 0.0) {
            return Err(Error::Model(format!("the {what} {value} must be positive and finite")));
        }
    }
    let step = (2.0 * diffusion * time_step).sqrt();
    // k rises with the radius, from nothing; both limits of the rate lie above the rate itself.
    let mixed = (rate * time_step * 3.0 / (4.0 * std::f64::consts::PI)).cbrt();
    let [mut low, mut high] = [mixed, mixed.max(rate / (4.0 * std::f64::consts::PI * diffusion)) + step];
    while high - low > 1e-9 * high {
        let middle = 0.5 * (low + high);
        if rate_constant(middle, diffusion, time_step) < rate { low = middle } else { high = middle }
    }
    Ok(0.5 * (low + high))
}

/// The rate constant, in µm³/s, that a binding radius gives; see [`binding_radius`].
pub fn rate_constant(binding_radius: f64, diffusion: f64, time_step: f64) -> f64 {
    let step = (2.0 * diffusion * time_step).sqrt() / binding_radius;
    4.0 * std::f64::consts::PI * diffusion * binding_radius * absorbed(step)
}

/// Points of one panel of the quadrature, and panels.
const POINTS: usize = 8;
const PANELS: usize = 12;
/// Beyond this many steps the density has its asymptotic form.
const FAR: f64 = 12.0;

/// c of the equation above for σ = 1: the intercept of u, found on Gauss–Legendre panels by elimination.
fn absorbed(step: f64) -> f64 {
    // In units of the step the boundary is at b, and u = (x − c) + v(x) with v → 0.
    let b = 1.0 / step;
    let nodes: Vec<(f64, f64)> = panels(b, b + FAR);
    let n = nodes.len();
    let gauss = |x: f64| (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let kernel = |x: f64, y: f64| gauss(x - y) - gauss(x + y);
    // Unknowns: u at the nodes, and c. Beyond the last panel u = x − c, whose integral against the kernel is known.
    let far = b + FAR;
    let mut matrix = vec![vec![0.0; n + 2]; n + 1];
    for (row, &(x, _)) in nodes.iter().enumerate() {
        for (column, &(y, weight)) in nodes.iter().enumerate() {
            matrix[row][column] = f64::from(u8::from(row == column)) - weight * kernel(x, y);
        }
        let tail = |s: f64| upper(far - s);
        let first = (gauss(far - x) + x * tail(x)) - (gauss(far + x) - x * tail(-x));
        let mass = tail(x) - tail(-x);
        matrix[row][n] = mass;
        matrix[row][n + 1] = first;
    }
    // The line goes through the last node.
    let last = nodes[n - 1].0;
    matrix[n][n - 1] = 1.0;
    matrix[n][n] = 1.0;
    matrix[n][n + 1] = last;
    solve(matrix) / b
}

/// The part of a standard normal density above `x`.
fn upper(x: f64) -> f64 {
    0.5 * libm::erfc(x / std::f64::consts::SQRT_2)
}

/// Nodes and weights of panels of equal length.
fn panels(from: f64, to: f64) -> Vec<(f64, f64)> {
    /// Abscissae and weights of the Gauss–Legendre rule of eight points, for one half.
    const RULE: [(f64, f64); POINTS / 2] = [
        (0.183_434_642_495_649_8, 0.362_683_783_378_362),
        (0.525_532_409_916_329, 0.313_706_645_877_887_3),
        (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
        (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
    ];
    let half = (to - from) / PANELS as f64 / 2.0;
    let panel = |k: usize| {
        let middle = from + (2 * k + 1) as f64 * half;
        let left = RULE.iter().rev().map(move |&(x, w)| (middle - half * x, half * w));
        let right = RULE.iter().map(move |&(x, w)| (middle + half * x, half * w));
        left.chain(right)
    };
    (0..PANELS).flat_map(panel).collect()
}

/// The last unknown of a linear system given as rows with the right-hand side at their end.
fn solve(mut rows: Vec<Vec<f64>>) -> f64 {
    let n = rows.len();
    for column in 0..n {
        let size = |row: &usize| rows[*row][column].abs();
        let pivot = (column..n).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(column);
        rows.swap(column, pivot);
        let (above, below) = rows.split_at_mut(column + 1);
        let top = &above[column];
        for row in below {
            let factor = row[column] / top[column];
            row[column..].iter_mut().zip(&top[column..]).for_each(|(value, top)| *value -= factor * top);
        }
    }
    rows[n - 1][n] / rows[n - 1][n - 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_steps_shift_the_boundary_and_long_ones_mix() {
        for step in [0.01, 0.02, 0.05] {
            let c = absorbed(step);
            assert!((c - (1.0 - 0.582_597 * step)).abs() < 0.02 * step * step + 1e-5, "{step}: {c}");
        }
        for step in [30.0, 100.0] {
            // k·Δt = 4π·D·c·Δt = 2π·step²·c in units of the radius.
            let volume = 2.0 * std::f64::consts::PI * step * step * absorbed(step);
            assert!(
                (volume / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 3.0 / step,
                "{step}: {volume}"
            );
        }
    }

    #[test]
    fn the_radius_gives_the_rate_back() {
        for (rate, diffusion, time_step) in [(1.0, 1.0, 1e-3), (12.0, 3.0, 1e-6), (0.5, 2.0, 10.0)] {
            let radius = binding_radius(rate, diffusion, time_step).unwrap();
            let back = rate_constant(radius, diffusion, time_step);
            assert!((back / rate - 1.0).abs() < 1e-6, "{rate}: {radius}, {back}");
        }
        assert!(binding_radius(0.0, 1.0, 1.0).is_err());
    }
}
