use crate::model::Model;
use crate::model::probability::ReactionProbabilities;
use crate::model::receiver::Receiver;
use crate::motion::binding::desorption;
use crate::motion::tumble::tumble_probability;
use crate::random::philox::probability_threshold;

/// Largest relative error of a probability without a warning.
const MAX_RELATIVE_ERROR: f64 = 0.01;
const RANDOM_WORDS: f64 = 4_294_967_296.0;

/// Indexed by decay.
pub(in crate::scenario) fn rounded_decays(model: &Model) -> Vec<Option<String>> {
    let mut messages = vec![None; model.decays.len()];
    for species in 0..model.species.len() as u32 {
        let channels = ReactionProbabilities(model).decays(species);
        for (index, probability, rounded) in rounded(&channels) {
            messages[index] = Some(message(&model.decays[index].name, probability, rounded));
        }
    }
    messages
}

/// Indexed by reaction.
pub(in crate::scenario) fn rounded_reactions(model: &Model) -> Vec<Option<String>> {
    let mut messages = vec![None; model.reactions.len()];
    let chances = ReactionProbabilities(model);
    for pair in chances.pairs() {
        for shell in chances.shells(pair) {
            for (index, probability, rounded) in rounded(&shell.channels) {
                messages[index] = Some(message(&model.reactions[index].name, probability, rounded));
            }
        }
    }
    messages
}

pub(in crate::scenario) fn rounded_tumbles(model: &Model, species: usize) -> Option<String> {
    let one = &model.species[species];
    if one.speed == 0.0 {
        return None;
    }
    let probability = tumble_probability(one.tumble_rate * model.time_step).min(1.0);
    let (_, probability, rounded) = rounded(&[(0, probability)]).next()?;
    Some(message(&format!("a tumble of {}", one.name), probability, rounded))
}

/// Warns of the first ligand whose unbinding is rounded.
pub(in crate::scenario) fn rounded_unbinding(model: &Model, receiver: &Receiver) -> Option<String> {
    let types = receiver.receptor_types();
    types.iter().flat_map(|kind| &kind.ligands).find_map(|ligand| {
        let species = &model.species[ligand.species as usize];
        // Least with all receptors free.
        let fraction =
            desorption(model, receiver, ligand.species, |kind| types[kind].count).effective_fraction();
        let (_, probability, rounded) =
            rounded(&[(0, ligand.unbinding_rate * model.time_step * fraction)]).next()?;
        Some(message(&format!("unbinding of {} from {}", species.name, receiver.name), probability, rounded))
    })
}

fn rounded(channels: &[(usize, f64)]) -> impl Iterator<Item = (usize, f64, f64)> {
    let words =
        |probability: f64| probability_threshold(probability).map_or(0.0, |up_to| f64::from(up_to) + 1.0);
    let mut below = 0.0;
    channels.iter().filter_map(move |&(index, probability)| {
        let before = words(below);
        below += probability;
        let rounded = (words(below) - before) / RANDOM_WORDS;
        ((rounded - probability).abs() > MAX_RELATIVE_ERROR * probability).then_some((
            index,
            probability,
            rounded,
        ))
    })
}

fn message(name: &str, probability: f64, rounded: f64) -> String {
    let off = match rounded {
        0.0 => "it never happens".to_owned(),
        _ => format!("its rate is off by {:.1} %", 100.0 * (rounded / probability - 1.0).abs()),
    };
    format!(
        "'{name}' has the probability {probability:.3e} in a step, which is rounded to {rounded:.3e}, a multiple of 2⁻³², so \
         that {off}; take a longer time-step or a higher rate: probabilities of {:.2e} or more are rounded by 1 % at most",
        1.0 / (MAX_RELATIVE_ERROR * RANDOM_WORDS)
    )
}
