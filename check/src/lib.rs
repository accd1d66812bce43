//! Correctness and speed checks of lazygrid; `docs/design/tools.md` describes their parts.

#![allow(missing_docs, reason = "internal to the workspace: most names and types are clear")]

pub mod detectors;
pub mod device;
pub mod kernels;
pub mod oracle;
pub mod scenes;
pub mod timing;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Takes seconds.
    Quick,
    /// Takes about a minute, also on a software adapter.
    Default,
    /// Takes up to an hour on a software adapter.
    Full,
}

pub use detectors::{DetectorVariant, Gpu, TargetDevice, catch_panic};
pub use oracle::{
    EXCLUSION_WORDS, ExclusionCase, SpeciesSetup, TestInput, Tolerance, checksum, difference, shrink,
};
pub use scenes::{ElementSeed, Random, SceneSeed, SeedReader};
