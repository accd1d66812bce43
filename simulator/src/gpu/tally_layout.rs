/// Indices of tallies: arrivals by receiver and species, decays, reactions, changes of occupied receptors by type, and
/// each type's requests and refused requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tallies {
    pub(super) species: usize,
    pub(super) receivers: usize,
    pub(super) decays: usize,
    pub(super) reactions: usize,
    pub(super) receptors: usize,
}

impl Tallies {
    pub(super) fn arrival(&self, receiver: usize, species: usize) -> usize {
        receiver * self.species + species
    }

    pub(super) fn decay(&self, decay: usize) -> usize {
        self.receivers * self.species + decay
    }

    pub(super) fn reaction(&self, reaction: usize) -> usize {
        self.decay(self.decays) + reaction
    }

    pub(super) fn occupied(&self, receptor: usize) -> usize {
        self.reaction(self.reactions) + receptor
    }

    pub(super) fn requests(&self, receptor: usize) -> usize {
        self.occupied(self.receptors) + 2 * receptor
    }

    pub(super) fn len(&self) -> usize {
        self.requests(self.receptors)
    }
}
