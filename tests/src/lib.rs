//! What the tests in `suite/` share.
//!
//! * [`Scenario`] — spheres, perhaps with species, and the [oracle](Scenario::oracle): a plain double loop, which
//!   `lazygrid check` judges by too;
//! * [`Subject`] — one way to run a detector; [`Subject::all`] is the list that a new backend joins;
//! * [`periodic`] — oracles and generators of scenarios in periodic spaces;
//! * [`sheared`] — the same of spaces whose edges lean;
//! * [`difference`] — compares a result with the expected pairs and explains the first wrong one;
//! * [`device`] — an adapter of the GPU, where there is one;
//! * [`command`] — a built command from outside;
//! * [`adversary`] — generators of spheres that are hard on grids, with shrinking.

pub mod adversary;
pub mod command;
pub mod periodic;
pub mod sheared;

mod adapter;
mod gpu;
mod subject;

pub use gpu::device;
pub use lazygrid_check::{Choices, Mixture, Scenario, Tolerance, Words, checksum, difference};
pub use subject::{Subject, THREADS, in_pool};
