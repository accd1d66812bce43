//! What holds lazygrid to its promises on the machine at hand: `lazygrid check`, and what the tests share with it.
//!
//! * [`Scenario`] — spheres, their species and their space, and the [oracle](Scenario::oracle): a plain double loop;
//! * [`adversary`], [`periodic`] — families of scenes that are hard on grids, made of [`Words`] so that they shrink;
//! * [`scenes`] — single ones, each chosen for one thing;
//! * [`difference`] — compares a result with the expected pairs and explains the first wrong one;
//! * [`kernels`] — each GPU kernel against a sequential function.

pub mod adversary;
pub mod device;
pub mod kernels;
pub mod periodic;
pub mod primitives;
pub mod scenes;

mod calls;
mod choices;
mod difference;
mod nested;
mod random;
mod scenario;

pub use choices::{Choices, Element, Words};
pub use difference::{Tolerance, checksum, difference};
pub use random::Random;
pub use scenario::{Mixture, Scenario};
