//! Reactions and decays of a file by their reactants and products, because files have tens of thousands.

use std::collections::HashMap;

use crate::model::{Decay, Reaction};

/// Indices of reactions and decays.
#[derive(Default)]
pub(super) struct NetworkIndex {
    /// Reactions of each pair of reactants, in the file's order.
    channels: HashMap<[u32; 2], Vec<usize>>,
    /// First reaction of each pair of reactants and of two products.
    reactions: HashMap<[[u32; 2]; 2], usize>,
    /// First decay of each species into two products.
    dissociations: HashMap<(u32, [u32; 2]), usize>,
    /// Sum of the rates of each species' decays, in 1/s.
    decay_rates: HashMap<u32, f64>,
}

impl NetworkIndex {
    pub(super) fn new<'a>(reactions: impl Iterator<Item = &'a Reaction>, decays: &[Decay]) -> Self {
        let mut index = Self::default();
        for (place, reaction) in reactions.enumerate() {
            let pair = sorted(reaction.reactants);
            index.channels.entry(pair).or_default().push(place);
            if let Some(products) = both(reaction.products) {
                index.reactions.entry([pair, products]).or_insert(place);
            }
        }
        for (place, decay) in decays.iter().enumerate() {
            *index.decay_rates.entry(decay.reactant).or_default() += decay.rate;
            if let Some(products) = both(decay.products) {
                index.dissociations.entry((decay.reactant, products)).or_insert(place);
            }
        }
        index
    }

    /// Returns the reactions of two species.
    pub(super) fn channels(&self, reactants: [u32; 2]) -> &[usize] {
        self.channels.get(&sorted(reactants)).map_or(&[], Vec::as_slice)
    }

    /// Returns the first reaction whose products are the reactants of `reaction`, and vice versa.
    pub(super) fn reverse_reaction(&self, reaction: &Reaction) -> Option<usize> {
        self.reactions.get(&[both(reaction.products)?, sorted(reaction.reactants)]).copied()
    }

    /// Returns the first decay of the only product of `reaction` into its reactants.
    pub(super) fn reverse_decay(&self, reaction: &Reaction) -> Option<usize> {
        let ([Some(product), None] | [None, Some(product)]) = reaction.products else { return None };
        self.dissociations.get(&(product, sorted(reaction.reactants))).copied()
    }

    /// Returns the rate of all decays of a species, in 1/s.
    pub(super) fn decay_rate(&self, species: u32) -> f64 {
        self.decay_rates.get(&species).copied().unwrap_or_default()
    }
}

fn sorted([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

fn both(products: [Option<u32>; 2]) -> Option<[u32; 2]> {
    let [a, b] = products;
    Some(sorted([a?, b?]))
}
