//! What holds lazygrid to its promises on the machine at hand: `lazygrid check`, and what the tests share with it.
//!
//! * [`Scenario`] — spheres, their species, their space and what is left out of their pairs, and the [oracle](Scenario::oracle): a plain
//!   double loop, over all images in reach where edges lean;
//! * [`adversary`], [`periodic`], [`sheared`] — families of scenes that are hard on grids, made of [`Words`] so that they shrink;
//! * [`scenes`] — single ones, each chosen for one thing;
//! * [`difference`] — compares a result with the expected pairs and explains the first wrong one;
//! * [`Way`], [`compare`] — every algorithm and what it runs on, against those pairs; [`shrink`] makes what fails small;
//! * [`fuzz`] — scenes, settings and calls at random;
//! * [`kernels`] — each GPU kernel against a sequential function;
//! * [`bandwidth`], [`speed`] — copies, the building blocks and every algorithm by the clock.

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

mod calls;
mod cells;
mod choices;
mod difference;
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

/// How much is checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Small scenes and sizes only: seconds.
    Quick,
    /// What takes about a minute, also in software.
    Usual,
    /// More and larger scenes and sizes, which take software an hour.
    Full,
}

pub use choices::{Choices, Element, Words};
pub use difference::{Tolerance, checksum, difference};
pub use left_out::{Excluded, LEFT_OUT_WORDS};
pub use random::Random;
pub use scenario::{Mixture, Scenario};
pub use shrink::shrink;
pub use way::{Gpu, Place, Way, guarded};
