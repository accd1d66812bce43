use std::fmt;
use std::str::FromStr;

use lazygrid::UnknownName;
use serde::{Deserialize, Serialize};

/// A figure of the report (`docs/benchmarks.md`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Figure {
    F3a,
    F3b,
    F4,
    StepLength,
    F5a,
    F5b,
    Transceivers,
    SizeRatio,
    Tau,
    Ratio,
    Threads,
    Memory,
    Point,
    Species,
}

impl Figure {
    /// Every figure, in the report's order.
    pub const ALL: [Self; 14] = [
        Self::F3a,
        Self::F3b,
        Self::F4,
        Self::StepLength,
        Self::F5a,
        Self::F5b,
        Self::Transceivers,
        Self::SizeRatio,
        Self::Tau,
        Self::Ratio,
        Self::Threads,
        Self::Memory,
        Self::Point,
        Self::Species,
    ];

    pub const fn name(self) -> &'static str {
        match self {
            Self::F3a => "3a",
            Self::F3b => "3b",
            Self::F4 => "4",
            Self::StepLength => "step-length",
            Self::F5a => "5a",
            Self::F5b => "5b",
            Self::Transceivers => "transceivers",
            Self::SizeRatio => "size-ratio",
            Self::Tau => "tau",
            Self::Ratio => "ratio",
            Self::Threads => "threads",
            Self::Memory => "memory",
            Self::Point => "point",
            Self::Species => "species",
        }
    }

    pub(super) const fn varied(self) -> Option<&'static str> {
        match self {
            Self::StepLength => Some("step in radii"),
            Self::F5a | Self::F5b => Some("simulated time"),
            Self::Transceivers => Some("transceivers"),
            Self::SizeRatio => Some("size ratio"),
            Self::Tau => Some("τ"),
            Self::Ratio => Some("cell ratio"),
            Self::Threads => Some("threads"),
            _ => None,
        }
    }

    /// Trees cannot use more than one thread.
    pub(super) const fn is_single_threaded(self) -> bool {
        matches!(self, Self::F4 | Self::StepLength | Self::Transceivers | Self::SizeRatio)
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
