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
use crate::random::philox::{Key, Purpose, probability_threshold};
use crate::reaction::matching::ReactionCandidate;

#[derive(Clone, Debug)]
pub struct Reactions {
    reactants: usize,
    /// Table row of a species; `u32::MAX` if it does not react.
    rows: Vec<u32>,
    /// Shells by both rows, innermost first.
    table: Vec<Vec<ReactionShell>>,
    reactions: Vec<Reaction>,
    /// Indexed by reaction: the first reactant's fraction of the approach, and the first product's of the separation.
    shares: Vec<[f32; 2]>,
    boundary: Boundary,
    center_domains: Vec<Boundary>,
}

#[derive(Clone, Debug)]
pub(crate) struct ReactionShell {
    /// Largest distance, if below the detector's.
    pub(crate) within: Option<f32>,
    /// In ascending order of words.
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
    pub(crate) first: u32,
    /// Largest random word at which it happens.
    pub(crate) up_to: u32,
    pub(crate) consumes: [bool; 2],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReactantChange {
    pub at: u32,
    /// `None` removes the particle.
    pub product: Option<u32>,
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
        let all = || reactants.iter().flat_map(|&a| reactants.iter().map(move |&b| [a, b]));
        Self {
            reactants: reactants.len(),
            rows,
            table: all().map(|pair| zones(model, chances, pair)).collect(),
            reactions: model.reactions.clone(),
            shares: model.reactions.iter().map(|reaction| shares(model, reaction)).collect(),
            boundary: model.boundary,
            center_domains: model.center_domains(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.reactions.is_empty()
    }

    /// Innermost first.
    #[inline]
    pub(crate) fn shells(&self, a: u32, b: u32) -> &[ReactionShell] {
        let [a, b] = [a, b].map(|species| self.rows[species as usize] as usize);
        if a.max(b) < self.reactants { &self.table[a * self.reactants + b] } else { &[] }
    }

    /// Returns the changes of a candidate's consumed reactants.
    ///
    /// Consumed reactants meet at their mean position, weighted by diffusion, where one product appears. Two products
    /// separate from there by the unbinding radius in a random direction.
    ///
    /// The product of a reactant next to a catalyst stays at its reactant's position, or appears at the unbinding
    /// radius from the catalyst.
    pub fn outcomes(
        &self,
        particles: &Particles,
        candidate: &ReactionCandidate,
        key: Key,
        step: u32,
    ) -> [Option<ReactantChange>; 2] {
        let reaction = &self.reactions[candidate.rule as usize];
        let [a, b] = candidate.at.map(|at| particles.position_of(at as usize));
        let toward = self.boundary.displacement(a, b);
        let [share, first_share] = self.shares[candidate.rule as usize];
        let meeting: [f32; 3] = std::array::from_fn(|k| a[k] + share * toward[k]);
        let has_catalyst = candidate.consumes.contains(&false);
        let separates = reaction.separates();
        let apart = match separates {
            true => {
                let [_, _, first, second] = key.draw(candidate.ids[0], candidate.ids[1], step, Purpose::Pair);
                let away = self.boundary.direction_within(direction(first, second));
                away.map(|c| c * reaction.unbinding_radius)
            }
            false => [0.0; 3],
        };
        let outcome = |k: usize, along: f32| {
            // The reactant's own position, since a sum of `toward` rounds it.
            let from = if has_catalyst && !separates { [a, b][k] } else { meeting };
            let domain =
                reaction.products[k].map_or(&self.boundary, |product| &self.center_domains[product as usize]);
            let position = domain.confine(std::array::from_fn(|axis| from[axis] + along * apart[axis]));
            let outcome = ReactantChange { at: candidate.at[k], product: reaction.products[k], position };
            candidate.consumes[k].then_some(outcome)
        };
        [outcome(0, -first_share), outcome(1, 1.0 - first_share)]
    }

    /// Returns all changes before any is applied: a catalyst may take part in several reactions.
    pub(crate) fn all_outcomes(
        &self,
        particles: &Particles,
        chosen: &[ReactionCandidate],
        key: Key,
        step: u32,
    ) -> Vec<ReactantChange> {
        chosen.iter().flat_map(|candidate| self.outcomes(particles, candidate, key, step)).flatten().collect()
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn shares_of(&self, reaction: u32) -> [f32; 2] {
        self.shares[reaction as usize]
    }
}

fn zones(model: &Model, chances: ReactionProbabilities<'_>, pair: [u32; 2]) -> Vec<ReactionShell> {
    let all = chances.zones(pair);
    let outermost = all.last().map_or(0.0, |zone| zone.radius).max(reach(model, pair[0], pair[1]));
    let zone = |zone: ProbabilityShell| {
        let mut below = 0.0;
        let rule = |(place, probability): (usize, f64)| {
            below += probability;
            let reaction = &model.reactions[place];
            Some(ReactionRule {
                reaction: place as u32,
                first: reaction.reactants[0],
                up_to: probability_threshold(below)?,
                consumes: consumes(reaction),
            })
        };
        let mut rules = zone.channels.into_iter().filter_map(rule);
        let within = (outermost > zone.radius).then_some(zone.radius);
        Some(ReactionShell { within, rule: rules.next()?, others: rules.collect() })
    };
    all.into_iter().filter_map(zone).collect()
}

fn consumes(reaction: &Reaction) -> [bool; 2] {
    [0, 1].map(|k| reaction.products[k] != Some(reaction.reactants[k]))
}

fn shares(model: &Model, reaction: &Reaction) -> [f32; 2] {
    let consumes = consumes(reaction);
    let together = match consumes {
        [true, true] => model.share(reaction.reactants),
        [true, false] => 1.0,
        _ => 0.0,
    };
    let apart = match (consumes, reaction.products) {
        ([true, true], [Some(c), Some(d)]) => model.share([c, d]),
        ([true, false], _) => 1.0,
        _ => 0.0,
    };
    [together, apart]
}

pub(crate) fn distance_squared(particles: &Particles, pair: Pair, boundary: &Boundary) -> f64 {
    let [a, b] = [pair.i, pair.j].map(|at| particles.position_of(at as usize).map(f64::from));
    (0..3).map(|k| boundary.axes[k].displacement_exact(b[k] - a[k])).map(|d| d * d).sum()
}

fn reach(model: &Model, a: u32, b: u32) -> f32 {
    let touch = model.species[a as usize].radius + model.species[b as usize].radius;
    if model.contact == Contact::Ignore { 0.0 } else { touch }
}

/// Returns the detector's interactions, if any.
///
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
        let same = |other: &&Reaction| other.reactants == [a, b] || other.reactants == [b, a];
        let radii = model.reactions.iter().filter(same).map(|reaction| reaction.binding_radius);
        let distance = radii.fold(reach(model, a, b), f32::max);
        table.set(a, b, Interaction::Within(distance.into())).map_err(refused)?;
    }
    Ok(Some(table))
}

#[cfg(test)]
mod tests {
    use super::candidates::{BestCandidates, StepPairs};
    use super::*;
    use crate::model::particles::Particle;
    use crate::model::{ReactionRate, Species};

    fn species(name: &str, diffusion: f64, radius: f32) -> Species {
        Species { name: name.into(), diffusion, radius, mass: 1.0, ..Species::default() }
    }

    fn model(products: [Option<u32>; 2]) -> Model {
        let binding_radius = 1.5;
        let reaction = Reaction { reactants: [0, 1], products, binding_radius, ..Reaction::default() };
        let species = vec![species("A", 3.0, 0.0), species("B", 1.0, 0.0), species("C", 1.0, 0.0)];
        Model { time_step: 1.0, species, reactions: vec![reaction], ..Model::default() }
    }

    fn two() -> Particles {
        let mut particles = Particles::default();
        particles.push(Particle { species: 1, id: 4, ..Particle::default() }, false);
        particles
            .push(Particle { species: 0, id: 8, position: [1.0, 0.0, 0.0], ..Particle::default() }, false);
        particles
    }

    const KEY: Key = Key::new(3);

    fn sample(reactions: &Reactions, particles: &Particles, step: u32) -> Vec<ReactionCandidate> {
        let mut best = BestCandidates::new(particles.len());
        let pairs = StepPairs { particles, pairs: &[Pair::new(0, 1)], key: KEY, step };
        reactions.sample(pairs, |_| false, &mut best).expect("memory");
        best.candidates
    }

    fn only(reactions: &Reactions, particles: &Particles) -> [Option<ReactantChange>; 2] {
        let candidates = sample(reactions, particles, 0);
        assert_eq!(candidates.len(), 1);
        assert_eq!((candidates[0].at, candidates[0].ids), ([1, 0], [4, 8]));
        reactions.outcomes(particles, &candidates[0], KEY, 0)
    }

    #[test]
    fn one_product_goes_where_the_reactants_meet() {
        let outcomes = only(&Reactions::new(&model([Some(2), None])), &two());
        let position = [0.25, 0.0, 0.0];
        assert_eq!(outcomes[0], Some(ReactantChange { at: 1, product: Some(2), position }));
        assert_eq!(outcomes[1].map(|o| (o.at, o.product)), Some((0, None)));
    }

    #[test]
    fn unconsumed_reactant_is_unchanged() {
        let outcomes = only(&Reactions::new(&model([None, Some(1)])), &two());
        assert_eq!(outcomes[0].map(|o| (o.at, o.product)), Some((1, None)));
        assert_eq!(outcomes[1], None);
    }

    #[test]
    fn product_next_to_a_catalyst_stays_unless_it_unbinds() {
        // A at 1 and B at 0, each as the catalyst.
        for catalyst in [1, 0] {
            let mut model = model([Some(2), Some(2)]);
            model.reactions[0].products[catalyst] = Some(catalyst as u32);
            let product = |model: &Model| only(&Reactions::new(model), &two())[1 - catalyst];
            let stays = product(&model).expect("a product");
            assert_eq!((stays.product, stays.position), (Some(2), [catalyst as f32, 0.0, 0.0]));
            model.reactions[0].unbinding_radius = 2.0;
            let unbinds = product(&model).expect("a product").position;
            let from = [1.0 - catalyst as f32, 0.0, 0.0];
            let square: f32 = unbinds.into_iter().zip(from).map(|(at, from)| (at - from).powi(2)).sum();
            assert!((square.sqrt() - 2.0).abs() < 1e-6, "{unbinds:?}");
        }
    }

    #[test]
    fn two_products_go_apart() {
        let mut model = model([Some(2), Some(0)]);
        model.reactions[0].unbinding_radius = 2.0;
        let [Some(c), Some(a)] = only(&Reactions::new(&model), &two()) else { panic!("two products") };
        let vector: [f32; 3] = std::array::from_fn(|k| a.position[k] - c.position[k]);
        assert!((vector.iter().map(|c| c * c).sum::<f32>().sqrt() - 2.0).abs() < 1e-6);
        for (k, from) in [0.25, 0.0, 0.0].into_iter().enumerate() {
            assert!((c.position[k] * 0.75 + a.position[k] * 0.25 - from).abs() < 1e-6);
        }
    }

    #[test]
    fn a_pair_that_only_overlaps_is_no_candidate() {
        let mut model = model([None, None]);
        model.contact = Contact::Separate;
        model.species[0].radius = 1.0;
        model.reactions[0].binding_radius = 0.5;
        let table = interactions(&model).unwrap().unwrap();
        assert_eq!(table.get(0, 1), Interaction::Within(1.0));
        assert_eq!(table.get(0, 2), Interaction::Touch);
        assert_eq!(sample(&Reactions::new(&model), &two(), 0), []);
        model.reactions[0].binding_radius = 1.0;
        assert_eq!(sample(&Reactions::new(&model), &two(), 0).len(), 1);
    }

    #[test]
    fn pair_takes_one_channel_within_its_radius() {
        let mut model = model([Some(2), None]);
        let channel = |binding_radius, p| Reaction {
            binding_radius,
            chance: ReactionRate::PerStep(p),
            ..model.reactions[0].clone()
        };
        model.reactions = vec![channel(1.5, 0.2), channel(0.9, 0.5), channel(1.0, 0.3)];
        let table = interactions(&model).unwrap().unwrap();
        assert_eq!(table.get(0, 1), Interaction::Within(1.5));
        let n = 20_000;
        let shares = |model: &Model| {
            let (reactions, particles) = (Reactions::new(model), two());
            let mut counts = [0; 3];
            for step in 0..n {
                let candidates = sample(&reactions, &particles, step);
                candidates.iter().for_each(|candidate| counts[candidate.rule as usize] += 1);
            }
            counts.map(|count| f64::from(count) / f64::from(n))
        };
        let is = |found: [f64; 3], expected: [f64; 3]| {
            for (found, p) in found.into_iter().zip(expected) {
                assert!(
                    (found - p).abs() <= 4.0 * (p * (1.0 - p) / f64::from(n)).sqrt(),
                    "{found} and not {p}"
                );
            }
        };
        is(shares(&model), [0.2, 0.0, 0.3]);
        model.reactions[1].binding_radius = 1.1;
        is(shares(&model), [0.2, 0.5, 0.3]);
    }

    #[test]
    fn probability_is_per_candidate() {
        let mut model = model([None, None]);
        model.reactions[0].chance = ReactionRate::PerStep(0.3);
        let (reactions, particles) = (Reactions::new(&model), two());
        let n = 20_000;
        let one = |step| sample(&reactions, &particles, step).len();
        let yes: usize = (0..n).map(one).sum();
        let error = (yes as f64 - f64::from(n) * 0.3) / (f64::from(n) * 0.21).sqrt();
        assert!(error.abs() < 4.0, "{error} standard errors");
    }
}
