//! Which figures there are.

use std::fmt;
use std::str::FromStr;

use lazygrid::UnknownName;
use serde::{Deserialize, Serialize};

/// A figure, or a table beside the paper's figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Figure {
    /// Equal sizes: time against the number of spheres.
    F3a,
    /// Five sizes beside equal ones.
    F3b,
    /// One thread beside the trees, over small moves.
    F4,
    /// One thread beside lists with a skin, over steps of several lengths.
    Moves,
    /// One burst of carriers of ten sizes: time against simulated time.
    F5a,
    /// Bursts of several sizes at several moments: how many times as fast as the octree.
    F5b,
    /// Transceivers among carriers, by their number and by how many times as large they are.
    Transceivers,
    /// As many transceivers, one size of them after the other: growth with the ratio of sizes.
    SizeRatio,
    /// τ of the recursive grid.
    Tau,
    /// Cell edge over largest diameter of the paper's grids.
    Ratio,
    /// Strong scaling.
    Threads,
    /// Bytes per sphere.
    Memory,
    /// All spheres at one point.
    Point,
}

impl Figure {
    /// Every figure in the order of the report.
    pub const ALL: [Self; 13] = [
        Self::F3a,
        Self::F3b,
        Self::F4,
        Self::Moves,
        Self::F5a,
        Self::F5b,
        Self::Transceivers,
        Self::SizeRatio,
        Self::Tau,
        Self::Ratio,
        Self::Threads,
        Self::Memory,
        Self::Point,
    ];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::F3a => "3a",
            Self::F3b => "3b",
            Self::F4 => "4",
            Self::Moves => "moves",
            Self::F5a => "5a",
            Self::F5b => "5b",
            Self::Transceivers => "transceivers",
            Self::SizeRatio => "size-ratio",
            Self::Tau => "tau",
            Self::Ratio => "ratio",
            Self::Threads => "threads",
            Self::Memory => "memory",
            Self::Point => "point",
        }
    }

    /// What is varied besides the number of spheres, if anything is.
    pub(super) const fn varied(self) -> Option<&'static str> {
        match self {
            Self::Moves => Some("step in radii"),
            Self::F5a | Self::F5b => Some("simulated time"),
            Self::Transceivers => Some("transceivers"),
            Self::SizeRatio => Some("size ratio"),
            Self::Tau => Some("τ"),
            Self::Ratio => Some("raster ratio"),
            Self::Threads => Some("threads"),
            _ => None,
        }
    }

    /// Whether all engines have one thread, since trees have no more.
    pub(super) const fn is_single_threaded(self) -> bool {
        matches!(self, Self::F4 | Self::Moves | Self::Transceivers | Self::SizeRatio)
    }
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Figure {
    type Err = UnknownName;

    fn from_str(text: &str) -> Result<Self, UnknownName> {
        let found = Self::ALL.into_iter().find(|figure| figure.name() == text);
        found.ok_or_else(|| UnknownName::new("figure", text, &Self::ALL.map(Self::name)))
    }
}

impl From<Figure> for String {
    fn from(figure: Figure) -> Self {
        figure.name().to_owned()
    }
}

impl TryFrom<String> for Figure {
    type Error = UnknownName;

    fn try_from(text: String) -> Result<Self, UnknownName> {
        text.parse()
    }
}
