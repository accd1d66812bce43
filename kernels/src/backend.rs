use std::fmt;
use std::str::FromStr;

use crate::UnknownName;

/// The processor of a search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Backend {
    /// CPU, or a hardware GPU if present and, for spheres in host memory, favored by a measurement or estimate. An
    /// algorithm that runs only on GPUs falls back to a software adapter.
    #[default]
    Auto,
    /// CPU, through rayon.
    Cpu,
    /// A wgpu adapter, hardware or software. Never falls back.
    Gpu,
}

impl Backend {
    /// Every value.
    pub const ALL: &'static [Self] = &[Self::Auto, Self::Cpu, Self::Gpu];

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
        let found = Self::ALL.iter().copied().find(|backend| backend.name() == text);
        let names = || Self::ALL.iter().map(|backend| backend.name()).collect::<Vec<_>>();
        found.ok_or_else(|| UnknownName::new("backend", text, &names()))
    }
}
