use std::fmt;
use std::str::FromStr;

use crate::UnknownName;

/// The algorithms, which all find the same pairs. Text form (`Display`, `FromStr`): `cell-list`, `recursive-grid`, …
/// Sections refer to Stroobant et al.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Algorithm {
    /// Chosen per call from the number of spheres and the spread of their radii.
    #[default]
    Auto,
    /// Tests all pairs: the reference, and the fastest for a few hundred spheres.
    Naive,
    /// Uniform grid in a hash table with chaining (section 3.1). CPU.
    HashGrid,
    /// Uniform grid as an array of (cell, object) entries sorted by cell (section 3.1). CPU and GPU.
    ArrayGrid,
    /// Uniform grid of the largest diameter, with overfull cells split again (section 3.2). CPU.
    RecursiveGrid,
    /// Each sphere in the cell of its center, at the level of its size. CPU and GPU.
    CellList,
    /// Nested grids; every cell passes smaller objects to the next level (section 3.2). GPU.
    EagerGrid,
    /// Nested grids; only overfull cells pass smaller objects to the next level (section 3.2). GPU.
    LazyGrid,
}

impl Algorithm {
    /// Every value, in the order of the command's help.
    pub const ALL: &'static [Self] = &[
        Self::Auto,
        Self::Naive,
        Self::HashGrid,
        Self::ArrayGrid,
        Self::RecursiveGrid,
        Self::CellList,
        Self::EagerGrid,
        Self::LazyGrid,
    ];

    /// Algorithms on the CPU, naive first.
    pub const CPU: &'static [Self] =
        &[Self::Naive, Self::HashGrid, Self::ArrayGrid, Self::RecursiveGrid, Self::CellList];

    /// Algorithms on the GPU, naive first.
    pub const GPU: &'static [Self] =
        &[Self::Naive, Self::ArrayGrid, Self::EagerGrid, Self::LazyGrid, Self::CellList];

    /// Returns the name in lower case with hyphens.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Naive => "naive",
            Self::HashGrid => "hash-grid",
            Self::ArrayGrid => "array-grid",
            Self::RecursiveGrid => "recursive-grid",
            Self::CellList => "cell-list",
            Self::EagerGrid => "eager-grid",
            Self::LazyGrid => "lazy-grid",
        }
    }
}

impl fmt::Display for Algorithm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Algorithm {
    type Err = UnknownName;

    fn from_str(text: &str) -> Result<Self, UnknownName> {
        let found = Self::ALL.iter().copied().find(|algorithm| algorithm.name() == text);
        let names = || Self::ALL.iter().map(|algorithm| algorithm.name()).collect::<Vec<_>>();
        found.ok_or_else(|| UnknownName::new("algorithm", text, &names()))
    }
}
