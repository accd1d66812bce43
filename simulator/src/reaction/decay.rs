//! Decays of particles while they move.
//!
//! The first decay is drawn for the whole step, then its time, then a decay of the product in the rest: right at any
//! step length.
//!
//! A product draws its dissociation for a whole step from its own beginning: the process has no memory. If it is after
//! the step, the product is *spared*.
//!
//! A receiver or wall takes the species that exists at the hit (`CaptureOrder`), and none that dissociated before.
//! Products of a dissociation appear at the end of the path.
//!
//! Bimolecular reactions happen at the end of the step, without particles that dissociate in it. So a surface spares no
//! particle that a reaction consumes.

use crate::model::Model;
use crate::model::probability::ReactionProbabilities;
use crate::random::philox::{DrawContext, Purpose, fine_unit, probability_threshold};
use crate::reaction::dissociation::channel_words;

#[derive(Clone, Debug)]
pub struct Decays {
    /// Indexed by species; without channels for one that dissociates, whose decays are all in `Dissociation`.
    kinds: Vec<SpeciesDecays>,
    pub(crate) time_step: f64,
}

#[derive(Clone, Debug, Default)]
struct SpeciesDecays {
    /// In 1/s.
    rate: f64,
    channels: Vec<DecayChannel>,
    dissociation: Option<DissociationTime>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DissociationTime {
    /// Largest random word at which the particle dissociates.
    pub(crate) up_to: u32,
    /// Rate of all decays, per step.
    pub(crate) rate: f64,
}

impl DissociationTime {
    pub(crate) fn new(model: &Model, species: u32) -> Option<Self> {
        let &(up_to, _) = channel_words(model, species).last()?;
        Some(Self { up_to, rate: ReactionProbabilities(model).decay_rate(species) * model.time_step })
    }

    /// Returns `true` if the particle dissociates in this step.
    pub(crate) fn is_within(&self, context: DrawContext) -> bool {
        context.draw(0, Purpose::Dissociation)[0] <= self.up_to
    }

    /// Steps from the beginning of the step or of the particle; `None` above one.
    fn draw(&self, context: DrawContext) -> Option<f64> {
        let word = || context.draw(1, Purpose::Dissociation)[0];
        self.is_within(context).then(|| decay_time(self.rate, 1.0, word()))
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DecayChannel {
    pub(crate) up_to: u32,
    /// Cumulative fraction of the rate.
    pub(crate) cumulative_fraction: f64,
    pub(crate) decay: u32,
    pub(crate) product: Option<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainedDecay {
    /// Index in the model.
    pub decay: u32,
    /// Species; `None` removes the particle.
    pub product: Option<u32>,
    rate: f64,
    left: f64,
    word: u32,
}

impl ChainedDecay {
    /// Returns the time left in the step.
    pub(crate) fn time_left(&self) -> f64 {
        self.left - decay_time(self.rate, self.left, self.word)
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct CaptureOrder {
    /// `None` after a decay without products; `true` marks a product.
    species: Option<(u32, bool)>,
    left: f64,
    /// `None` until a decay after the hit is added.
    is_captured: Option<bool>,
}

impl CaptureOrder {
    pub(crate) fn new(species: u32, (time, duration): (f32, f64)) -> Self {
        Self { species: Some((species, false)), left: duration * (1.0 - f64::from(time)), is_captured: None }
    }

    /// Adds a decay. Returns `false` if the particle was captured before it.
    pub(crate) fn decays(
        &mut self,
        decay: &ChainedDecay,
        captures: impl FnOnce((u32, bool)) -> bool,
    ) -> bool {
        if self.is_captured.is_none() && decay.time_left() <= self.left {
            self.is_captured = Some(self.species.is_some_and(captures));
        }
        if self.is_captured == Some(true) {
            return false;
        }
        self.species = decay.product.map(|product| (product, true));
        true
    }

    pub(crate) fn captured(self, captures: impl FnOnce((u32, bool)) -> bool) -> Option<u32> {
        let Self { species, is_captured, .. } = self;
        let (species, is_product) = species?;
        is_captured.unwrap_or_else(|| captures((species, is_product))).then_some(species)
    }
}

/// Largest number of further decays in a step. More have a probability below 10⁻⁴¹: see `model::decay_chain`.
const MAX_GENERATIONS: u32 = 1_000_000;

impl Decays {
    pub fn new(model: &Model) -> Self {
        let kinds = (0..model.species.len() as u32).map(|species| kind(model, species)).collect();
        Self { kinds, time_step: model.time_step }
    }

    pub fn is_empty(&self) -> bool {
        self.kinds.iter().all(|kind| kind.channels.is_empty())
    }

    /// Channels share 1 − exp(−ΣkΔt) in proportion to their rates k.
    #[cfg(feature = "gpu")]
    pub(crate) fn channels(&self, species: u32) -> &[DecayChannel] {
        &self.kinds[species as usize].channels
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn rate(&self, species: u32) -> f64 {
        self.kinds[species as usize].rate
    }

    /// Returns `true` if the species decays while it moves.
    #[inline(always)]
    pub(crate) fn has(&self, species: u32) -> bool {
        !self.kinds[species as usize].channels.is_empty()
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn dissociation(&self, species: u32) -> Option<DissociationTime> {
        self.kinds[species as usize].dissociation
    }

    /// Returns `true` if a particle dissociates before the time `hit`, in steps.
    #[inline]
    pub(crate) fn dissociates_before(
        &self,
        species: u32,
        context: DrawContext,
        hit: impl FnOnce() -> f32,
    ) -> bool {
        let dissociation = self.kinds[species as usize].dissociation;
        dissociation.and_then(|time| time.draw(context)).is_some_and(|time| (time as f32) < hit())
    }

    /// Time left at the product's dissociation, negative after the step; `None` if it does not dissociate within a
    /// whole step.
    fn left_at_dissociation(&self, decay: &ChainedDecay, context: DrawContext) -> Option<f64> {
        let dissociation = self.kinds[decay.product? as usize].dissociation?;
        Some(decay.time_left() - dissociation.draw(context)? * self.time_step)
    }

    /// Returns `true` if the product dissociates within a whole step, but not within this one.
    pub(crate) fn spares_product(&self, decay: &ChainedDecay, context: DrawContext) -> bool {
        self.left_at_dissociation(decay, context).is_some_and(|left| left <= 0.0)
    }

    pub(crate) fn product_dissociates_before(
        &self,
        last: Option<&ChainedDecay>,
        order: &CaptureOrder,
        context: DrawContext,
    ) -> bool {
        last.and_then(|decay| self.left_at_dissociation(decay, context)).is_some_and(|left| left > order.left)
    }

    /// Visits the decays of a step in order.
    #[inline]
    pub fn for_each_decay(&self, species: u32, context: DrawContext, mut visit: impl FnMut(ChainedDecay)) {
        let kind = &self.kinds[species as usize];
        if kind.channels.is_empty() {
            return;
        }
        let [word, when, ..] = context.draw(0, Purpose::Decay);
        let Some(channel) = kind.channels.iter().find(|channel| word <= channel.up_to) else { return };
        let first = kind.chained(channel, self.time_step, when);
        visit(first);
        if let Some(product) = channel.product.filter(|&product| self.kinds[product as usize].rate > 0.0) {
            let words = |generation| context.draw(generation, Purpose::Decay);
            self.continue_chain(product, first.time_left(), words, visit);
        }
    }

    pub(crate) fn continue_chain(
        &self,
        mut species: u32,
        mut left: f64,
        words: impl Fn(u32) -> [u32; 4],
        mut visit: impl FnMut(ChainedDecay),
    ) {
        for generation in 1..=MAX_GENERATIONS {
            let kind = &self.kinds[species as usize];
            let [word, when, ..] = words(generation);
            let ratio = fine_unit(word) / -libm::expm1(-kind.rate * left);
            let Some(channel) = kind.channels.iter().find(|channel| ratio < channel.cumulative_fraction)
            else {
                return;
            };
            let decay = kind.chained(channel, left, when);
            visit(decay);
            let Some(product) = channel.product else { return };
            (left, species) = (decay.time_left(), product);
        }
    }
}

impl SpeciesDecays {
    fn chained(&self, channel: &DecayChannel, left: f64, word: u32) -> ChainedDecay {
        let DecayChannel { decay, product, .. } = *channel;
        ChainedDecay { decay, product, rate: self.rate, left, word }
    }
}

fn decay_time(rate: f64, duration: f64, word: u32) -> f64 {
    -libm::log1p(fine_unit(word) * libm::expm1(-rate * duration)) / rate
}

fn kind(model: &Model, species: u32) -> SpeciesDecays {
    if model.dissociates(species) {
        let dissociation = DissociationTime::new(model, species);
        return SpeciesDecays { dissociation, ..SpeciesDecays::default() };
    }
    let is_channel = |decay: &crate::model::Decay| decay.reactant == species && decay.rate > 0.0;
    let decays = || model.decays.iter().enumerate().filter(|(_, decay)| is_channel(decay));
    let rate: f64 = decays().map(|(_, decay)| decay.rate).sum();
    let probability = -libm::expm1(-rate * model.time_step);
    let mut cumulative_fraction = 0.0;
    let channel = |(index, decay): (usize, &crate::model::Decay)| {
        cumulative_fraction += decay.rate / rate;
        let up_to = probability_threshold(probability * cumulative_fraction)?;
        Some(DecayChannel { up_to, cumulative_fraction, decay: index as u32, product: decay.products[0] })
    };
    SpeciesDecays { rate, channels: decays().filter_map(channel).collect(), dissociation: None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Decay, Species};
    use crate::random::philox::Key;

    fn context(id: u32) -> DrawContext {
        DrawContext { key: Key::new(5), id, step: 7 }
    }

    fn decay(reactant: u32, products: [Option<u32>; 2], rate: f64) -> Decay {
        Decay { reactant, products, rate, ..Decay::default() }
    }

    fn decays(time_step: f64, species: usize, decays: Vec<Decay>) -> Decays {
        let species = vec![Species::default(); species];
        Decays::new(&Model { time_step, species, decays, ..Model::default() })
    }

    #[track_caller]
    fn assert_fraction(count: u32, n: u32, p: f64) {
        let (n, count) = (f64::from(n), f64::from(count));
        let error = (count - n * p) / (n * p * (1.0 - p)).sqrt();
        assert!(error.abs() < 4.0, "{count} and not {}: {error} standard errors", n * p);
    }

    #[test]
    fn product_dissociates_in_the_rest_of_the_step() {
        let channels = vec![decay(0, [Some(1), None], 4.0), decay(1, [Some(0), Some(0)], 6.0)];
        let decays = decays(0.5, 2, channels);
        let dissociation = decays.kinds[1].dissociation.expect("a species that dissociates");
        let n = 100_000;
        let [mut dissociated, mut before] = [0_u32; 2];
        for id in 0..n {
            let context = context(id);
            decays.for_each_decay(0, context, |decay| {
                let is_spared = decays.spares_product(&decay, context);
                dissociated += u32::from(dissociation.is_within(context) && !is_spared);
                let order = CaptureOrder::new(0, (0.5, 0.5));
                before += u32::from(decays.product_dissociates_before(Some(&decay), &order, context));
            });
        }
        let both = |fraction: f64| 1.0 - 3.0 * (-2.0 * fraction).exp() + 2.0 * (-3.0 * fraction).exp();
        assert_fraction(dissociated, n, both(1.0));
        assert_fraction(before, n, both(0.5));
    }

    #[test]
    fn chain_of_many_decays_ends_with_the_right_species() {
        let channels = vec![decay(0, [Some(1), None], 3e6), decay(1, [Some(0), None], 1e6)];
        let decays = decays(6.6e-4, 2, channels);
        let n = 2000;
        let mut first = 0;
        for id in 0..n {
            let mut species = Some(0);
            decays.for_each_decay(0, context(id), |decay| species = decay.product);
            first += u32::from(species == Some(0));
        }
        assert_fraction(first, n, 0.25);
    }

    #[test]
    fn a_chain_is_right_however_long_the_step() {
        let channels = vec![
            decay(0, [Some(1), None], 2.0),
            decay(1, [Some(2), None], 3.0),
            decay(2, [Some(0), Some(0)], 9.0),
        ];
        let decays = decays(1.0, 3, channels);
        let n = 100_000;
        let mut counts = [0_u32; 2];
        for id in 0..n {
            decays.for_each_decay(0, context(id), |ChainedDecay { decay, product, .. }| {
                assert_eq!(product, Some(decay + 1));
                counts[decay as usize] += 1;
            });
        }
        let [a, b] = [(-2.0_f64).exp(), (-3.0_f64).exp()];
        assert_fraction(counts[0], n, 1.0 - a);
        assert_fraction(counts[1], n, 1.0 - a - 2.0 * (a - b));
    }
}
