//! Decays of particles while they move.
//!
//! A particle may decay several times in a step: the first decay is drawn for the whole step, then its time, and the
//! product has the rest. Chains are therefore right at any step length.

use crate::model::Model;
use crate::random::philox::{Key, Purpose, probability_threshold};

/// Decays by species.
#[derive(Clone, Debug)]
pub struct Decays {
    /// Without decays into two products: [`Dissociation`](crate::reaction::dissociation::Dissociation).
    kinds: Vec<SpeciesDecays>,
    time_step: f64,
}

#[derive(Clone, Debug, Default)]
struct SpeciesDecays {
    rate: f64,
    channels: Vec<Channel>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Channel {
    /// Largest word at which it happens within a step.
    pub(crate) up_to: u32,
    /// Fraction of the rate up to this channel.
    pub(crate) share: f64,
    pub(crate) decay: u32,
    pub(crate) product: Option<u32>,
}

/// More are rare if a step is shorter than a hundred lifetimes.
const MOST: u32 = 1000;

impl Decays {
    pub fn new(model: &Model) -> Self {
        let kinds = (0..model.species.len() as u32).map(|species| kind(model, species)).collect();
        Self { kinds, time_step: model.time_step }
    }

    pub fn is_empty(&self) -> bool {
        self.kinds.iter().all(|kind| kind.channels.is_empty())
    }

    /// With rates k₁, k₂, … the probability 1 − exp(−ΣkΔt) is divided in proportion.
    #[cfg(feature = "gpu")]
    pub(crate) fn channels(&self, species: u32) -> &[Channel] {
        &self.kinds[species as usize].channels
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn rate(&self, species: u32) -> f64 {
        self.kinds[species as usize].rate
    }

    /// Calls `tell` with the model index and product of each decay of a particle in a step.
    #[inline]
    pub fn for_each_decay(
        &self,
        species: u32,
        (key, id, step): (Key, u32, u32),
        mut tell: impl FnMut(u32, Option<u32>),
    ) {
        let kind = &self.kinds[species as usize];
        if kind.channels.is_empty() {
            return;
        }
        let [word, when, ..] = key.draw(id, 0, step, Purpose::Decay);
        let Some(channel) = kind.channels.iter().find(|channel| word <= channel.up_to) else { return };
        tell(channel.decay, channel.product);
        if let Some(product) = channel.product.filter(|&product| self.kinds[product as usize].rate > 0.0) {
            let left = self.time_step - kind.wait(self.time_step, when);
            self.continue_chain(
                product,
                left,
                |generation| key.draw(id, generation, step, Purpose::Decay),
                tell,
            );
        }
    }

    /// Continues the decays for `left` s, with random words by generation, from 1.
    pub(crate) fn continue_chain(
        &self,
        mut species: u32,
        mut left: f64,
        words: impl Fn(u32) -> [u32; 4],
        mut tell: impl FnMut(u32, Option<u32>),
    ) {
        for generation in 1..=MOST {
            let kind = &self.kinds[species as usize];
            let [word, when, ..] = words(generation);
            let ratio = unit(word) / -libm::expm1(-kind.rate * left);
            let Some(channel) = kind.channels.iter().find(|channel| ratio < channel.share) else { return };
            tell(channel.decay, channel.product);
            let Some(product) = channel.product else { return };
            left -= kind.wait(left, when);
            species = product;
        }
    }
}

impl SpeciesDecays {
    fn wait(&self, time: f64, word: u32) -> f64 {
        -libm::log1p(unit(word) * libm::expm1(-self.rate * time)) / self.rate
    }
}

fn unit(word: u32) -> f64 {
    (f64::from(word) + 0.5) / 4_294_967_296.0
}

fn kind(model: &Model, species: u32) -> SpeciesDecays {
    if model.dissociates(species) {
        return SpeciesDecays::default();
    }
    let own = |decay: &crate::model::Decay| decay.reactant == species && decay.rate > 0.0;
    let decays = || model.decays.iter().enumerate().filter(|(_, decay)| own(decay));
    let rate: f64 = decays().map(|(_, decay)| decay.rate).sum();
    let probability = -libm::expm1(-rate * model.time_step);
    let mut share = 0.0;
    let channel = |(place, decay): (usize, &crate::model::Decay)| {
        share += decay.rate / rate;
        let up_to = probability_threshold(probability * share)?;
        Some(Channel { up_to, share, decay: place as u32, product: decay.products[0] })
    };
    SpeciesDecays { rate, channels: decays().filter_map(channel).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Decay, Species};

    #[test]
    fn a_chain_is_right_however_long_the_step() {
        let decay = |reactant, products, rate| Decay { reactant, products, rate, ..Decay::default() };
        let model = Model {
            time_step: 1.0,
            species: vec![Species { mass: 1.0, ..Species::default() }; 3],
            decays: vec![
                decay(0, [Some(1), None], 2.0),
                decay(1, [Some(2), None], 3.0),
                decay(2, [Some(0), Some(0)], 9.0),
            ],
            ..Model::default()
        };
        let decays = Decays::new(&model);
        let n = 100_000;
        let mut counts = [0_u32; 2];
        for id in 0..n {
            decays.for_each_decay(0, (Key::new(5), id, 7), |decay, product| {
                assert_eq!(product, Some(decay + 1));
                counts[decay as usize] += 1;
            });
        }
        let [a, b] = [(-2.0_f64).exp(), (-3.0_f64).exp()];
        for (count, p) in counts.into_iter().zip([1.0 - a, 1.0 - a - 2.0 * (a - b)]) {
            let n = f64::from(n);
            let error = (f64::from(count) - n * p) / (n * p * (1.0 - p)).sqrt();
            assert!(error.abs() < 4.0, "{count} and not {}: {error} standard errors", n * p);
        }
    }
}
