//! Dissociation of one particle into two: `C -> A + B`.
//!
//! Products are placed after the reactions of the step, whose products do not dissociate in it. So each process can be
//! the inverse of the other.

use rayon::prelude::*;

use crate::model::boundary::Boundary;
use crate::model::particles::Particles;
use crate::model::probability::ReactionProbabilities;
use crate::model::{Decay, Model, Unbinding};
use crate::random::gaussian::direction;
use crate::random::philox::{Key, Purpose, open_unit, probability_threshold};

#[derive(Clone, Debug, Default)]
pub struct Dissociation {
    /// Indexed by species.
    channels: Vec<Vec<(u32, DissociationChannel)>>,
    any: bool,
    boundary: Boundary,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct DissociationChannel {
    pub(crate) decay: u32,
    pub(crate) products: [Option<Product>; 2],
    pub(crate) unbinding: Unbinding,
    /// The first product's fraction of the distance.
    pub(crate) first_fraction: f32,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Product {
    pub(crate) species: u32,
    /// In µm.
    pub(crate) radius: f32,
    /// Boundary of the center.
    domain: Boundary,
}

/// A dissociation, or another decay of the species.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dissociated {
    pub at: u32,
    pub id: u32,
    /// Index in the model.
    pub decay: u32,
    /// Species, radius and position, in µm.
    pub products: [Option<(u32, f32, [f32; 3])>; 2],
}

impl Dissociated {
    /// Returns `true` if there is a second product, which needs a new id.
    pub(crate) fn is_parent(&self) -> bool {
        self.products[1].is_some()
    }
}

const CHUNK: usize = 4096;

/// Returns decays, each with the largest random word at which it happens.
pub(crate) fn channel_words(model: &Model, species: u32) -> Vec<(u32, usize)> {
    if !model.dissociates(species) {
        return Vec::new();
    }
    let mut below = 0.0;
    let word = |(index, probability): (usize, f64)| {
        below += probability;
        Some((probability_threshold(below)?, index))
    };
    ReactionProbabilities(model).decays(species).into_iter().filter_map(word).collect()
}

impl Dissociation {
    pub fn new(model: &Model) -> Self {
        let center_domains = model.center_domains();
        let product = |species: u32| Product {
            species,
            radius: model.species[species as usize].radius,
            domain: center_domains[species as usize],
        };
        let channel = |index: usize| {
            let Decay { products, unbinding, .. } = model.decays[index];
            let first_fraction = match products {
                [Some(a), Some(b)] => model.first_fraction([a, b]),
                _ => 0.0,
            };
            let products = products.map(|species| species.map(product));
            DissociationChannel { decay: index as u32, products, unbinding, first_fraction }
        };
        let of_species = |species: u32| {
            let words = channel_words(model, species).into_iter();
            words.map(|(up_to, index)| (up_to, channel(index))).collect()
        };
        let channels: Vec<_> = (0..model.species.len() as u32).map(of_species).collect();
        let any = channels.iter().any(|channels: &Vec<_>| !channels.is_empty());
        Self { any, channels, boundary: model.boundary }
    }

    pub fn is_empty(&self) -> bool {
        !self.any
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn channels(&self, species: u32) -> &[(u32, DissociationChannel)] {
        &self.channels[species as usize]
    }

    /// Dissociations in the order of particles, without the ascending ids `spared`.
    pub fn splits(&self, particles: &Particles, spared: &[u32], key: Key, step: u32) -> Vec<Dissociated> {
        if !self.any {
            return Vec::new();
        }
        let dissociates = |split: &Dissociated| spared.binary_search(&split.id).is_err();
        let chunks = particles.species.par_chunks(CHUNK).enumerate().map(|(chunk, species)| {
            let base = chunk * CHUNK;
            let split = |k: usize| self.split(particles, base + k, key, step);
            (0..species.len()).filter_map(split).filter(dissociates).collect()
        });
        chunks.collect::<Vec<Vec<Dissociated>>>().concat()
    }

    fn split(&self, particles: &Particles, at: usize, key: Key, step: u32) -> Option<Dissociated> {
        let channels = &self.channels[particles.species[at] as usize];
        if channels.is_empty() {
            return None;
        }
        let id = particles.id[at];
        let [word, far, first, second] = key.draw(id, 0, step, Purpose::Dissociation);
        let &(_, channel) = channels.iter().find(|(up_to, _)| word <= *up_to)?;
        let distance = match channel.unbinding {
            Unbinding::Apart(radius) => radius,
            Unbinding::Within(radius) => match self.boundary.dimensions() {
                3 => radius * libm::cbrtf(open_unit(far)),
                2 => radius * open_unit(far).sqrt(),
                _ => radius * open_unit(far),
            },
        };
        let away = self.boundary.direction_within(direction(first, second));
        let apart = away.map(|c| c * distance);
        let from = particles.position_of(at);
        let product_at = |product: Product, along: f32| {
            let to = std::array::from_fn(|k| from[k] + along * apart[k]);
            (product.species, product.radius, product.domain.confine(to))
        };
        let alone = channel.products[1].is_none();
        let along = if alone { [0.0; 2] } else { [-channel.first_fraction, 1.0 - channel.first_fraction] };
        let products = [0, 1].map(|k| channel.products[k].map(|product| product_at(product, along[k])));
        Some(Dissociated { at: at as u32, id, decay: channel.decay, products })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Species;
    use crate::model::particles::Particle;

    fn model(unbinding: Unbinding) -> Model {
        let species = |diffusion, radius| Species { diffusion, radius, ..Species::default() };
        let decay = |products, rate| Decay { reactant: 2, products, unbinding, rate, ..Decay::default() };
        Model {
            time_step: 0.1,
            species: vec![species(3.0, 0.1), species(1.0, 0.2), species(1.0, 0.3)],
            decays: vec![decay([Some(0), Some(1)], 3.0), decay([Some(1), None], 1.0)],
            ..Model::default()
        }
    }

    fn splits(model: &Model, n: u32) -> Vec<Dissociated> {
        let mut particles = Particles::default();
        let particle = |id| Particle { position: [1.0, 2.0, 3.0], species: 2, id, ..Particle::default() };
        (0..n).for_each(|id| particles.push(particle(id), false));
        Dissociation::new(model).splits(&particles, &[], Key::new(4), 6)
    }

    #[test]
    fn products_separate_by_the_radius_in_proportion_to_diffusion() {
        let n = 10_000;
        let splits = splits(&model(Unbinding::Apart(0.5)), n);
        for (decay, fraction) in [(0, 0.75), (1, 0.25)] {
            let p = (1.0 - (-0.4_f64).exp()) * fraction;
            let count = splits.iter().filter(|split| split.decay == decay).count() as f64;
            assert!((count - f64::from(n) * p).abs() < 4.0 * (f64::from(n) * p).sqrt(), "{decay}: {count}");
        }
        for split in &splits {
            let Some((first, _, a)) = split.products[0] else { panic!("{split:?}") };
            let Some((second, radius, b)) = split.products[1] else {
                assert_eq!((first, a), (1, [1.0, 2.0, 3.0]));
                continue;
            };
            assert_eq!((first, second, radius), (0, 1, 0.2));
            let apart: f32 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt();
            assert!((apart - 0.5).abs() < 1e-5, "{apart}");
            for (k, from) in [1.0, 2.0, 3.0].into_iter().enumerate() {
                assert!((0.25 * a[k] + 0.75 * b[k] - from).abs() < 1e-5, "{split:?}");
            }
        }
    }

    #[test]
    fn within_a_ball_all_distances_are_as_likely_as_their_volume() {
        let splits = splits(&model(Unbinding::Within(0.5)), 20_000);
        let both = splits.iter().filter_map(|split| Some((split.products[0]?.2, split.products[1]?.2)));
        let inner: Vec<bool> =
            both.map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>() < 0.0625).collect();
        let fraction = inner.iter().filter(|inner| **inner).count() as f64 / inner.len() as f64;
        assert!((fraction - 0.125).abs() < 4.0 * (0.125 * 0.875 / inner.len() as f64).sqrt(), "{fraction}");
    }
}
