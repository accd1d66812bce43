//! What stays on a surface of a given reactivity, and what comes off again, in a step of any length.
//!
//! A surface of reactivity κ takes κ times the concentration there, per area and time. Particles are looked at once in a
//! step, and a rule that takes each one that reaches the surface with the same probability is right for one time step
//! only. S. S. Andrews (*Accurate particle-based simulation of adsorption, desorption and partial transmission*,
//! Physical Biology 6 (2009) 046015) therefore corrects the probability for the step, by a fit to numbers for a rule
//! that sees particles at the ends of steps. Here the path between the ends counts (see [`crossing`](crate::crossing)),
//! and the correction has a closed form.
//!
//! *On a plane* the density of what diffuses and is not taken is known (Carslaw and Jaeger, *Conduction of Heat in
//! Solids*, section 14.2). Divided by that before a reflecting wall it says that of those that reach the surface on their way from
//! height `a` to height ±`b` there stays the part
//!
//! ```text
//! √π·X·erfcx(X + y),   X = κ√(Δt/D),   y = (a + b)/√(4DΔt),   erfcx(x) = exp(x²)·erfc(x)
//! ```
//!
//! *On a sphere* of radius R, r times the density obeys the equation of the plane with κ + D/R in place of κ. So
//! `X` in the argument of erfcx becomes X + √(DΔt)/R, the factor before it stays, and of those that begin a step at
//! height `a` the part is taken that Collins and Kimball found (*Diffusion-controlled reaction rates*, Journal of Colloid
//! Science 4 (1949) 425). That asks neither for short steps nor for a small κ.
//!
//! *Coming off* is the reverse. In equilibrium as many come off to a height as are taken from there, which gives both the
//! height of what comes off and, from all that is taken of a uniform concentration ([`Step::volume`]), how often
//! something does: the constant of equilibrium is that of the rates at any time step.

use std::f64::consts::PI;

use crate::philox::Draws;

/// √π
const ROOT_PI: f64 = 1.772_453_850_905_516;

/// exp(x²)·erfc(x) for x from 0 on.
pub(crate) fn erfcx(x: f64) -> f64 {
    if x < 25.0 {
        return libm::exp(x * x) * libm::erfc(x);
    }
    // Its asymptotic series, the first term left out of which is below 10⁻⁹ of it.
    let s = 1.0 / (2.0 * x * x);
    (1.0 - s * (1.0 - 3.0 * s * (1.0 - 5.0 * s))) / (x * ROOT_PI)
}

/// The reactivity of a sphere with so many free receptors, in µm/s.
pub(crate) fn reactivity(binding_rate: f64, free: u32, radius: f64) -> f64 {
    binding_rate * f64::from(free) / (4.0 * PI * radius * radius)
}

/// A step of diffusion before a sphere that takes particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Step {
    /// √(DΔt) in µm.
    length: f64,
    /// In µm.
    radius: f64,
    /// κ√(Δt/D)
    own: f64,
    /// The same with what the curvature adds.
    all: f64,
}

impl Step {
    /// A step before a sphere of a radius in µm and a reactivity in µm/s. `diffusion` is DΔt of both together, in µm².
    pub(crate) fn new(diffusion: f64, time_step: f64, (radius, reactivity): (f64, f64)) -> Self {
        let length = diffusion.sqrt();
        let own = reactivity * time_step / length;
        Self { length, radius, own, all: own + length / radius }
    }

    /// The part that stays, of those that reach the sphere on their way between such distances from its surface.
    pub(crate) fn sticking(&self, distances: f64) -> f64 {
        (ROOT_PI * self.own * erfcx(self.all + distances / (2.0 * self.length))).min(1.0)
    }

    /// What the probability has beside exp(−y²) that a particle is taken which begins at the height y·√(4DΔt).
    fn taken_from(&self, y: f64) -> f64 {
        erfcx(y) - erfcx(self.all + y)
    }

    /// The volume in µm³ of a uniform concentration that is taken in the step: κ·4πR²Δt where that is little.
    pub(crate) fn volume(&self) -> f64 {
        let x = self.all;
        // The mean of erfcx(x√t) over t from 0 to 1, without cancellation where x is small.
        let mean = match x < 1e-3 {
            true => 1.0 - 4.0 * x / (3.0 * ROOT_PI) + 0.5 * x * x,
            false => 2.0 / (x * x) * (0.5 * (erfcx(x) - 1.0) + x / ROOT_PI),
        };
        // D/(D + κR) and its complement.
        let free = self.length / (self.radius * x);
        4.0 * PI * self.radius.powi(2) * self.own * self.length * (free + (1.0 - free) * mean)
    }

    /// The part of `volume` that there would be if nothing were taken twice.
    pub(crate) fn effective_part(&self) -> f64 {
        match self.own > 0.0 {
            true => self.volume() / (4.0 * PI * self.radius.powi(2) * self.own * self.length),
            false => 0.0,
        }
    }

    /// The height at the end of the step of what came off in it, in µm, distributed as the heights from which
    /// a uniform concentration is taken.
    pub(crate) fn height_after(&self, draws: &mut Draws) -> f64 {
        let scale = 2.0 * self.length;
        let most = self.taken_from(0.0) * (1.0 + FAR * scale / self.radius);
        let mut height = 0.0;
        for _ in 0..TRIALS {
            let [y, u] = [half_normal(draws), draws.unit()];
            height = y * scale;
            let density = self.taken_from(y) * (1.0 + height / self.radius);
            if y < FAR && u * most < density {
                break;
            }
        }
        height
    }
}

/// Heights beyond this many times √(4DΔt) do not occur.
const FAR: f64 = 5.0;
/// Heights that are tried, at most; one in three or so is taken unless a step is long beside the sphere.
const TRIALS: usize = 1000;

/// A number of density 2/√π·exp(−y²) for y from 0 on.
fn half_normal(draws: &mut Draws) -> f64 {
    let [u, v] = [draws.unit(), draws.unit()];
    libm::sqrt(-libm::log(u)) * libm::cos(0.5 * PI * v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::philox::{Key, Purpose};

    /// (R + a)/R times the probability that Collins and Kimball give for what begins at height `a`.
    fn collins_kimball(step: &Step, a: f64) -> f64 {
        let y = a / (2.0 * step.length);
        step.own / step.all * libm::exp(-y * y) * step.taken_from(y)
    }

    /// The sum of `f` over heights, by the midpoint rule.
    fn over_heights(step: &Step, f: impl Fn(f64) -> f64) -> f64 {
        let (n, end) = (20_000, 14.0 * step.length);
        (0..n).map(|k| f((f64::from(k) + 0.5) * end / f64::from(n))).sum::<f64>() * end / f64::from(n)
    }

    const CASES: [(f64, f64, f64); 4] =
        [(0.01, 1.0, 1e-3), (0.01, 1.0, 3.0), (0.2, 1.0, 1e4), (1e-6, 2.0, 0.5)];

    fn steps() -> impl Iterator<Item = Step> {
        CASES.into_iter().map(|(diffusion, radius, kappa)| Step::new(diffusion, 0.1, (radius, kappa)))
    }

    #[test]
    fn the_scaled_error_function_joins_its_series() {
        assert_eq!(erfcx(0.0), 1.0);
        // Abramowitz and Stegun, table 7.1, and 1/(x√π) far out.
        assert!((erfcx(1.0) - 0.427_583_576_2).abs() < 1e-9);
        assert!((erfcx(25.0) / erfcx(24.999_999) - 1.0).abs() < 1e-7);
        assert!((erfcx(1e6) * 1e6 * ROOT_PI - 1.0).abs() < 1e-12);
    }

    /// What stays of those that reach the surface adds up to what is taken, whatever the end: the ends of a path from
    /// height a lie at ±b with the density of diffusion, and the surface is reached between as `crossing` has it.
    #[test]
    fn what_sticks_is_what_collins_and_kimball_take() {
        for step in steps() {
            let spread = |x: f64| {
                let scaled = x / (2.0 * step.length);
                libm::exp(-scaled * scaled) / (2.0 * step.length * ROOT_PI)
            };
            for a in [0.0, 0.3, 2.0].map(|a| a * step.length) {
                // Both signs of b have the same weight, with the crossing of those that end outside.
                let sum = over_heights(&step, |b| 2.0 * spread(a + b) * step.sticking(a + b));
                let expected = collins_kimball(&step, a);
                assert!((sum - expected).abs() < 1e-5 * expected.max(1e-9), "{step:?}: {sum} and {expected}");
            }
        }
    }

    #[test]
    fn what_is_taken_of_a_concentration_is_the_sum_over_heights() {
        for step in steps() {
            let sum = over_heights(&step, |a| {
                4.0 * PI * step.radius * (step.radius + a) * collins_kimball(&step, a)
            });
            assert!((sum / step.volume() - 1.0).abs() < 1e-5, "{step:?}: {sum} and {}", step.volume());
        }
        // Little is taken: κ·4πR²Δt.
        let step = Step::new(0.01, 0.1, (1.0, 1e-6));
        assert!((step.volume() / (4.0 * PI * 1e-7) - 1.0).abs() < 1e-5);
        assert!((step.effective_part() - 1.0).abs() < 1e-5);
    }

    #[test]
    fn what_comes_off_is_spread_as_what_is_taken() {
        for (seed, step) in (0..).zip(steps()) {
            let n = 20_000;
            let draw = |id| step.height_after(&mut Draws::new(Key::new(seed), id, 0, Purpose::Unbinding));
            let heights: Vec<f64> = (0..n).map(draw).collect();
            let moment = |power: i32| {
                let density = |a: f64| (step.radius + a) * collins_kimball(&step, a);
                over_heights(&step, |a| a.powi(power) * density(a)) / over_heights(&step, density)
            };
            let mean = heights.iter().sum::<f64>() / f64::from(n);
            let error = ((moment(2) - moment(1).powi(2)) / f64::from(n)).sqrt();
            assert!((mean - moment(1)).abs() < 4.0 * error, "{step:?}: {mean} and {}", moment(1));
        }
    }

    /// The limit of strong adsorption on a plane: everything that reaches it stays.
    #[test]
    fn an_infinite_reactivity_absorbs() {
        let step = Step::new(0.01, 0.1, (1e9, 1e9));
        assert!((step.sticking(0.0) - 1.0).abs() < 1e-6 && (step.sticking(0.3) - 1.0).abs() < 1e-6);
    }

    /// On a plane, of what stands uniformly before it. Andrews' rule takes each particle that ends a step beyond the
    /// surface with probability κ'√(2π) + O(κ'²), κ' = κΔt/√(2DΔt); the same number sticks here where κ' is small.
    #[test]
    fn weak_adsorption_is_that_of_andrews() {
        let (diffusion, time_step, kappa) = (0.5, 1.0, 1e-4);
        let step = Step::new(diffusion, time_step, (1e9, kappa));
        // A uniform concentration sends √(DΔt/π) of its volume per area beyond the surface.
        let beyond = (diffusion / PI).sqrt();
        let andrews = beyond * kappa * (2.0 * PI).sqrt();
        let own = step.volume() / (4.0 * PI * 1e18);
        assert!((own / andrews - 1.0).abs() < 1e-3, "{own} and {andrews}");
    }
}
