//! Overlapping spheres over many ranks, as pure functions: who owns what, what travels, who reports.
//!
//! Nothing here sends anything. A [`Carrier`] does, for the functions that need one; `lazygrid-mpi` has the one through
//! MPI, and [`threads`] has one for ranks that are threads. The tests of this crate and its [`model`] play all ranks in one
//! process.
//!
//! 1. A [`Partition`] cuts space into one part per rank, from a [sample] of all spheres. It is optional: whatever
//!    the placement, the answer is the same.
//! 2. Every rank publishes a [`Hull`] per binade of radius ([`Class`]) of what it owns.
//! 3. *The larger sphere travels to the owner of the smaller one*, within a class one way between two ranks ([`rule`]).
//!    Only spheres that meet a published hull travel ([`Published::ghosts`]).
//! 4. Each rank looks for pairs among what it owns, and between that and the ghosts it got ([`Search`]). A pair of two
//!    ranks is reported by the one that its smaller sphere belongs to.
//!
//! All ranks need the same space, interactions and so on, which [`Settings`] compares.
//!
//! Why each pair is found, and once: for two spheres on different ranks exactly one of them travels to the other's
//! owner, by a rule that looks at their classes and ranks alone, so both ranks agree on it without a word. Why none is
//! lost: a hull is met by every sphere that overlaps one of the spheres in it, roundings included.

mod across;
mod body;
mod carrier;
mod census;
mod class;
mod error;
mod ghosts;
mod hash;
mod hull;
pub mod model;
mod particle;
mod parting;
mod partition;
mod rounds;
pub mod rule;
pub mod sample;
mod search;
mod settings;
pub mod threads;

pub use body::{Bodies, Body};
pub use carrier::{Carrier, Received, deliver, gather};
pub use census::Census;
pub use class::Class;
pub use error::Error;
pub use ghosts::Published;
pub use hash::{Digest, tie};
pub use hull::Hull;
pub use particle::Particle;
pub use parting::{Assigned, Migration, Parting};
pub use partition::{Partition, Split};
pub use rounds::Rounds;
pub use search::{Found, Ghosts, Search, Tally};
pub use settings::{Difference, Settings};
