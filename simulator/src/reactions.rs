//! Reactions of two particles: which pairs may react, and what comes of those that do.

use lazygrid::{Interaction, Interactions, Pair};
use rayon::prelude::*;

use crate::Error;
use crate::boundary::Boundary;
use crate::matching::Candidate;
use crate::model::{Contact, Model, Reaction};
use crate::particles::Particles;
use crate::philox::{Key, Purpose, yes_up_to};
use crate::transmitter::direction;

/// The reactions of a model, made ready.
#[derive(Clone, Debug)]
pub struct Reactions {
    species: usize,
    /// By both species.
    pub(crate) table: Vec<Option<Rule>>,
    reactions: Vec<Reaction>,
    diffusion: Vec<f64>,
    boundary: Boundary,
    /// By species: where walls let their centres be.
    rooms: Vec<Boundary>,
}

/// What is needed to decide about a pair.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rule {
    pub(crate) reaction: u32,
    /// The species that is the first reactant.
    pub(crate) first: u32,
    /// The largest word that means yes.
    pub(crate) up_to: u32,
    /// The binding radius, where the detector looks further than that.
    pub(crate) within: Option<f32>,
    /// Whether the first and the second reactant are used up.
    pub(crate) claims: [bool; 2],
}

/// What comes of one reactant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Where the particle is.
    pub at: u32,
    /// What it turns into; it is to be removed where there is nothing.
    pub product: Option<u32>,
    /// Where the product goes.
    pub position: [f32; 3],
}

/// Pairs that one task looks at.
const TASK: usize = 4096;

impl Reactions {
    /// The reactions of a model that was checked.
    pub fn new(model: &Model) -> Self {
        let species = model.species.len();
        let mut table = vec![None; species * species];
        for (place, reaction) in model.reactions.iter().enumerate() {
            let [a, b] = reaction.reactants;
            let Some(up_to) = yes_up_to(reaction.probability) else { continue };
            let claims = [0, 1].map(|k| reaction.products[k] != Some(reaction.reactants[k]));
            let within = (reach(model, a, b) > reaction.binding_radius).then_some(reaction.binding_radius);
            let rule = Some(Rule { reaction: place as u32, first: a, up_to, within, claims });
            table[a as usize * species + b as usize] = rule;
            table[b as usize * species + a as usize] = rule;
        }
        Self {
            species,
            table,
            reactions: model.reactions.clone(),
            diffusion: model.species.iter().map(|s| s.diffusion).collect(),
            boundary: model.boundary,
            rooms: model.rooms(),
        }
    }

    /// Whether nothing reacts.
    pub fn is_empty(&self) -> bool {
        self.reactions.is_empty()
    }

    /// The pairs that chance lets react, in the order of `pairs`.
    pub fn candidates(&self, particles: &Particles, pairs: &[Pair], key: Key, step: u32) -> Vec<Candidate> {
        if self.reactions.is_empty() {
            return Vec::new();
        }
        let candidates = |pairs: &[Pair]| {
            let of = |pair: &Pair| self.candidate(particles, *pair, key, step);
            pairs.iter().filter_map(of).collect::<Vec<_>>()
        };
        let chunks: Vec<_> = pairs.par_chunks(TASK).map(candidates).collect();
        chunks.concat()
    }

    fn candidate(&self, particles: &Particles, pair: Pair, key: Key, step: u32) -> Option<Candidate> {
        let (i, j) = (pair.i as usize, pair.j as usize);
        let (a, b) = (particles.species[i], particles.species[j]);
        let rule = self.table[a as usize * self.species + b as usize]?;
        if rule.within.is_some_and(|radius| !within(particles, pair, &self.boundary, radius)) {
            return None;
        }
        let ids = [particles.id[i].min(particles.id[j]), particles.id[i].max(particles.id[j])];
        let [priority, chance, ..] = key.draw(ids[0], ids[1], step, Purpose::Pair);
        if chance > rule.up_to {
            return None;
        }
        // Among equals the lower id comes first.
        let in_order = if a == b { particles.id[i] == ids[0] } else { a == rule.first };
        let at = if in_order { [pair.i, pair.j] } else { [pair.j, pair.i] };
        Some(Candidate { at, claims: rule.claims, rule: rule.reaction, priority, ids })
    }

    /// What comes of a candidate that has its turn, reactant by reactant; nothing of one that is not used up.
    ///
    /// Two reactants meet at their average, weighted so that the one that diffuses faster moved further. One product
    /// goes there; two go apart by the unbinding radius in a random direction, again the faster one further.
    pub fn outcomes(
        &self,
        particles: &Particles,
        candidate: &Candidate,
        key: Key,
        step: u32,
    ) -> [Option<Outcome>; 2] {
        let reaction = &self.reactions[candidate.rule as usize];
        let [a, b] = candidate.at.map(|at| particles.position_of(at as usize));
        let toward = self.boundary.offset(a, b);
        let [share, first_share] = self.shares(reaction, candidate.claims);
        let meeting: [f32; 3] = std::array::from_fn(|k| a[k] + share * toward[k]);
        let apart = match reaction.products {
            [Some(_), Some(_)] if reaction.unbinding_radius > 0.0 => {
                let [_, _, first, second] = key.draw(candidate.ids[0], candidate.ids[1], step, Purpose::Pair);
                direction(first, second).map(|c| c * reaction.unbinding_radius)
            }
            _ => [0.0; 3],
        };
        let outcome = |k: usize, along: f32| {
            let room = reaction.products[k].map_or(&self.boundary, |product| &self.rooms[product as usize]);
            let position = room.place(std::array::from_fn(|axis| meeting[axis] + along * apart[axis]));
            let outcome = Outcome { at: candidate.at[k], product: reaction.products[k], position };
            candidate.claims[k].then_some(outcome)
        };
        [outcome(0, -first_share), outcome(1, 1.0 - first_share)]
    }

    /// How much of the way to where they meet is the first reactant's, and of the way apart the first product's.
    pub(crate) fn shares(&self, reaction: &Reaction, claims: [bool; 2]) -> [f32; 2] {
        let together = match claims {
            [true, true] => self.share(reaction.reactants),
            [true, false] => 1.0,
            _ => 0.0,
        };
        let apart = match (claims, reaction.products) {
            ([true, true], [Some(c), Some(d)]) => self.share([c, d]),
            ([true, false], _) => 1.0,
            _ => 0.0,
        };
        [together, apart]
    }

    /// How much of the way between two particles is the first one's.
    fn share(&self, [a, b]: [u32; 2]) -> f32 {
        let [a, b] = [a, b].map(|species| self.diffusion[species as usize]);
        if a + b > 0.0 { (a / (a + b)) as f32 } else { 0.5 }
    }
}

/// Whether two particles are within a distance of each other; in `f64`, as the detector decides.
pub(crate) fn within(particles: &Particles, pair: Pair, boundary: &Boundary, radius: f32) -> bool {
    distance_squared(particles, pair, boundary) <= f64::from(radius) * f64::from(radius)
}

/// The squared distance of two particles.
pub(crate) fn distance_squared(particles: &Particles, pair: Pair, boundary: &Boundary) -> f64 {
    let [a, b] = [pair.i, pair.j].map(|at| particles.position_of(at as usize).map(f64::from));
    (0..3).map(|k| boundary.axes[k].offset_exact(b[k] - a[k])).map(|d| d * d).sum()
}

/// How far apart two particles of these species may be to matter to each other: the binding radius or, where
/// overlaps matter, the sum of their radii.
fn reach(model: &Model, a: u32, b: u32) -> f32 {
    let touch = model.species[a as usize].radius + model.species[b as usize].radius;
    if model.contact == Contact::Ignore { 0.0 } else { touch }
}

/// What the detector is to look for; `None` where nothing interacts.
///
/// # Errors
/// [`Error::Detection`] for more species than the detector's table may have.
pub fn interactions(model: &Model) -> Result<Option<Interactions>, Error> {
    let all = if model.contact == Contact::Ignore { Interaction::Never } else { Interaction::Touch };
    if model.reactions.is_empty() && all == Interaction::Never {
        return Ok(None);
    }
    let refused = lazygrid::Error::from;
    let mut table = Interactions::new(model.species.len() as u32, all).map_err(refused)?;
    for reaction in &model.reactions {
        let [a, b] = reaction.reactants;
        let distance = reach(model, a, b).max(reaction.binding_radius);
        table.set(a, b, Interaction::Within(distance)).map_err(refused)?;
    }
    Ok(Some(table))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Species;
    use crate::particles::Particle;

    fn species(name: &str, diffusion: f64, radius: f32) -> Species {
        Species { name: name.into(), diffusion, radius, mass: 1.0, ..Species::default() }
    }

    fn model(products: [Option<u32>; 2]) -> Model {
        let binding_radius = 1.5;
        let reaction =
            Reaction { reactants: [0, 1], products, binding_radius, probability: 1.0, ..Reaction::default() };
        let species = vec![species("A", 3.0, 0.0), species("B", 1.0, 0.0), species("C", 1.0, 0.0)];
        Model { time_step: 1.0, species, reactions: vec![reaction], ..Model::default() }
    }

    fn two() -> Particles {
        let mut particles = Particles::default();
        // The second reactant has the lower place and the lower id.
        particles.push(Particle { species: 1, id: 4, ..Particle::default() }, false);
        particles
            .push(Particle { species: 0, id: 8, position: [1.0, 0.0, 0.0], ..Particle::default() }, false);
        particles
    }

    const KEY: Key = Key::new(3);

    fn only(reactions: &Reactions, particles: &Particles) -> [Option<Outcome>; 2] {
        let candidates = reactions.candidates(particles, &[Pair::new(0, 1)], KEY, 0);
        assert_eq!(candidates.len(), 1);
        assert_eq!((candidates[0].at, candidates[0].ids), ([1, 0], [4, 8]));
        reactions.outcomes(particles, &candidates[0], KEY, 0)
    }

    #[test]
    fn one_product_goes_where_the_reactants_meet() {
        let outcomes = only(&Reactions::new(&model([Some(2), None])), &two());
        // A diffuses three times as fast as B and went three quarters of the way.
        let position = [0.25, 0.0, 0.0];
        assert_eq!(outcomes[0], Some(Outcome { at: 1, product: Some(2), position }));
        assert_eq!(outcomes[1].map(|o| (o.at, o.product)), Some((0, None)));
    }

    #[test]
    fn a_reactant_that_comes_out_again_stays() {
        let outcomes = only(&Reactions::new(&model([None, Some(1)])), &two());
        assert_eq!(outcomes[0].map(|o| (o.at, o.product)), Some((1, None)));
        assert_eq!(outcomes[1], None);
    }

    #[test]
    fn two_products_go_apart() {
        let mut model = model([Some(2), Some(0)]);
        model.reactions[0].unbinding_radius = 2.0;
        let [Some(c), Some(a)] = only(&Reactions::new(&model), &two()) else { panic!("two products") };
        let vector: [f32; 3] = std::array::from_fn(|k| a.position[k] - c.position[k]);
        assert!((vector.iter().map(|c| c * c).sum::<f32>().sqrt() - 2.0).abs() < 1e-6);
        // C diffuses a third as fast as A, and they part from where the reactants met.
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
        assert_eq!(Reactions::new(&model).candidates(&two(), &[Pair::new(0, 1)], KEY, 0), []);
        model.reactions[0].binding_radius = 1.0;
        assert_eq!(Reactions::new(&model).candidates(&two(), &[Pair::new(0, 1)], KEY, 0).len(), 1);
    }

    #[test]
    fn probability_is_per_candidate() {
        let mut model = model([None, None]);
        model.reactions[0].probability = 0.3;
        let (reactions, particles) = (Reactions::new(&model), two());
        let n = 20_000;
        let one = |step| reactions.candidates(&particles, &[Pair::new(0, 1)], KEY, step).len();
        let yes: usize = (0..n).map(one).sum();
        let error = (yes as f64 - f64::from(n) * 0.3) / (f64::from(n) * 0.21).sqrt();
        assert!(error.abs() < 4.0, "{error} standard errors");
    }
}
