/// The contents of a neighbor list.
///
/// ```
/// # use lazygrid_host::ListOptions;
/// let as_ase_has_it = ListOptions::full().open().shifts().vectors().distances();
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ListOptions {
    pub(super) is_half: bool,
    pub(super) is_open: bool,
    pub(super) has_self: bool,
    pub(super) shifts: bool,
    pub(super) vectors: bool,
    pub(super) distances: bool,
}

impl ListOptions {
    /// Lists every pair twice: `j` is a neighbor of `i`, and `i` one of `j`. The default.
    pub fn full() -> Self {
        Self::default()
    }

    /// Lists every pair once: `i < j`, and of two opposite images of a sphere the one whose first nonzero shift is
    /// positive. For two sets it equals [`full`](Self::full).
    pub fn half() -> Self {
        Self { is_half: true, ..Self::default() }
    }

    /// Omits neighbors whose distance, rounded, is not less than their cutoff, as ASE and matscipy do. Otherwise
    /// spheres that touch are neighbors.
    pub fn open(self) -> Self {
        Self { is_open: true, ..self }
    }

    /// Adds every sphere whose cutoff with itself is not zero as its own neighbor, at distance zero. It does not affect
    /// two sets.
    pub fn with_self(self) -> Self {
        Self { has_self: true, ..self }
    }

    /// Fills [`NeighborList::shifts`](super::NeighborList::shifts).
    pub fn shifts(self) -> Self {
        Self { shifts: true, ..self }
    }

    /// Fills [`NeighborList::vectors`](super::NeighborList::vectors).
    pub fn vectors(self) -> Self {
        Self { vectors: true, ..self }
    }

    /// Fills [`NeighborList::distances`](super::NeighborList::distances).
    pub fn distances(self) -> Self {
        Self { distances: true, ..self }
    }
}
