//! The binding radius of a rate constant, for steps of any length.
//!
//! Partners that react when they *end* a step within σ react more slowly than Smoluchowski's k = 4πDσ, because they
//! jump over the boundary and back. Andrews and Bray (*Phys. Biol.* 1, 137, 2004) tabulate the steady-state rate. Here
//! it is solved for: with s = √(2DΔt), u(r) = r·ρ(r), and ρ the density of partners right after a step, beyond σ,
//!
//! ```text
//! u(r) = ∫ from σ to ∞ of u(r′)·[G(r − r′) − G(r + r′)] dr′,    u(r) → r − c far away,
//! ```
//!
//! with the normal density G of width s. Then k = 4πDc: c = σ − 0.5826·s for short steps, and k = (4/3)πσ³/Δt for
//! long ones.
//!
//! *Reversible reactions.* If every pair that reacts dissociates to an unbinding radius r₀, nothing flows in
//! equilibrium, u(r) → r, and the density has a source at r₀,
//!
//! ```text
//! u(r) = ∫ from σ to ∞ of u(r′)·[G(r − r′) − G(r + r′)] dr′ + κ·[G(r − r₀) − G(r + r₀)]/(4πr₀),
//! ```
//!
//! with the volume κ: for a density of 1, κ pairs react per step, those that bind again at once included. So κ/Δt is
//! the rate constant of the law of mass action: with a dissociation rate k′, \[C\]/(\[A\]\[B\]) = κ/(k′Δt).
//!
//! *Deviations.* c and κ are of the order σ³, so that u would lose them to rounding. Here the deviation v(r) = r − u(r)
//! is solved for instead: r is a solution with σ = 0, hence
//!
//! ```text
//! v(r) = ∫ from σ to ∞ of v(r′)·[G(r − r′) − G(r + r′)] dr′ + ∫ from 0 to σ of r′·[G(r − r′) − G(r + r′)] dr′,
//! ```
//!
//! minus the source. v(r) → c or 0 far away. All of its terms are of the order σ³.

use crate::Error;

/// Largest √(2DΔt), in binding radii, at which partners rarely jump over each other; D is the sum of both coefficients.
/// In longer steps the rate holds for well-mixed partners only.
pub const LONG_STEP: f64 = 1.0;

/// Returns the longest time step, in s, at which partners rarely jump over each other.
pub fn longest_step(binding_radius: f64, diffusion: f64) -> f64 {
    (LONG_STEP * binding_radius).powi(2) / (2.0 * diffusion)
}

/// [`longest_step`] for a rate constant in µm³/s.
pub fn longest_step_for(rate: f64, diffusion: f64) -> f64 {
    let radius = rate / (4.0 * std::f64::consts::PI * diffusion * absorbed(LONG_STEP));
    longest_step(radius, diffusion)
}

/// Returns the binding radius, in µm, of a rate constant, in µm³/s. `diffusion` is the sum of both coefficients, in
/// µm²/s; `time_step` is in s.
///
/// With concentrations a and b, k·a·b reactions happen per volume and time, and k·a²/2 for A + A.
///
/// # Errors
/// [`Error::Model`] if an argument is not positive and finite.
pub fn binding_radius(rate: f64, diffusion: f64, time_step: f64) -> Result<f64, Error> {
    for (what, value) in
        [("rate constant", rate), ("diffusion coefficient", diffusion), ("time step", time_step)]
    {
        if !(value.is_finite() && value > 0.0) {
            return Err(Error::Model(format!("the {what} {value} must be positive and finite")));
        }
    }
    let step = (2.0 * diffusion * time_step).sqrt();
    // k rises with the radius from 0. At `low` it is at most `rate`, as partners are never denser near each other than
    // far away. At `high` it exceeds `rate` in the limits of short and long steps.
    let mixed = (rate * time_step * 3.0 / (4.0 * std::f64::consts::PI)).cbrt();
    let low = mixed.max(rate / (4.0 * std::f64::consts::PI * diffusion));
    Ok(root([low, low + step], |radius| rate_constant(radius, diffusion, time_step) - rate))
}

/// Returns the binding radius, in µm, whose equilibrium has the rate constant `rate`, if pairs dissociate to the
/// `unbinding` radius.
///
/// # Errors
/// See [`binding_radius`].
pub fn reversible_binding_radius(
    rate: f64,
    unbinding: f64,
    diffusion: f64,
    time_step: f64,
) -> Result<f64, Error> {
    // Pairs that bind again raise the rate, so the radius is smaller.
    let highest = binding_radius(rate, diffusion, time_step)?;
    let is = |radius| reversible_rate_constant(radius, unbinding, diffusion, time_step);
    Ok(root([1e-6 * highest, highest], |radius| is(radius) - rate))
}

/// Returns the rate constant in equilibrium, in µm³/s; inverts [`reversible_binding_radius`].
pub fn reversible_rate_constant(binding: f64, unbinding: f64, diffusion: f64, time_step: f64) -> f64 {
    let step = (2.0 * diffusion * time_step).sqrt();
    step.powi(3) / time_step * regained(binding / step, unbinding / step)
}

fn root([mut low, mut high]: [f64; 2], function: impl Fn(f64) -> f64) -> f64 {
    while high - low > 1e-9 * high {
        // Radii far below a step take many halvings of the interval, but few of its logarithm.
        let middle = if high > 4.0 * low { (low * high).sqrt() } else { 0.5 * (low + high) };
        if !(low < middle && middle < high) {
            break;
        }
        if function(middle) < 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Returns the rate constant, in µm³/s, of a binding radius; inverts [`binding_radius`].
pub fn rate_constant(binding_radius: f64, diffusion: f64, time_step: f64) -> f64 {
    let step = (2.0 * diffusion * time_step).sqrt() / binding_radius;
    4.0 * std::f64::consts::PI * diffusion * binding_radius * absorbed(step)
}

const POINTS: usize = 8;
const PANELS: usize = 12;
/// Distance from σ, in step lengths s, beyond which the density has its asymptotic form.
const ASYMPTOTIC_DISTANCE: f64 = 12.0;

/// Returns c for σ = 1 and s = `step`.
fn absorbed(step: f64) -> f64 {
    let b = 1.0 / step;
    let far = b + ASYMPTOTIC_DISTANCE;
    let beyond = |x: f64| upper(far - x) - upper(far + x);
    steady(b, [&|x| -beyond(x), &|_| -1.0]) / b
}

/// Returns κ in s³, for radii in step lengths s.
fn regained(binding: f64, unbinding: f64) -> f64 {
    if unbinding > binding + ASYMPTOTIC_DISTANCE / 2.0 {
        // Far away the density is harmonic: a pair that dissociates to r₀ binds again with the probability c/r₀.
        let c = binding * absorbed(1.0 / binding);
        return 2.0 * std::f64::consts::PI * c / (1.0 - c / unbinding);
    }
    let source = |x: f64| match unbinding > 1e-9 {
        true => kernel(x, unbinding) / (4.0 * std::f64::consts::PI * unbinding),
        false => x * gauss(x) / (2.0 * std::f64::consts::PI),
    };
    steady(binding, [&source, &|_| 0.0])
}

/// Solves for v beyond `b`, with lengths in s, and returns the other unknown, c or κ. `unknown` returns its
/// coefficients in the equation and at the last node, beyond which v has its asymptotic form.
fn steady(b: f64, unknown: [&dyn Fn(f64) -> f64; 2]) -> f64 {
    let nodes = panels(b, b + ASYMPTOTIC_DISTANCE);
    // From further inside no step arrives.
    let inside = panels((b - ASYMPTOTIC_DISTANCE).max(0.0), b);
    let n = nodes.len();
    let mut matrix = vec![vec![0.0; n + 2]; n + 1];
    for (row, &(x, _)) in nodes.iter().enumerate() {
        for (column, &(y, weight)) in nodes.iter().enumerate() {
            matrix[row][column] = f64::from(u8::from(row == column)) - weight * kernel(x, y);
        }
        matrix[row][n] = unknown[0](x);
        matrix[row][n + 1] = inside.iter().map(|&(y, weight)| weight * y * kernel(x, y)).sum();
    }
    matrix[n][n - 1] = 1.0;
    matrix[n][n] = unknown[1](nodes[n - 1].0);
    solve(matrix)
}

/// Returns G(x − y) − G(x + y) for positive numbers, without cancellation.
fn kernel(x: f64, y: f64) -> f64 {
    gauss(x - y) * -libm::expm1(-2.0 * x * y)
}

fn gauss(x: f64) -> f64 {
    (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt()
}

/// Probability that a standard normal number exceeds `x`.
fn upper(x: f64) -> f64 {
    0.5 * libm::erfc(x / std::f64::consts::SQRT_2)
}

fn panels(from: f64, to: f64) -> Vec<(f64, f64)> {
    /// Eight-point Gauss–Legendre rule, one half.
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

/// Returns the last unknown. Rows end with the right side.
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
            let volume = 2.0 * std::f64::consts::PI * step * step * absorbed(step);
            assert!(
                (volume / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 3.0 / step,
                "{step}: {volume}"
            );
        }
    }

    #[test]
    fn an_equilibrium_has_its_limits() {
        let (diffusion, time_step) = (1.0, 0.5e-4);
        let shifted = 1.0 - 0.582_597 * 0.01;
        for unbinding in [1.03, 1.1, 2.0] {
            let k = reversible_rate_constant(1.0, unbinding, diffusion, time_step);
            let expected = 4.0 * std::f64::consts::PI * shifted / (1.0 - shifted / unbinding);
            assert!((k / expected - 1.0).abs() < 2e-3, "{unbinding}: {k} and not {expected}");
        }
        let [near, far] = [5.999, 6.001].map(|by| regained(3.0, 3.0 + by));
        assert!((near / far - 1.0).abs() < 1e-3, "{near} {far}");
        let [close, point] = [1.001e-3, 0.999e-3].map(|unbinding| regained(2.0, unbinding));
        assert!((close / point - 1.0).abs() < 1e-5, "{close} {point}");
        for unbinding in [0.0, 1.0, 2.0] {
            let k = reversible_rate_constant(1.0, unbinding, 1.0, 5e3);
            let mixed = 4.0 / 3.0 * std::f64::consts::PI / 5e3;
            assert!((k / mixed - 1.0).abs() < 0.02, "{unbinding}: {k} and not {mixed}");
        }
        let radius = reversible_binding_radius(30.0, 1.2, 1.0, 1e-3).unwrap();
        assert!((reversible_rate_constant(radius, 1.2, 1.0, 1e-3) / 30.0 - 1.0).abs() < 1e-6);
    }

    /// Relative to its volume, a small ball absorbs 1 − ε, ε = (4/3)πb³·Σ over n of (2πn)^(−3/2): after n steps, its
    /// hole has spread to this density at the center. The next terms are of the order εb².
    #[test]
    fn rates_of_long_steps_match_well_mixed_partners() {
        const ZETA: f64 = 2.612_375_348_685_488;
        let pi = std::f64::consts::PI;
        for k in 0..=28 {
            let b = 10_f64.powf(-8.0 + 0.25 * f64::from(k));
            let missing = 4.0 / 3.0 * pi * b.powi(3) * ZETA / (2.0 * pi).powf(1.5);
            let absorbed_fraction = 1.5 * absorbed(1.0 / b) / (b * b);
            assert!(
                (absorbed_fraction - (1.0 - missing)).abs() < 1e-11 + missing * b * b + missing * missing,
                "{b}: {absorbed_fraction}"
            );
            // A pair that dissociates to the center fills the hole.
            let exchanged = 0.75 / pi * regained(b, 0.0) / b.powi(3);
            assert!((exchanged - 1.0).abs() < 1e-11 + missing * b * b, "{b}: {exchanged}");
        }
        for k in 5..=8 {
            let (sigma, time_step) = (10_f64.powi(-k), 0.5);
            let rate = 4.0 / 3.0 * pi * sigma.powi(3) / time_step;
            let radius = binding_radius(rate, 1.0, time_step).unwrap();
            assert!((radius / sigma - 1.0).abs() < 1e-8, "{sigma}: {radius}");
            let reversible = reversible_binding_radius(rate, 0.0, 1.0, time_step).unwrap();
            assert!((reversible / sigma - 1.0).abs() < 1e-8, "{sigma}: {reversible}");
        }
    }

    #[test]
    fn the_radius_gives_the_rate_back() {
        for (rate, diffusion, time_step) in
            [(1.0, 1.0, 1e-3), (12.0, 3.0, 1e-6), (0.5, 2.0, 10.0), (1e-9, 1.0, 10.0)]
        {
            let radius = binding_radius(rate, diffusion, time_step).unwrap();
            let back = rate_constant(radius, diffusion, time_step);
            assert!((back / rate - 1.0).abs() < 1e-6, "{rate}: {radius}, {back}");
        }
        assert!(binding_radius(0.0, 1.0, 1.0).is_err());
    }
}
