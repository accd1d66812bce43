use crate::model::Model;

/// Pairs of species that react. They must overlap, so they neither collide nor are separated.
#[derive(Clone, Debug)]
pub(crate) struct ReactivePairs {
    /// Index of each species' first partner, then the number of partners.
    first: Vec<usize>,
    partners: Vec<u32>,
}

impl ReactivePairs {
    pub(crate) fn new(model: &Model) -> Self {
        let both = model.reactions.iter().flat_map(|reaction| {
            let [a, b] = reaction.reactants;
            [(a, b), (b, a)]
        });
        let mut pairs: Vec<(u32, u32)> = both.collect();
        pairs.sort_unstable();
        pairs.dedup();
        let species = 0..=model.species.len() as u32;
        let first = species.map(|species| pairs.partition_point(|pair| pair.0 < species)).collect();
        Self { first, partners: pairs.into_iter().map(|pair| pair.1).collect() }
    }

    #[inline]
    pub(crate) fn contain(&self, a: u32, b: u32) -> bool {
        let [first, end] = [0, 1].map(|k| self.first[a as usize + k]);
        self.partners[first..end].contains(&b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Reaction, Species};

    #[test]
    fn both_orders_of_reactants_are_pairs() {
        let reaction = |reactants| Reaction { reactants, ..Reaction::default() };
        let model = Model {
            species: vec![Species::default(); 4],
            reactions: vec![reaction([3, 1]), reaction([2, 2]), reaction([1, 3]), reaction([1, 2])],
            ..Model::default()
        };
        let pairs = ReactivePairs::new(&model);
        let all = (0..4).flat_map(|a| (0..4).map(move |b| (a, b)));
        let found: Vec<_> = all.filter(|&(a, b)| pairs.contain(a, b)).collect();
        assert_eq!(found, [(1, 2), (1, 3), (2, 1), (2, 2), (3, 1)]);
    }
}
