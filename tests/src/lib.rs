//! What the tests in `suite/` share.
//!
//! * [`Scenario`] — spheres, perhaps with species, and the [oracle](Scenario::oracle): a plain double loop;
//! * [`Subject`] — one way to run a detector; [`Subject::all`] is the list that a new backend joins;
//! * [`Periodic`] — a scenario in a periodic space, its oracles and its generators;
//! * [`difference`] — compares a result with the expected pairs and explains the first wrong one;
//! * [`command`] — a built command from outside;
//! * [`adversary`] — generators of spheres that are hard on grids, with shrinking.

pub mod adversary;
pub mod command;
pub mod periodic;

mod adapter;
mod difference;
mod gpu;
mod scenario;
mod subject;

pub use difference::{Tolerance, checksum, difference};
pub use periodic::Periodic;
pub use scenario::{Mixture, Scenario};
pub use subject::{Subject, THREADS, in_pool};
