//! `scene.wgsl` makes the same spheres, bit for bit.

use lazygrid::Sphere;
use serde::Serialize;

/// Filled fraction of uniform scenes.
pub(super) const FILLING: f64 = 0.05;
/// Per sphere.
const BURST_PAIRS: f64 = 20.0;
/// In integer steps.
const HALF_SIDE_STEPS: f64 = (1 << 23) as f64;
/// Standard deviation of eight uniform integers below 2²¹: `2²¹ · √(8 / 12)`.
const BELL_SIGMA: f64 = 2_097_152.0 * 0.816_496_580_927_726;

#[derive(Debug, Serialize)]
pub(super) struct SceneKind {
    pub(super) name: &'static str,
    title: &'static str,
    is_burst: bool,
    seed: u32,
    radii: &'static [f32],
    giants: u32,
    giant_radius: f32,
}

const TEN_RADII: [f32; 10] =
    [1.0, 0.5, 0.25, 0.125, 0.0625, 0.031_25, 0.015_625, 0.007_812_5, 0.003_906_25, 0.001_953_125];

/// In the order of the page.
pub(super) const KINDS: [SceneKind; 5] = [
    SceneKind { seed: 1, ..uniform("equal", "Equal", &[1.0]) },
    SceneKind { seed: 2, ..uniform("five-sizes", "Five sizes", &[1.0, 0.5, 0.25, 0.125, 0.0625]) },
    SceneKind { seed: 3, ..uniform("ten-sizes", "Ten sizes", &TEN_RADII) },
    SceneKind { seed: 4, giants: 1, giant_radius: 6.0, ..uniform("giant", "A giant among grains", &[0.25]) },
    SceneKind { seed: 5, is_burst: true, ..uniform("burst", "The burst of the paper", &TEN_RADII) },
];

const fn uniform(name: &'static str, title: &'static str, radii: &'static [f32]) -> SceneKind {
    SceneKind { name, title, is_burst: false, seed: 0, radii, giants: 0, giant_radius: 0.0 }
}

impl SceneKind {
    pub(super) fn scale(&self, spheres: u32) -> f32 {
        let n = f64::from(spheres);
        let mean = |value: &dyn Fn(f64) -> f64| -> f64 {
            self.radii.iter().map(|&radius| value(radius.into())).sum::<f64>() / self.radii.len() as f64
        };
        if self.is_burst {
            // For small radii, n / 2 · Σ p_a p_b (4π / 3) (r_a + r_b)³ / (4π σ²)^(3/2) pairs per sphere.
            let cubes = mean(&|a| mean(&|b| (a + b).powi(3)));
            let sigma = (n / 2.0 * 4.0 / 3.0 * std::f64::consts::PI * cubes / BURST_PAIRS).cbrt()
                / (4.0 * std::f64::consts::PI).sqrt();
            return (sigma / BELL_SIGMA) as f32;
        }
        let giants = f64::from(self.giants) * f64::from(self.giant_radius).powi(3);
        let volume = 4.0 / 3.0 * std::f64::consts::PI * ((n - f64::from(self.giants)) * mean(&|r| r.powi(3)));
        // The giant takes space, but does not count as filling.
        let side = (volume / FILLING + giants * 8.0).cbrt();
        (side / 2.0 / HALF_SIDE_STEPS) as f32
    }

    pub(super) fn spheres(&self, count: u32, scale: f32) -> Vec<Sphere> {
        let word = |index: u32, stream: u32| {
            let mut x = index
                .wrapping_mul(0x9e37_79b1)
                .wrapping_add(stream.wrapping_mul(0x85eb_ca77))
                .wrapping_add(self.seed);
            x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
            x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
            x ^ x >> 16
        };
        let step = |index: u32, axis: u32| {
            let sum = match self.is_burst {
                true => (0..8).map(|k| word(index, 8 * axis + k + 8) >> 11).sum::<u32>(),
                false => word(index, axis) >> 8,
            };
            // Both values are below 2²⁴.
            (sum as i32 - (1 << 23)) as f32
        };
        let radius = |index: u32| {
            if index < self.giants {
                return self.giant_radius;
            }
            self.radii[(((word(index, 3) >> 16) * self.radii.len() as u32) >> 16) as usize]
        };
        (0..count)
            .map(|index| Sphere::new([0, 1, 2].map(|axis| step(index, axis) * scale), radius(index)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_as_dense_as_they_say() {
        for kind in &KINDS {
            let scale = kind.scale(20_000);
            let spheres = kind.spheres(20_000, scale);
            let volume: f64 = spheres[kind.giants as usize..]
                .iter()
                .map(|s| 4.0 / 3.0 * std::f64::consts::PI * f64::from(s.radius).powi(3))
                .sum();
            let side = 2.0 * HALF_SIDE_STEPS * f64::from(scale);
            if !kind.is_burst && kind.giants == 0 {
                let filled = volume / side.powi(3);
                assert!((0.8..1.2).contains(&(filled / FILLING)), "{}: {filled}", kind.name);
            }
            let half = side / 2.0;
            let inside =
                |s: &Sphere| s.center.to_array().iter().all(|&x| f64::from(x).abs() <= half * 1.000_001);
            assert!(kind.is_burst || spheres.iter().all(inside), "{} leaves its box", kind.name);
        }
    }
}
