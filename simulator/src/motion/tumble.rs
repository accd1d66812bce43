//! Tumbles of swimmers.

use crate::model::Model;
use crate::model::boundary::Boundary;
use crate::model::chemotaxis::{Attractant, Chemotaxis};
use crate::random::gaussian::direction;
use crate::random::philox::probability_threshold;

#[derive(Clone, Debug)]
pub(crate) struct TumbleStep {
    /// Largest word of a tumble without a gradient.
    pub(crate) up_to: u32,
    /// Without a gradient.
    pub(crate) probability: f64,
    /// In µm/s.
    speed: f32,
    taxis: Option<(Chemotaxis, Attractant)>,
}

/// Returns the probability p of a tumble in a step, x/(1 + x/2) for x = λΔt from 0 to 2.
///
/// The diffusion coefficient of runs is then v²Δt/3·(1/p − ½) = v²/(3λ) exactly. The probability 1 − exp(−x) would give
/// (x/2)·coth(x/2) times that. Above x = 2, p would exceed 1.
pub(crate) fn tumble_probability(tumbles: f64) -> f64 {
    tumbles / (1.0 + 0.5 * tumbles)
}

impl TumbleStep {
    pub(crate) fn new(model: &Model, species: usize) -> Option<Self> {
        let one = &model.species[species];
        let probability = tumble_probability(one.tumble_rate * model.time_step).min(1.0);
        let up_to = probability_threshold(probability).filter(|_| one.speed > 0.0)?;
        let taxis = one.chemotaxis.map(|taxis| (taxis, model.attractants[taxis.attractant as usize].clone()));
        Some(Self { up_to, probability, speed: one.speed as f32, taxis })
    }

    /// Gives a swimmer that tumbles a random direction.
    pub(crate) fn apply(
        &self,
        position: [f32; 3],
        velocity: &mut [f32; 3],
        words: [u32; 4],
        domain: &Boundary,
    ) {
        let [word, first, second, _] = words;
        let up_to = match &self.taxis {
            None => Some(self.up_to),
            Some((taxis, attractant)) => {
                let factor = taxis.rate_factor(attractant.at(position, domain), *velocity);
                probability_threshold((self.probability * factor).min(1.0))
            }
        };
        if up_to.is_some_and(|up_to| word <= up_to) {
            *velocity = domain.direction_within(direction(first, second)).map(|c| c * self.speed);
        }
    }
}
