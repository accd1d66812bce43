//! Correctness and speed checks of lazygrid on the machine at hand, for `lazygrid check` and for the tests:
//!
//! * [`TestInput`]: spheres, species, space and exclusions, with the [oracle](TestInput::oracle), a plain double loop
//!   over pairs (and over all images within the cutoff in triclinic cells).
//! * [`adversary`], [`periodic`], [`sheared`]: families of scenes that are hard on grids, made from a [`SceneSeed`] so
//!   that they shrink.
//! * [`scenes`]: single hard scenes.
//! * [`difference`]: compares a result with the expected pairs and explains the first wrong pair.
//! * [`DetectorVariant`], [`compare`]: runs each algorithm on each target and compares it with the expected pairs;
//!   [`shrink`] minimizes failing scenes.
//! * [`fuzz`]: random scenes, settings and calls.
//! * [`kernels`]: each GPU kernel against a sequential function.
//! * [`bandwidth`], [`speed`]: times of copies, of the building blocks and of each algorithm.

pub mod adversary;
pub mod bandwidth;
pub mod compare;
pub mod device;
pub mod fuzz;
pub mod kernels;
pub mod periodic;
pub mod primitives;
pub mod scenes;
pub mod sequence;
pub mod sheared;
pub mod speed;

mod axes;
mod calls;
mod cells;
mod choices;
mod difference;
mod division;
mod grid;
mod homes;
mod images;
mod left_out;
mod list;
pub mod motion;
mod nested;
mod random;
mod runs;
mod scenario;
mod shares;
mod shrink;
mod skin;
mod way;

/// The effort of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Small scenes and sizes only: takes seconds.
    Quick,
    /// About a minute, also on a software adapter.
    Default,
    /// More and larger scenes and sizes: up to an hour on a software adapter.
    Full,
}

pub use choices::{ElementSeed, SceneSeed, SeedReader};
pub use difference::{Tolerance, checksum, difference};
pub use left_out::{EXCLUSION_WORDS, ExclusionCase};
pub use random::Random;
pub use scenario::{SpeciesSetup, TestInput};
pub use shrink::shrink;
pub use way::{DetectorVariant, Gpu, TargetDevice, catch_panic};
