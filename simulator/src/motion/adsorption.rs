//! Adsorption at a surface of given reactivity, and desorption.
//!
//! A surface of reactivity κ adsorbs κ times the local concentration, per area and time. S. S. Andrews (*Accurate
//! particle-based simulation of adsorption, desorption and partial transmission*, Physical Biology 6 (2009) 046015)
//! fits a probability for the ends of steps. For paths it has a closed form.
//!
//! *On a plane*, the density of particles that are not adsorbed is known (Carslaw and Jaeger, *Conduction of Heat in
//! Solids*, section 14.2). Divided by that before a reflecting wall, it gives the adsorption probability of a particle
//! that reaches the surface between the heights `a` and ±`b`:
//!
//! ```text
//! √π·X·erfcx(X + y),   X = κ√(Δt/D),   y = (a + b)/√(4DΔt),   erfcx(x) = exp(x²)·erfc(x)
//! ```
//!
//! *On a sphere* of radius R, r times the density obeys the equation of the half line r ≥ R, with κ + D/R for κ. In the
//! argument of erfcx, `X` becomes X + √(DΔt)/R. The free density is that of the half line with an image at −r, so a
//! path between the distances r₀ and r₁ is adsorbed with the probability
//!
//! ```text
//! (w·s(a + |b|) − exp(−r₀r₁/DΔt)·s(r₀ + r₁)) / (1 − exp(−r₀r₁/DΔt)),   w = exp(−ab/DΔt) for b > 0, else 1
//! ```
//!
//! with s for the expression above. This gives the adsorbed fraction of Collins and Kimball (*Diffusion-controlled
//! reaction rates*, Journal of Colloid Science 4 (1949) 425).
//!
//! *Desorption* follows from detailed balance: in equilibrium, as many particles desorb to each height as adsorb from
//! it. The total adsorbed from a uniform concentration ([`AdsorptionStep::volume`]) gives the probability. The equilibrium
//! constant is that of the rates at any time step.

use std::f64::consts::PI;

use crate::random::philox::Draws;
use crate::special::{ROOT_PI, erfcx};

/// Reactivity of `free` receptors on a sphere, in µm/s.
pub(crate) fn reactivity(binding_rate: f64, free: u32, radius: f64) -> f64 {
    binding_rate * f64::from(free) / (4.0 * PI * radius * radius)
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AdsorptionStep {
    /// √(DΔt).
    length: f64,
    /// In µm.
    radius: f64,
    /// κ√(Δt/D).
    scaled_reactivity: f64,
    /// `scaled_reactivity` + √(DΔt)/R.
    all: f64,
}

impl AdsorptionStep {
    /// `diffusion` is DΔt, with D the sum of both coefficients.
    pub(crate) fn new(diffusion: f64, time_step: f64, (radius, reactivity): (f64, f64)) -> Self {
        let length = diffusion.sqrt();
        let scaled_reactivity = reactivity * time_step / length;
        Self { length, radius, scaled_reactivity, all: scaled_reactivity + length / radius }
    }

    /// Returns s of the module's documentation.
    fn on_plane(&self, distances: f64) -> f64 {
        (ROOT_PI * self.scaled_reactivity * erfcx(self.all + distances / (2.0 * self.length))).min(1.0)
    }

    /// Returns the adsorption probability of a path that reaches the surface. Heights are negative inside.
    pub(crate) fn sticking(&self, [a, b]: [f64; 2]) -> f64 {
        let [from, to] = [self.radius + a, self.radius + b];
        let crossed = if b > 0.0 { a * b } else { 0.0 };
        let image = -libm::expm1((crossed - from * to) / (self.length * self.length));
        let [near, far] = [a + b.abs(), from + to].map(|distances| self.on_plane(distances));
        if image > 0.0 { (far + (near - far) / image).clamp(0.0, 1.0) } else { near }
    }

    /// Returns the factor of exp(−y²) in the adsorption probability from the height y·√(4DΔt).
    fn taken_from(&self, y: f64) -> f64 {
        erfcx(y) - erfcx(self.all + y)
    }

    /// Returns the volume whose particles a step adsorbs from a uniform concentration: κ·4πR²Δt if κ is small.
    pub(crate) fn volume(&self) -> f64 {
        let x = self.all;
        // The mean of erfcx(x√t) over t in [0, 1], without cancellation.
        let mean = match x < 1e-3 {
            true => 1.0 - 4.0 * x / (3.0 * ROOT_PI) + 0.5 * x * x,
            false => 2.0 / (x * x) * (0.5 * (erfcx(x) - 1.0) + x / ROOT_PI),
        };
        // D/(D + κR) and its complement.
        let free = self.length / (self.radius * x);
        4.0 * PI * self.radius.powi(2) * self.scaled_reactivity * self.length * (free + (1.0 - free) * mean)
    }

    /// Returns [`volume`](Self::volume) divided by κ·4πR²Δt, or 0 without reactivity.
    pub(crate) fn effective_fraction(&self) -> f64 {
        match self.scaled_reactivity > 0.0 {
            true => self.volume() / (4.0 * PI * self.radius.powi(2) * self.scaled_reactivity * self.length),
            false => 0.0,
        }
    }

    /// Draws a height, distributed as those before adsorption.
    pub(crate) fn height_after(&self, draws: &mut Draws) -> f64 {
        let scale = 2.0 * self.length;
        let max_density = self.taken_from(0.0) * (1.0 + FAR * scale / self.radius);
        let mut height = 0.0;
        for _ in 0..TRIALS {
            let [y, u] = [half_normal(draws), draws.unit()];
            height = y * scale;
            let density = self.taken_from(y) * (1.0 + height / self.radius);
            if y < FAR && u * max_density < density {
                break;
            }
        }
        height
    }
}

/// Largest height after desorption, in √(4DΔt).
const FAR: f64 = 5.0;
/// Largest number of rejection trials. About one in three succeeds, unless √(DΔt) is large compared with the radius.
const TRIALS: usize = 1000;

/// Draws |x| with the density ∝ exp(−x²).
fn half_normal(draws: &mut Draws) -> f64 {
    let [u, v] = [draws.unit(), draws.unit()];
    libm::sqrt(-libm::log(u)) * libm::cos(0.5 * PI * v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::philox::{Key, Purpose};

    fn collins_kimball(step: &AdsorptionStep, a: f64) -> f64 {
        let y = a / (2.0 * step.length);
        step.scaled_reactivity / step.all * libm::exp(-y * y) * step.taken_from(y)
    }

    fn over_heights(step: &AdsorptionStep, f: impl Fn(f64) -> f64) -> f64 {
        let (n, end) = (20_000, 14.0 * step.length);
        (0..n).map(|k| f((f64::from(k) + 0.5) * end / f64::from(n))).sum::<f64>() * end / f64::from(n)
    }

    const CASES: [(f64, f64, f64); 4] =
        [(0.01, 1.0, 1e-3), (0.01, 1.0, 3.0), (0.2, 1.0, 1e4), (1e-6, 2.0, 0.5)];

    fn steps() -> impl Iterator<Item = AdsorptionStep> {
        CASES
            .into_iter()
            .map(|(diffusion, radius, kappa)| AdsorptionStep::new(diffusion, 0.1, (radius, kappa)))
    }

    #[test]
    fn adsorbed_fractions_match_collins_and_kimball() {
        for step in steps() {
            let spread = |x: f64| {
                let scaled = x / (2.0 * step.length);
                libm::exp(-scaled * scaled) / (2.0 * step.length * ROOT_PI)
            };
            for a in [0.0, 0.3, 2.0].map(|a| a * step.length) {
                // Both signs of b weigh the same, if paths that end outside are weighted by their crossing probability.
                let sum = over_heights(&step, |b| 2.0 * spread(a + b) * step.on_plane(a + b));
                let expected = collins_kimball(&step, a);
                assert!((sum - expected).abs() < 1e-5 * expected.max(1e-9), "{step:?}: {sum} and {expected}");
            }
        }
    }

    #[test]
    fn adsorption_in_long_steps_matches_collins_and_kimball() {
        for (diffusion, radius, kappa) in
            [(0.04, 1.0, 3.0), (1.0, 1.0, 0.5), (9.0, 1.0, 5.0), (40.0, 0.5, 1.0)]
        {
            let step = AdsorptionStep::new(diffusion, 0.1, (radius, kappa));
            for a in [0.1, 0.5, 2.0].map(|a| a * radius) {
                let from = radius + a;
                let bell = |x: f64| {
                    let scaled = x / (2.0 * step.length);
                    libm::exp(-scaled * scaled) / (2.0 * step.length * ROOT_PI)
                };
                let adsorbed = |to: f64| {
                    let (b, free) = (to - radius, to / from * (bell(from - to) - bell(from + to)));
                    let hit = match b > 0.0 {
                        true => {
                            let image = libm::exp(-from * to / diffusion);
                            (libm::exp(-a * b / diffusion) - image) / (1.0 - image)
                        }
                        false => 1.0,
                    };
                    free * hit * step.sticking([a, b])
                };
                let (n, end) = (40_000, from + 12.0 * step.length);
                let width = end / f64::from(n);
                let sum = (0..n).map(|k| adsorbed((f64::from(k) + 0.5) * width)).sum::<f64>() * width;
                let expected = radius / from * collins_kimball(&step, a);
                assert!((sum / expected - 1.0).abs() < 1e-4, "{step:?} from {a}: {sum} and {expected}");
            }
        }
    }

    #[test]
    fn adsorption_from_a_concentration_is_the_sum_over_heights() {
        for step in steps() {
            let sum = over_heights(&step, |a| {
                4.0 * PI * step.radius * (step.radius + a) * collins_kimball(&step, a)
            });
            assert!((sum / step.volume() - 1.0).abs() < 1e-5, "{step:?}: {sum} and {}", step.volume());
        }
        let step = AdsorptionStep::new(0.01, 0.1, (1.0, 1e-6));
        assert!((step.volume() / (4.0 * PI * 1e-7) - 1.0).abs() < 1e-5);
        assert!((step.effective_fraction() - 1.0).abs() < 1e-5);
    }

    #[test]
    fn desorbed_heights_are_distributed_as_the_adsorbed() {
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

    #[test]
    fn an_infinite_reactivity_absorbs() {
        let step = AdsorptionStep::new(0.01, 0.1, (1e9, 1e9));
        assert!(
            (step.sticking([0.0; 2]) - 1.0).abs() < 1e-6 && (step.sticking([0.1, 0.2]) - 1.0).abs() < 1e-6
        );
    }

    /// Andrews' rule adsorbs a particle that ends beyond a plane with probability κ'√(2π) + O(κ'²), κ' = κΔt/√(2DΔt).
    #[test]
    fn weak_adsorption_matches_andrews() {
        let (diffusion, time_step, kappa) = (0.5, 1.0, 1e-4);
        let step = AdsorptionStep::new(diffusion, time_step, (1e9, kappa));
        let beyond = (diffusion / PI).sqrt();
        let andrews = beyond * kappa * (2.0 * PI).sqrt();
        let mean = step.volume() / (4.0 * PI * 1e18);
        assert!((mean / andrews - 1.0).abs() < 1e-3, "{mean} and {andrews}");
    }
}
