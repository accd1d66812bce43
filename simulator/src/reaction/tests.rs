use super::candidates::{BestCandidates, StepPairs};
use super::*;
use crate::model::particles::Particle;
use crate::model::{Decay, ReactionRate, Species};
use crate::random::philox::Key;
use crate::reaction::dissociation::Dissociation;

fn species(name: &str, diffusion: f64, radius: f32) -> Species {
    Species { name: name.into(), diffusion, radius, ..Species::default() }
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
    particles.push(Particle { species: 0, id: 8, position: [1.0, 0.0, 0.0], ..Particle::default() }, false);
    particles
}

const KEY: Key = Key::new(3);

fn sample(reactions: &Reactions, particles: &Particles, step: u32) -> Vec<ReactionCandidate> {
    let mut best = BestCandidates::new(particles.len());
    let pairs =
        StepPairs { particles, pairs: &[Pair::new(0, 1)], spared: &[], now: StepKey { key: KEY, step } };
    reactions.sample(pairs, |_| false, &mut best).expect("memory");
    best.candidates
}

fn only(reactions: &Reactions, particles: &Particles) -> [Option<ReactantChange>; 2] {
    let candidates = sample(reactions, particles, 0);
    assert_eq!(candidates.len(), 1);
    assert_eq!((candidates[0].at, candidates[0].ids), ([1, 0], [4, 8]));
    reactions.outcomes(particles, &candidates[0], StepKey { key: KEY, step: 0 })
}

#[test]
fn one_product_appears_where_the_reactants_meet() {
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
fn two_products_separate_by_the_unbinding_radius() {
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
    let fractions = |model: &Model| {
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
            assert!((found - p).abs() <= 4.0 * (p * (1.0 - p) / f64::from(n)).sqrt(), "{found} and not {p}");
        }
    };
    is(fractions(&model), [0.2, 0.0, 0.3]);
    model.reactions[1].binding_radius = 1.1;
    is(fractions(&model), [0.2, 0.5, 0.3]);
}

#[test]
fn particles_that_dissociate_do_not_react() {
    let n = 2000;
    let cases =
        [0, 1].map(|reactant| [[None, None], [Some(0), None], [None, Some(1)]].map(|p| (reactant, p)));
    for (reactant, products) in cases.concat() {
        let mut model = model(products);
        model.decays = vec![Decay { reactant, products: [Some(2); 2], rate: 0.5, ..Decay::default() }];
        let (reactions, dissociation, particles) = (Reactions::new(&model), Dissociation::new(&model), two());
        let mut dissociated = 0;
        for step in 0..n {
            let splits = dissociation.splits(&particles, &[], KEY, step);
            assert_eq!(sample(&reactions, &particles, step).len() + splits.len(), 1);
            dissociated += splits.len();
        }
        let fraction = dissociated as f64 / f64::from(n);
        assert!((fraction - (1.0 - (-0.5_f64).exp())).abs() < 0.05, "{fraction}");
    }
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

#[test]
fn either_of_two_equal_reactants_is_consumed() {
    let n = 20_000;
    let mut particles = two();
    particles.species = vec![0, 0];
    for products in [[Some(0), None], [Some(2), Some(0)], [Some(1), Some(2)]] {
        let mut model = model(products);
        model.reactions[0].reactants = [0, 0];
        let reactions = Reactions::new(&model);
        let is_ascending = |&step: &u32| {
            let candidates = sample(&reactions, &particles, step);
            let candidate = candidates[0];
            assert_eq!((candidates.len(), candidate.ids), (1, [4, 8]));
            candidate.at == [0, 1]
        };
        let ascending = (0..n).filter(is_ascending).count() as f64;
        let error = (ascending - 0.5 * f64::from(n)) / (0.25 * f64::from(n)).sqrt();
        assert!(error.abs() < 5.0, "{products:?}: {ascending}, {error} standard errors");
    }
}

#[test]
fn reactants_and_points_do_not_collide() {
    let mut model = model([None, None]);
    model.species.push(species("D", 1.0, 0.5));
    model.reactions[0].reactants = [3, 2];
    let collide = |model: &Model, pair: [u32; 2]| {
        let table = collision_interactions(model).expect("few species");
        table.map(|table| table.get(pair[0], pair[1]) == Interaction::Touch)
    };
    for (radius, expected) in [(0.0, [false, true, false]), (0.3, [true, true, false])] {
        model.species[2].radius = radius;
        assert_eq!([[0, 2], [0, 3], [2, 3]].map(|pair| collide(&model, pair)), expected.map(Some));
        assert_eq!(
            [[2, 0], [1, 0], [1, 1]].map(|pair| collide(&model, pair)),
            [expected[0], false, false].map(Some)
        );
        assert_eq!([[2, 2], [3, 3]].map(|pair| collide(&model, pair)), [expected[0], true].map(Some));
    }
    model.species.iter_mut().for_each(|species| species.radius = 0.3);
    assert_eq!(collide(&model, [0, 0]), Some(true));
    model.reactions.clear();
    assert_eq!(collide(&model, [0, 0]), None);
}
