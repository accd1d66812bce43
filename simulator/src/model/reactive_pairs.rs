use crate::model::Model;

/// Pairs of species that react with each other. They overlap in order to react, so no contact keeps them apart.
#[derive(Clone, Debug)]
pub(crate) struct ReactivePairs {
    species: usize,
    /// Flags by row and column.
    reacts: Vec<bool>,
}

impl ReactivePairs {
    pub(crate) fn new(model: &Model) -> Self {
        let species = model.species.len();
        let mut reacts = vec![false; species * species];
        for reaction in &model.reactions {
            let [a, b] = reaction.reactants.map(|species| species as usize);
            reacts[a * species + b] = true;
            reacts[b * species + a] = true;
        }
        Self { species, reacts }
    }

    #[inline]
    pub(crate) fn contain(&self, a: u32, b: u32) -> bool {
        self.reacts[a as usize * self.species + b as usize]
    }
}
