//! Rates as probabilities per step.
//!
//! Among events at the rates λ₁, λ₂, … with the sum R, one happens within Δt with the probability 1 − exp(−RΔt). Each
//! has the probability λ·g with g = (1 − exp(−RΔt))/R.
//!
//! If a reaction joins particles anywhere in a ball, and a decay places its products anywhere in it, both use the
//! decay's g. Their probabilities then have the ratio of the rates, and the equilibrium is independent of Δt.

use std::collections::HashSet;

use crate::model::{Decay, Model, Reaction, ReactionRate, Unbinding, sorted};

/// Reactions of two species from the next inner radius to this one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ProbabilityShell {
    /// In µm.
    pub(crate) radius: f32,
    /// Indices of the reactions, and their probabilities.
    pub(crate) channels: Vec<(usize, f64)>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct ReactionProbabilities<'a>(pub(crate) &'a Model);

impl ReactionProbabilities<'_> {
    pub(crate) fn pairs(self) -> impl Iterator<Item = [u32; 2]> {
        let mut seen = HashSet::new();
        let reactants = self.0.reactions.iter().map(|reaction| reaction.reactants);
        reactants.filter(move |&pair| seen.insert(sorted(pair)))
    }

    pub(crate) fn shells(self, pair: [u32; 2]) -> Vec<ProbabilityShell> {
        let with_back = |(index, reaction)| (index, reaction, self.inverse_rate(reaction));
        let channels: Vec<_> = channels(self.0, pair).map(with_back).collect();
        let mut radii: Vec<f32> = channels.iter().map(|(_, reaction, _)| reaction.binding_radius).collect();
        radii.sort_unstable_by(f32::total_cmp);
        radii.dedup();
        let shell = |radius: f32| {
            let inside = || channels.iter().filter(|(_, reaction, _)| reaction.binding_radius >= radius);
            let alone = inside().map(|(_, reaction, _)| rate(reaction)).sum();
            let chance = |&(index, reaction, back): &(usize, &Reaction, Option<f64>)| match reaction.chance {
                ReactionRate::PerStep(probability) => (index, probability),
                ReactionRate::PerTime(rate) => {
                    (index, rate * factor(back.unwrap_or(alone), self.0.time_step))
                }
            };
            ProbabilityShell { radius, channels: inside().map(chance).collect() }
        };
        radii.into_iter().map(shell).collect()
    }

    pub(crate) fn decays(self, species: u32) -> Vec<(usize, f64)> {
        let decays = self.0.decays.iter().enumerate().filter(|(_, decay)| decay.reactant == species);
        let factor = factor(self.decay_rate(species), self.0.time_step);
        decays.map(|(index, decay)| (index, decay.rate * factor)).collect()
    }

    pub(crate) fn decay_rate(self, species: u32) -> f64 {
        self.0.decays.iter().filter(|decay| decay.reactant == species).map(|decay| decay.rate).sum()
    }

    fn inverse_rate(self, reaction: &Reaction) -> Option<f64> {
        let back = Unbinding::Within(reaction.binding_radius);
        let mut decays = self.0.decays.iter();
        let decay = decays.find(|decay| decay.unbinding == back && undoes(decay, reaction))?;
        Some(self.decay_rate(decay.reactant))
    }
}

fn factor(rate: f64, time_step: f64) -> f64 {
    if rate > 0.0 { -libm::expm1(-rate * time_step) / rate } else { time_step }
}

fn rate(reaction: &Reaction) -> f64 {
    match reaction.chance {
        ReactionRate::PerTime(rate) => rate,
        ReactionRate::PerStep(_) => 0.0,
    }
}

fn channels(model: &Model, [a, b]: [u32; 2]) -> impl Iterator<Item = (usize, &Reaction)> {
    let has_reactants =
        move |reaction: &Reaction| reaction.reactants == [a, b] || reaction.reactants == [b, a];
    model.reactions.iter().enumerate().filter(move |(_, reaction)| has_reactants(reaction))
}

pub(crate) fn undoes(decay: &Decay, reaction: &Reaction) -> bool {
    let single = match reaction.products {
        [Some(product), None] | [None, Some(product)] => product == decay.reactant,
        _ => false,
    };
    let [a, b] = reaction.reactants.map(Some);
    single && (decay.products == [a, b] || decay.products == [b, a])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Species;

    fn model(unbinding: Unbinding) -> Model {
        let reaction = |product, binding_radius, rate| Reaction {
            reactants: [0, 1],
            products: [Some(product), None],
            binding_radius,
            chance: ReactionRate::PerTime(rate),
            ..Reaction::default()
        };
        let back =
            Decay { reactant: 2, products: [Some(1), Some(0)], unbinding, rate: 3.0, ..Decay::default() };
        Model {
            time_step: 0.1,
            species: vec![Species::default(); 4],
            reactions: vec![reaction(2, 1.0, 4.0), reaction(3, 2.0, 1.0)],
            decays: vec![back],
            ..Model::default()
        }
    }

    fn close(shell: &ProbabilityShell, radius: f32, expected: &[(usize, f64)]) {
        assert_eq!(shell.radius, radius);
        assert_eq!(shell.channels.len(), expected.len(), "{shell:?}");
        for (found, expected) in shell.channels.iter().zip(expected) {
            assert!(found.0 == expected.0 && (found.1 - expected.1).abs() < 1e-12, "{shell:?}");
        }
    }

    #[test]
    fn channels_share_the_probability_in_proportion() {
        let model = model(Unbinding::Apart(1.0));
        let chances = ReactionProbabilities(&model);
        let shells = chances.shells([1, 0]);
        let both = 1.0 - (-0.5_f64).exp();
        close(&shells[0], 1.0, &[(0, 0.8 * both), (1, 0.2 * both)]);
        close(&shells[1], 2.0, &[(1, 1.0 - (-0.1_f64).exp())]);
        assert!((chances.decays(2)[0].1 - (1.0 - (-0.3_f64).exp())).abs() < 1e-12);
        assert!(chances.shells([0, 2]).is_empty() && chances.decays(0).is_empty());
    }

    #[test]
    fn reversible_reactions_have_the_ratio_of_the_rates() {
        let mut model = model(Unbinding::Within(1.0));
        for time_step in [1e-6, 0.01, 0.2] {
            model.time_step = time_step;
            let chances = ReactionProbabilities(&model);
            let (there, back) = (chances.shells([0, 1])[0].channels[0].1, chances.decays(2)[0].1);
            assert!((there / back - 4.0 / 3.0).abs() < 1e-12, "{time_step}: {there} {back}");
            assert!((back - (1.0 - (-3.0 * time_step).exp())).abs() < 1e-12);
        }
    }
}
