//! Decays that happen too early or too late in a long step.
//!
//! Decays and dissociations of released particles and of products of decays are right at any step length, except that
//! nothing dissociates between a release and the end of its step, products of a species that can dissociate begin at
//! the end of its step, and pairs react at the end of a step, without the particles that decayed in it.

use std::collections::HashSet;

use super::below;
use crate::model::transmitter::{Schedule, Transmitter};
use crate::model::{Decay, Model, Unbinding, sorted};

/// Largest step, in lifetimes, of a particle that decays in the next step at the earliest, or that reacts in pairs.
const FAST_DECAY: f64 = 0.02;

/// Returns a warning for the fastest decay of each species, indexed by decay.
pub(in crate::scenario) fn fast_decays(model: &Model) -> Vec<Option<String>> {
    let lives = SpeciesTiming::new(model);
    let mut messages = vec![None; model.decays.len()];
    for (species, fastest) in fastest_decays(model).into_iter().enumerate() {
        if let Some((index, rate)) = fastest {
            let message = lives.message(species, rate, model);
            messages[index] = message.map(|message| format!("'{}': {message}", model.decays[index].name));
        }
    }
    messages
}

/// Returns the fastest decay of each species, and the rate of all its decays.
fn fastest_decays(model: &Model) -> Vec<Option<(usize, f64)>> {
    let mut fastest: Vec<Option<(usize, f64)>> = vec![None; model.species.len()];
    for (index, decay) in model.decays.iter().enumerate() {
        let entry = fastest[decay.reactant as usize].get_or_insert((index, 0.0));
        entry.1 += decay.rate;
        if decay.rate > model.decays[entry.0].rate {
            entry.0 = index;
        }
    }
    fastest
}

/// The ends and beginnings of particles, indexed by species.
struct SpeciesTiming {
    /// Formed or dissociating at the end of a step.
    is_late: Vec<bool>,
    /// Reactants of pairs whose number at the ends of steps is lower than that of all in the step.
    is_early: Vec<bool>,
}

impl SpeciesTiming {
    fn new(model: &Model) -> Self {
        let none = || vec![false; model.species.len()];
        let dissociates = model.dissociating();
        let (mut is_late, mut reacts, mut begins) = (none(), none(), none());
        let exchanges = exchanges(model);
        for reaction in &model.reactions {
            reaction.reactants.iter().for_each(|&species| reacts[species as usize] = true);
            let exchanged = |product: u32| exchanges.contains(&(product, sorted(reaction.reactants)));
            let is_exchange = match reaction.products {
                [Some(product), None] | [None, Some(product)] => exchanged(product),
                _ => false,
            };
            // A reactant that is its own product stays.
            let formed = reaction.products.into_iter().zip(reaction.reactants).filter(|&(c, a)| c != Some(a));
            for product in formed.filter_map(|(product, _)| product) {
                begins[product as usize] = true;
                // Association and dissociation within the same ball keep the right proportion.
                is_late[product as usize] |= !is_exchange;
            }
        }
        for decay in model.decays.iter().filter(|decay| dissociates[decay.reactant as usize]) {
            // All decays of the species happen at the end of the step.
            for product in decay.products.into_iter().flatten() {
                (is_late[product as usize], begins[product as usize]) = (true, true);
            }
        }
        for species in released_within_a_step(model, &dissociates) {
            is_late[species] |= dissociates[species];
        }
        let released = model.transmitters.iter().flat_map(Transmitter::species);
        released.for_each(|species| begins[species as usize] = true);
        let is_early = reacts.into_iter().zip(begins).map(|(reacts, begins)| reacts && begins).collect();
        Self { is_late, is_early }
    }

    fn message(&self, species: usize, rate: f64, model: &Model) -> Option<String> {
        let (expected_decays, name) = (rate * model.time_step, &model.species[species].name);
        let effect = match (self.is_late[species], self.is_early[species]) {
            _ if expected_decays <= FAST_DECAY => return None,
            (true, _) => "those that pairs or a species that can dissociate form, or that dissociate after a release within a step, \
                          decay in the next step at the earliest, so that they live half a step too long on average"
                .to_owned(),
            (_, true) => format!(
                "pairs react at the ends of steps, without those that decay in the step, so that up to {:.1} % too few react",
                -100.0 * libm::expm1(-expected_decays)
            ),
            _ => return None,
        };
        let longest = below(FAST_DECAY / rate);
        Some(format!(
            "{:.1} % of {name} decay in a step, and {effect}; time-step = {longest} is short enough",
            100.0 * expected_decays
        ))
    }
}

/// Returns reactant and products of the dissociations within a binding radius.
fn exchanges(model: &Model) -> HashSet<(u32, [u32; 2])> {
    let exchange = |decay: &Decay| match (decay.products, decay.unbinding) {
        ([Some(a), Some(b)], Unbinding::Within(_)) => Some((decay.reactant, sorted([a, b]))),
        _ => None,
    };
    model.decays.iter().filter_map(exchange).collect()
}

/// Returns the species of steady release, and those to which decays lead without dissociation.
fn released_within_a_step(model: &Model, dissociates: &[bool]) -> Vec<usize> {
    let mut products = vec![Vec::new(); model.species.len()];
    for decay in model.decays.iter().filter(|decay| !dissociates[decay.reactant as usize]) {
        products[decay.reactant as usize].extend(decay.products[0].map(|product| product as usize));
    }
    let is_steady = |one: &&Transmitter| matches!(one.schedule, Schedule::Steady { .. });
    let steady = model.transmitters.iter().filter(is_steady).flat_map(Transmitter::species);
    let (mut found, mut is_found) = (Vec::new(), vec![false; model.species.len()]);
    let mut next: Vec<usize> = steady.map(|species| species as usize).collect();
    while let Some(species) = next.pop() {
        if !std::mem::replace(&mut is_found[species], true) {
            found.push(species);
            next.extend(&products[species]);
        }
    }
    found
}
