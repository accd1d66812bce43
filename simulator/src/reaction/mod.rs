//! Bimolecular reactions.

pub mod candidates;
pub mod decay;
pub mod dissociation;
pub mod matching;
pub mod rate;

use lazygrid::{Interaction, Interactions, Pair};

use crate::Error;
use crate::model::boundary::Boundary;
use crate::model::particles::Particles;
use crate::model::probability::{ProbabilityShell, ReactionProbabilities};
use crate::model::{Contact, Model, Reaction};
use crate::random::gaussian::direction;
use crate::random::philox::{Purpose, StepKey, probability_threshold};
use crate::reaction::decay::DissociationTime;
use crate::reaction::matching::ReactionCandidate;

#[derive(Clone, Debug)]
pub struct Reactions {
    reactants: usize,
    /// Table row by species; `u32::MAX` if it does not react.
    rows: Vec<u32>,
    /// Indexed by two rows; innermost first.
    table: Vec<Vec<ReactionShell>>,
    reactions: Vec<Reaction>,
    /// Indexed by reaction: the first reactant's fraction of the approach, and the first product's of the separation.
    first_fractions: Vec<[f32; 2]>,
    boundary: Boundary,
    center_domains: Vec<Boundary>,
    dissociation: Vec<Option<DissociationTime>>,
}

/// Center distances at which two species have the same reactions.
#[derive(Clone, Debug)]
pub(crate) struct ReactionShell {
    /// Largest distance; `None` for that of the detector.
    pub(crate) within: Option<f32>,
    rule: ReactionRule,
    others: Vec<ReactionRule>,
}

impl ReactionShell {
    pub(crate) fn rules(&self) -> impl Iterator<Item = &ReactionRule> {
        std::iter::once(&self.rule).chain(&self.others)
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct ReactionRule {
    pub(crate) reaction: u32,
    /// Species of the first reactant.
    pub(crate) first: u32,
    /// Largest random word at which it happens.
    pub(crate) up_to: u32,
    pub(crate) consumes: [bool; 2],
    /// A draw decides which of two equal reactants is the first.
    pub(crate) draws_order: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReactantChange {
    pub at: u32,
    /// Species; `None` removes the particle.
    pub product: Option<u32>,
    /// In µm.
    pub position: [f32; 3],
}

impl Reactions {
    pub fn new(model: &Model) -> Self {
        let chances = ReactionProbabilities(model);
        let mut reactants: Vec<u32> =
            model.reactions.iter().flat_map(|reaction| reaction.reactants).collect();
        reactants.sort_unstable();
        reactants.dedup();
        let mut rows = vec![u32::MAX; model.species.len()];
        (0..).zip(&reactants).for_each(|(row, &species)| rows[species as usize] = row);
        let mut table = vec![Vec::new(); reactants.len() * reactants.len()];
        for pair in chances.pairs() {
            let [a, b] = pair.map(|species| rows[species as usize] as usize);
            let shells = shells(model, chances, pair);
            table[b * reactants.len() + a].clone_from(&shells);
            table[a * reactants.len() + b] = shells;
        }
        Self {
            reactants: reactants.len(),
            rows,
            table,
            reactions: model.reactions.clone(),
            first_fractions: model
                .reactions
                .iter()
                .map(|reaction| first_fractions(model, reaction))
                .collect(),
            boundary: model.boundary,
            center_domains: model.center_domains(),
            dissociation: (0..model.species.len() as u32)
                .map(|species| DissociationTime::new(model, species))
                .collect(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.reactions.is_empty()
    }

    /// Innermost first; empty if the species do not react.
    #[inline]
    pub(crate) fn shells(&self, a: u32, b: u32) -> &[ReactionShell] {
        let [a, b] = [a, b].map(|species| self.rows[species as usize] as usize);
        if a.max(b) < self.reactants { &self.table[a * self.reactants + b] } else { &[] }
    }

    /// Returns the changes of a candidate's consumed reactants.
    ///
    /// Consumed reactants meet, each moving in proportion to its diffusion. One product appears there; two separate by
    /// the unbinding radius in a random direction. A product next to a catalyst stays at its reactant's position, or
    /// appears at the unbinding radius from the catalyst.
    pub fn outcomes(
        &self,
        particles: &Particles,
        candidate: &ReactionCandidate,
        now: StepKey,
    ) -> [Option<ReactantChange>; 2] {
        let reaction = &self.reactions[candidate.rule as usize];
        let [a, b] = candidate.at.map(|at| particles.position_of(at as usize));
        let toward = self.boundary.displacement(a, b);
        let [approach_fraction, separation_fraction] = self.first_fractions[candidate.rule as usize];
        let meeting: [f32; 3] = std::array::from_fn(|k| a[k] + approach_fraction * toward[k]);
        let has_catalyst = candidate.consumes.contains(&false);
        let separates = reaction.separates();
        let apart = match separates {
            true => {
                let [first_id, second_id] = candidate.ids;
                let [_, _, first, second] = now.for_particle(first_id).draw(second_id, Purpose::Pair);
                let away = self.boundary.direction_within(direction(first, second));
                away.map(|c| c * reaction.unbinding_radius)
            }
            false => [0.0; 3],
        };
        let outcome = |k: usize, along: f32| {
            // Adding `toward` to the other position would round.
            let from = if has_catalyst && !separates { [a, b][k] } else { meeting };
            let domain =
                reaction.products[k].map_or(&self.boundary, |product| &self.center_domains[product as usize]);
            let position = domain.confine(std::array::from_fn(|axis| from[axis] + along * apart[axis]));
            let outcome = ReactantChange { at: candidate.at[k], product: reaction.products[k], position };
            candidate.consumes[k].then_some(outcome)
        };
        [outcome(0, -separation_fraction), outcome(1, 1.0 - separation_fraction)]
    }

    /// Returns the changes before any is applied: a catalyst may take part in several reactions.
    pub(crate) fn all_outcomes(
        &self,
        particles: &Particles,
        chosen: &[ReactionCandidate],
        now: StepKey,
    ) -> Vec<ReactantChange> {
        chosen.iter().flat_map(|candidate| self.outcomes(particles, candidate, now)).flatten().collect()
    }

    #[inline]
    pub(crate) fn dissociation_of(&self, species: u32) -> Option<DissociationTime> {
        self.dissociation[species as usize]
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn first_fractions_of(&self, reaction: u32) -> [f32; 2] {
        self.first_fractions[reaction as usize]
    }
}

fn shells(model: &Model, chances: ReactionProbabilities<'_>, pair: [u32; 2]) -> Vec<ReactionShell> {
    let all = chances.shells(pair);
    let outermost =
        all.last().map_or(0.0, |shell| shell.radius).max(contact_distance(model, pair[0], pair[1]));
    let shell = |shell: ProbabilityShell| {
        let mut below = 0.0;
        let rule = |(index, probability): (usize, f64)| {
            below += probability;
            let reaction = &model.reactions[index];
            Some(ReactionRule {
                reaction: index as u32,
                first: reaction.reactants[0],
                up_to: probability_threshold(below)?,
                consumes: consumes(reaction),
                draws_order: draws_order(reaction),
            })
        };
        let mut rules = shell.channels.into_iter().filter_map(rule);
        let within = (outermost > shell.radius).then_some(shell.radius);
        Some(ReactionShell { within, rule: rules.next()?, others: rules.collect() })
    };
    all.into_iter().filter_map(shell).collect()
}

/// Returns `true` for a reactant that is not its own product.
fn consumes(reaction: &Reaction) -> [bool; 2] {
    [0, 1].map(|k| reaction.products[k] != Some(reaction.reactants[k]))
}

/// Returns `true` if the reactants are of one species, but their products are not.
fn draws_order(reaction: &Reaction) -> bool {
    let ([a, b], [c, d]) = (reaction.reactants, reaction.products);
    a == b && c != d
}

fn first_fractions(model: &Model, reaction: &Reaction) -> [f32; 2] {
    let consumes = consumes(reaction);
    let together = match consumes {
        [true, true] => model.first_fraction(reaction.reactants),
        [true, false] => 1.0,
        _ => 0.0,
    };
    let apart = match (consumes, reaction.products) {
        ([true, true], [Some(c), Some(d)]) => model.first_fraction([c, d]),
        ([true, false], _) => 1.0,
        _ => 0.0,
    };
    [together, apart]
}

/// Returns the squared distance of the nearest images.
pub(crate) fn distance_squared(particles: &Particles, pair: Pair, boundary: &Boundary) -> f64 {
    let [a, b] = [pair.i, pair.j].map(|at| particles.position_of(at as usize).map(f64::from));
    (0..3).map(|k| boundary.axes[k].displacement_exact(b[k] - a[k])).map(|d| d * d).sum()
}

/// Returns 0 if contacts are ignored.
fn contact_distance(model: &Model, a: u32, b: u32) -> f32 {
    let touch = model.species[a as usize].radius + model.species[b as usize].radius;
    if model.contact == Contact::Ignore { 0.0 } else { touch }
}

/// # Errors
/// [`Error::Detection`] for more species than the detector supports.
pub fn interactions(model: &Model) -> Result<Option<Interactions>, Error> {
    let all = if model.contact == Contact::Ignore { Interaction::Never } else { Interaction::Touch };
    if model.reactions.is_empty() && all == Interaction::Never {
        return Ok(None);
    }
    let refused = lazygrid::Error::from;
    let mut table = Interactions::new(model.species.len() as u32, all).map_err(refused)?;
    for reaction in &model.reactions {
        let [a, b] = reaction.reactants;
        let has_same_reactants = |other: &&Reaction| other.reactants == [a, b] || other.reactants == [b, a];
        let radii = model.reactions.iter().filter(has_same_reactants).map(|reaction| reaction.binding_radius);
        let distance = radii.fold(contact_distance(model, a, b), f32::max);
        table.set(a, b, Interaction::Within(distance.into())).map_err(refused)?;
    }
    Ok(Some(table))
}

/// Returns the species that may collide; `None` if all may.
///
/// Reactants pass through each other, and points never touch. Particles have the radius of their species.
///
/// # Errors
/// See [`interactions`].
pub(crate) fn collision_interactions(model: &Model) -> Result<Option<Interactions>, Error> {
    let is_point = |&species: &u32| model.species[species as usize].radius == 0.0;
    let points: Vec<u32> = (0..model.species.len() as u32).filter(is_point).collect();
    if model.reactions.is_empty() && points.is_empty() {
        return Ok(None);
    }
    let refused = lazygrid::Error::from;
    let mut table = Interactions::new(model.species.len() as u32, Interaction::Touch).map_err(refused)?;
    let of_points = points.iter().flat_map(|&a| points.iter().map(move |&b| [a, b]));
    let reactants = model.reactions.iter().map(|reaction| reaction.reactants);
    for [a, b] in of_points.filter(|[a, b]| a <= b).chain(reactants) {
        table.set(a, b, Interaction::Never).map_err(refused)?;
    }
    Ok(Some(table))
}

#[cfg(test)]
mod tests;
