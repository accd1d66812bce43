//! Swimmers whose tumble rate depends on a concentration.
//!
//! A swimmer of velocity v in a concentration c tumbles at the rate
//!
//! ```text
//! λ = λ₀·exp(−χ·v·∇B),   B = c or c/(K + c)
//! ```
//!
//! with the occupied fraction B of receptors of the dissociation constant K (M. Rivero, R. Tranquillo, H. Buettner and
//! D. Lauffenburger, *Transport models for chemotactic cell populations based on individual cell behavior*, Chemical
//! Engineering Science 44 (1989) 2881). A tumble takes a random direction, so directions in a constant gradient have
//! the stationary density ∝ 1/λ. With α = χ·v·|∇B| the drift velocity is
//!
//! ```text
//! v·(coth α − 1/α) ≈ χv²|∇B|/3   in three dimensions,   v·tanh α   in one
//! ```
//!
//! A step has a tumble with the probability λ₀Δt/(1 + λ₀Δt/2) times λ/λ₀. While this is at most 1, neither the
//! stationary density of directions nor the diffusion coefficient without a gradient, v²/(3λ₀), depends on the time
//! step.

use crate::model::Model;
use crate::model::boundary::{Axis, Boundary};
use crate::model::vessel::dot;

#[derive(Clone, Debug, PartialEq)]
pub struct Attractant {
    pub name: String,
    pub center: [f32; 3],
    pub profile: AttractantProfile,
}

/// A concentration, in any unit, by the displacement from the attractant's center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AttractantProfile {
    /// The `level` at the center plus a gradient, but not below 0.
    Linear {
        level: f64,
        /// Per µm.
        gradient: [f64; 3],
    },
    /// The `peak` times exp(−r²/2w²).
    Gaussian {
        peak: f64,
        /// w, in µm.
        width: f64,
    },
    /// The `peak` times R/r around a source of radius R, inside which it is constant.
    Source {
        peak: f64,
        /// R, in µm.
        radius: f64,
    },
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chemotaxis {
    pub attractant: u32,
    /// Sensitivity χ: in s over the unit of the concentration, with `half_saturation` in s. A negative one repels.
    pub sensitivity: f64,
    /// K, at which half of the receptors are occupied; `None` responds to the concentration itself.
    pub half_saturation: Option<f64>,
}

impl Attractant {
    /// Returns the concentration at a point, and its gradient per µm.
    pub fn at(&self, point: [f32; 3], boundary: &Boundary) -> (f64, [f64; 3]) {
        let r = boundary.displacement(self.center, point).map(f64::from);
        let square = dot(r, r);
        match self.profile {
            AttractantProfile::Linear { level, gradient } => {
                let c = level + dot(r, gradient);
                if c > 0.0 { (c, gradient) } else { (0.0, [0.0; 3]) }
            }
            AttractantProfile::Gaussian { peak, width } => {
                let c = peak * libm::exp(-square / (2.0 * width * width));
                (c, r.map(|x| -c * x / (width * width)))
            }
            AttractantProfile::Source { peak, radius } if square > radius * radius => {
                let c = peak * radius / square.sqrt();
                (c, r.map(|x| -c * x / square))
            }
            AttractantProfile::Source { peak, .. } => (peak, [0.0; 3]),
        }
    }

    /// Returns the largest gradient of B, per µm; for a Gaussian, the largest of samples.
    fn steepest(&self, half_saturation: Option<f64>) -> f64 {
        const SAMPLES_PER_WIDTH: f64 = 200.0;
        let response = |c: f64| half_saturation.map_or(1.0, |k| k / ((k + c) * (k + c)));
        match self.profile {
            // dB/dc is largest at c = 0.
            AttractantProfile::Linear { gradient, .. } => response(0.0) * dot(gradient, gradient).sqrt(),
            AttractantProfile::Gaussian { peak, width } => {
                // Beyond `half`, c is below K, and B follows c.
                let half = half_saturation.map_or(0.0, |k| (2.0 * (peak.ln() - k.ln()).max(0.0)).sqrt());
                let samples = ((half + 6.0) * SAMPLES_PER_WIDTH) as u32;
                let at = |k: u32| {
                    let r = width * f64::from(k) / SAMPLES_PER_WIDTH;
                    let c = peak * libm::exp(-r * r / (2.0 * width * width));
                    response(c) * c * r / (width * width)
                };
                (1..=samples).map(at).fold(0.0, f64::max)
            }
            // The gradient of B, K/(K + c)²·c²/(c₀R) with the peak c₀, rises with c up to the surface.
            AttractantProfile::Source { peak, radius } => response(peak) * peak / radius,
        }
    }
}

impl Chemotaxis {
    /// Returns λ/λ₀ at this velocity, in µm/s.
    pub(crate) fn rate_factor(&self, (c, gradient): (f64, [f64; 3]), velocity: [f32; 3]) -> f64 {
        let rise = dot(gradient, velocity.map(f64::from));
        let change = match self.half_saturation {
            Some(k) => rise * k / ((k + c) * (k + c)),
            None => rise,
        };
        libm::exp(-self.sensitivity * change)
    }
}

impl Model {
    pub(crate) fn largest_rate_factor(&self, species: usize) -> f64 {
        let species = &self.species[species];
        let Some(Chemotaxis { attractant, sensitivity, half_saturation }) = species.chemotaxis else {
            return 1.0;
        };
        let gradient = self.attractants[attractant as usize].steepest(half_saturation);
        libm::exp(sensitivity.abs() * species.speed * gradient)
    }

    pub(crate) fn faulty_attractant(&self) -> Option<(usize, String)> {
        (0..self.attractants.len()).find_map(|k| Some((k, self.fault_of_attractant(k)?)))
    }

    fn fault_of_attractant(&self, k: usize) -> Option<String> {
        let Attractant { name, center, profile } = &self.attractants[k];
        let fault = |what: &str| Some(format!("attractant {name} {what}"));
        let (level, size, gradient) = match *profile {
            AttractantProfile::Linear { level, gradient } => (level, 1.0, gradient),
            AttractantProfile::Gaussian { peak, width } => (peak, width, [0.0; 3]),
            AttractantProfile::Source { peak, radius } => (peak, radius, [0.0; 3]),
        };
        let is_finite = center.iter().all(|x| x.is_finite()) && gradient.iter().all(|g| g.is_finite());
        if !(is_finite && level.is_finite() && level >= 0.0 && size.is_finite() && size > 0.0) {
            return fault(
                "has an invalid number; make all finite, concentrations not negative, and lengths positive",
            );
        }
        let repeats = |k: usize| matches!(self.boundary.axes[k], Axis::Periodic { .. });
        if let Some(axis) = (0..3).find(|&k| gradient[k] != 0.0 && repeats(k)) {
            let axis = ["x", "y", "z"][axis];
            return fault(&format!(
                "rises along {axis}, which is periodic; put walls there, or take another profile"
            ));
        }
        let dimensions = self.boundary.dimensions();
        let leaves = (dimensions..3).any(|k| gradient[k] != 0.0 || center[k] != 0.0);
        leaves.then(|| {
            format!("attractant {name} leaves the {dimensions} dimensions; set other coordinates to 0")
        })
    }

    pub(crate) fn faulty_chemotaxis(&self, species: usize) -> Option<String> {
        let one = &self.species[species];
        let Chemotaxis { attractant, sensitivity, half_saturation } = one.chemotaxis?;
        let fault = |what: String| Some(format!("species {} {what}", one.name));
        if attractant as usize >= self.attractants.len() {
            return fault(format!(
                "follows attractant {attractant} but there are {}",
                self.attractants.len()
            ));
        }
        if !(one.speed > 0.0 && one.tumble_rate > 0.0) {
            return fault(
                "follows an attractant but does not swim; give it a speed and a tumble-rate".to_owned(),
            );
        }
        if !sensitivity.is_finite() {
            return fault(format!("has the sensitivity {sensitivity}; make it finite"));
        }
        let k = half_saturation.filter(|k| !(k.is_finite() && *k > 0.0))?;
        fault(format!("has the half-saturation {k}; make it positive and finite"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attractant(profile: AttractantProfile) -> Attractant {
        Attractant { name: "food".into(), center: [1.0, -2.0, 0.5], profile }
    }

    #[test]
    fn far_saturated_gaussian_is_steepest_where_half_of_the_receptors_are_occupied() {
        for (peak, k) in [(1e12, 1e-3), (1e100, 1e-100)] {
            let width = 2.0;
            let radius = width * (2.0_f64 * (f64::ln(peak) - f64::ln(k))).sqrt();
            let expected = radius / (4.0 * width * width);
            let steepest = attractant(AttractantProfile::Gaussian { peak, width }).steepest(Some(k));
            assert!((0.99..1.02).contains(&(steepest / expected)), "{peak:e}, {k:e}: {steepest}, {expected}");
        }
    }

    #[test]
    fn gradients_match_the_concentrations() {
        let profiles = [
            AttractantProfile::Linear { level: 5.0, gradient: [0.5, -1.0, 0.25] },
            AttractantProfile::Gaussian { peak: 3.0, width: 2.0 },
            AttractantProfile::Source { peak: 4.0, radius: 0.5 },
        ];
        for attractant in profiles.map(attractant) {
            let boundary = Boundary::periodic([-10.0; 3], [10.0; 3]);
            let [unsaturated, saturated] = [None, Some(2.0)].map(|k| attractant.steepest(k));
            for point in [[2.0, -1.0, 0.0], [-8.0, -2.5, 1.0], [1.25, -1.5, 0.75], [1.0, -2.0, 0.625]] {
                let (c, gradient) = attractant.at(point, &boundary);
                for axis in 0..3 {
                    let moved = |by: f32| {
                        let mut point = point;
                        point[axis] += by;
                        attractant.at(point, &boundary).0
                    };
                    let slope = (moved(0.0078125) - moved(-0.0078125)) / 0.015625;
                    assert!((slope - gradient[axis]).abs() < 2e-3, "{attractant:?}: {slope}, {gradient:?}");
                }
                let length = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
                assert!(length <= unsaturated * (1.0 + 1e-9), "{attractant:?}: {length}");
                let response = length * 2.0 / ((2.0 + c) * (2.0 + c));
                assert!(response <= saturated * (1.0 + 1e-9), "{attractant:?}: {response}");
            }
        }
    }

    #[test]
    fn occupied_receptors_saturate() {
        let taxis = Chemotaxis { attractant: 0, sensitivity: 2.0, half_saturation: Some(3.0) };
        // dB/dt = 3/(3 + 1)²·(0.5·2).
        let factor = taxis.rate_factor((1.0, [0.5, 0.0, 0.0]), [2.0, 9.0, 0.0]);
        assert!((factor.ln() + 2.0 * 3.0 / 16.0).abs() < 1e-12, "{factor}");
        let linear = Chemotaxis { half_saturation: None, ..taxis };
        assert!((linear.rate_factor((1.0, [0.5, 0.0, 0.0]), [-2.0, 0.0, 0.0]).ln() - 2.0).abs() < 1e-12);
    }
}
