//! Diffusion of bound particles on the surface of their receiver.
//!
//! A step draws the cosine w of the rotation from the density ∝ exp(kw) (von Mises and Fisher). Its mean
//! m = coth k − 1/k is that of diffusion on a sphere of radius R, exp(−2DΔt/R²). The mean of the second Legendre
//! polynomial, 1 − 3m/k, is exp(−6DΔt/R²) up to an error of (2DΔt/R²)³. A uniform density stays uniform.

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::model::Model;
use crate::model::vessel::dot;
use crate::motion::binding::Bound;
use crate::random::philox::{Purpose, StepKey, fine_unit};

#[derive(Clone, Debug)]
pub(crate) struct SurfaceSteps {
    /// Concentration k, by receiver; `None` without diffusion.
    concentrations: Vec<Option<f64>>,
}

impl SurfaceSteps {
    pub(crate) fn new(model: &Model) -> Self {
        let one = |receiver: &crate::Receiver| {
            let decay =
                2.0 * receiver.surface_diffusion * model.time_step / f64::from(receiver.radius).powi(2);
            (decay > 0.0).then(|| concentration(decay))
        };
        Self { concentrations: model.receivers.iter().map(one).collect() }
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn concentration_of(&self, receiver: usize) -> Option<f64> {
        self.concentrations[receiver]
    }

    pub(crate) fn advance(&self, bound: &mut [Bound], now: StepKey) {
        if self.concentrations.iter().all(Option::is_none) {
            return;
        }
        bound.par_iter_mut().with_min_len(256).for_each(|bound| {
            if let Some(concentration) = self.concentrations[bound.receiver as usize] {
                let [first, second, ..] = now.for_particle(bound.id).draw(0, Purpose::SurfaceDiffusion);
                let [first, second] = [first, second].map(fine_unit);
                let gap = gap(concentration, first);
                bound.direction = rotated(bound.direction, gap, TAU * second);
            }
        });
    }
}

/// Returns the concentration k with coth k − 1/k = exp(−decay).
fn concentration(decay: f64) -> f64 {
    let less = -libm::expm1(-decay);
    let mean = 1.0 - less;
    if mean < 1e-6 {
        // For k = 0 the density is uniform, but `gap` would divide by 0.
        return (3.0 * mean).max(1e-7);
    }
    let mut k = mean * (3.0 - mean * mean) / (less * (1.0 + mean));
    for _ in 0..8 {
        let excess = less - 1.0 / k + 2.0 / libm::expm1(2.0 * k);
        let slope = 1.0 / (k * k) - libm::sinh(k.min(350.0)).powi(-2);
        k -= excess / slope;
    }
    k
}

/// Returns 1 − w for a uniform number, without cancellation.
fn gap(concentration: f64, uniform: f64) -> f64 {
    let min_ratio = libm::expm1(-2.0 * concentration);
    (-libm::log1p((1.0 - uniform) * min_ratio) / concentration).clamp(0.0, 2.0)
}

/// Turns a direction by the angle with the cosine 1 − `gap`, towards an azimuth.
fn rotated(direction: [f32; 3], gap: f64, around: f64) -> [f32; 3] {
    let n = unit(direction.map(f64::from));
    // The axis with the smallest component gives a normal of length above ½.
    let axis = (0..3).min_by(|&a, &b| n[a].abs().total_cmp(&n[b].abs())).unwrap_or(0);
    let other: [f64; 3] = std::array::from_fn(|k| f64::from(u8::from(k == axis)));
    let u = unit(cross(n, other));
    let v = cross(n, u);
    let across = (gap * (2.0 - gap)).sqrt();
    let [sine, cosine] = [across * libm::sin(around), across * libm::cos(around)];
    unit(std::array::from_fn(|k| (1.0 - gap) * n[k] + cosine * u[k] + sine * v[k])).map(|x| x as f32)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    v.map(|x| x / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn concentration_has_the_mean_cosine_of_the_decay() {
        for decay in [1e-12_f64, 1e-6, 1e-3, 0.1, 1.0, 5.0, 13.0, 20.0, 50.0] {
            let k = concentration(decay);
            let less = 1.0 / k - 2.0 / libm::expm1(2.0 * k);
            let exact = -libm::expm1(-decay);
            assert!((less - exact).abs() < 1e-7 * exact, "{decay}: {k}, {less} and not {exact}");
        }
    }

    #[test]
    fn gaps_have_the_mean_of_the_density() {
        for decay in [1e-4_f64, 0.3, 4.0, 50.0] {
            let (k, n) = (concentration(decay), 100_000);
            let at = |i: u32| gap(k, (f64::from(i) + 0.5) / f64::from(n));
            let mean = (0..n).map(at).sum::<f64>() / f64::from(n);
            assert!((mean + libm::expm1(-decay)).abs() < 1e-4 * mean, "{decay}: {mean}");
            assert!((0..n).map(at).all(|gap| (0.0..=2.0).contains(&gap)));
        }
    }

    #[test]
    fn rotated_directions_have_the_angle() {
        for direction in [[1.0, 0.0, 0.0], [0.0, -0.6, 0.8], [0.577_350_26; 3]] {
            for gap in [1e-8, 0.3, 1.7, 2.0] {
                for around in [0.0, 1.0, 4.0] {
                    let found = rotated(direction, gap, around);
                    let cosine: f32 = direction.iter().zip(found).map(|(a, b)| a * b).sum();
                    assert!((f64::from(cosine) - (1.0 - gap)).abs() < 1e-6, "{direction:?} {gap}: {found:?}");
                }
            }
        }
    }
}
