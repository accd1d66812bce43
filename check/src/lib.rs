//! Correctness and speed checks of lazygrid on the machine at hand:
//!
//! * [`oracle`]: a [`TestInput`] and its pairs by a plain double loop; [`difference`] explains the first wrong pair,
//!   and [`shrink`] minimizes failing scenes.
//! * [`scenes`]: hard scenes, and families of scenes from a [`SceneSeed`].
//! * [`detectors`]: compares each [`DetectorVariant`] with the expected pairs.
//! * [`kernels`]: each GPU kernel against a sequential function.
//! * [`timing`]: times of copies, of the building blocks and of each algorithm.

#![allow(missing_docs, reason = "internal to the workspace: most names and types are clear")]

pub mod detectors;
pub mod device;
pub mod kernels;
pub mod oracle;
pub mod scenes;
pub mod timing;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Seconds.
    Quick,
    /// About a minute, also on a software adapter.
    Default,
    /// Up to an hour on a software adapter.
    Full,
}

pub use detectors::{DetectorVariant, Gpu, TargetDevice, catch_panic};
pub use oracle::{
    EXCLUSION_WORDS, ExclusionCase, SpeciesSetup, TestInput, Tolerance, checksum, difference, shrink,
};
pub use scenes::{ElementSeed, Random, SceneSeed, SeedReader};
