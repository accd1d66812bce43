use std::fmt;
use std::str::FromStr;

use crate::UnknownName;

/// The processor that does the work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Backend {
    /// The CPU, or a real GPU if there is one. A call with spheres in the host's memory runs on the GPU if it has
    /// enough spheres for the GPU to answer earlier, by measurement or estimate. An algorithm that only GPUs have takes
    /// a software adapter if there is no real one.
    #[default]
    Auto,
    /// The CPU, through rayon.
    Cpu,
    /// A wgpu adapter, software ones included. Never falls back.
    Gpu,
}

impl Backend {
    /// Every value.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Cpu, Self::Gpu];

    /// Returns the name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
        }
    }
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Backend {
    type Err = UnknownName;

    fn from_str(text: &str) -> Result<Self, UnknownName> {
        let found = Self::ALL.into_iter().find(|backend| backend.name() == text);
        found.ok_or_else(|| UnknownName::new("backend", text, &Self::ALL.map(Self::name)))
    }
}
