//! Reactions and decays by reactants and products, because files have tens of thousands.

use std::collections::HashMap;

use crate::model::{Decay, Reaction, sorted};

#[derive(Default)]
pub(super) struct NetworkIndex {
    channels: HashMap<[u32; 2], Vec<usize>>,
    /// First reaction of each pair of reactants and of two products.
    reactions: HashMap<[[u32; 2]; 2], usize>,
    dissociations: HashMap<(u32, [u32; 2]), usize>,
    decay_rates: HashMap<u32, f64>,
}

impl NetworkIndex {
    pub(super) fn new<'a>(reactions: impl Iterator<Item = &'a Reaction>, decays: &[Decay]) -> Self {
        let mut index = Self::default();
        for (position, reaction) in reactions.enumerate() {
            let pair = sorted(reaction.reactants);
            index.channels.entry(pair).or_default().push(position);
            if let Some(products) = both(reaction.products) {
                index.reactions.entry([pair, products]).or_insert(position);
            }
        }
        for (position, decay) in decays.iter().enumerate() {
            *index.decay_rates.entry(decay.reactant).or_default() += decay.rate;
            if let Some(products) = both(decay.products) {
                index.dissociations.entry((decay.reactant, products)).or_insert(position);
            }
        }
        index
    }

    pub(super) fn channels(&self, reactants: [u32; 2]) -> &[usize] {
        self.channels.get(&sorted(reactants)).map_or(&[], Vec::as_slice)
    }

    pub(super) fn reverse_reaction(&self, reaction: &Reaction) -> Option<usize> {
        self.reactions.get(&[both(reaction.products)?, sorted(reaction.reactants)]).copied()
    }

    pub(super) fn reverse_decay(&self, reaction: &Reaction) -> Option<usize> {
        let ([Some(product), None] | [None, Some(product)]) = reaction.products else { return None };
        self.dissociations.get(&(product, sorted(reaction.reactants))).copied()
    }

    pub(super) fn decay_rate(&self, species: u32) -> f64 {
        self.decay_rates.get(&species).copied().unwrap_or_default()
    }
}

fn both(products: [Option<u32>; 2]) -> Option<[u32; 2]> {
    let [a, b] = products;
    Some(sorted([a?, b?]))
}
