//! Overlapping spheres over many ranks, which send messages through a [`Communicator`].
//!
//! 1. A [`Partition`] cuts space into a domain per rank. It does not change the result.
//! 2. Every rank tells all others its [`ClassBounds`]: a bounding box for each [`SizeClass`] and species
//!    group.
//! 3. *The larger sphere becomes a ghost at the owner of the smaller one*, if it may pair with a sphere in a
//!    bounding box ([`RankBounds::ghosts`]). Within a class, ghosts go one way between two ranks
//!    ([`ghost_rule`]).
//! 4. Each rank searches its own spheres, and between these and its ghosts ([`Search`]).
//!
//! # Correctness
//!
//! 1. *Each pair is reported once.* Of two spheres on different ranks exactly one becomes a ghost at the
//!    other's owner, which reports the pair. Both owners know the size classes and ranks of the rule.
//! 2. *No pair is lost.* A sphere that may pair with one in a bounding box overlaps the box, within the
//!    cutoff of the two species groups, by a test that no rounding makes fail ([`ClassBounds::overlaps`]).

#![allow(missing_docs, reason = "most names and types are clear")]

mod communicator;
mod coordinate;
mod difference;
mod error;
mod ghosts;
mod hash;
pub mod in_process;
mod load_balance;
mod memory;
mod message_rounds;
mod particle;
mod partition;
mod partitioner;
pub mod sample;
mod search;
mod settings;
mod size_class;
mod species_groups;
pub mod threads;
mod wrapped_sphere;

pub use communicator::{Communicator, RankData, gather, send_to_ranks};
pub use coordinate::Coordinate;
pub use difference::Difference;
pub use error::Error;
pub use ghosts::{ClassBounds, Ghosts, RankBounds, ghost_rule};
pub use hash::{Digest, tie_breaker};
pub use load_balance::LoadBalance;
pub use message_rounds::MessageRounds;
pub use particle::Particle;
pub use partition::{BisectionPlane, Partition};
pub use partitioner::{Assignment, Migration, Partitioner};
pub use search::{PairCounts, PairKind, Search};
pub use settings::Settings;
pub use size_class::SizeClass;
pub use wrapped_sphere::{SphereWrapper, WrappedSphere};
