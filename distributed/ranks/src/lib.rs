//! Overlapping spheres over many ranks: who owns a sphere, which spheres become ghosts, who reports a pair.
//!
//! Messages go through a [`Communicator`]: MPI in `lazygrid-mpi`, [`threads`], or all ranks in one process
//! ([`in_process`]).
//!
//! 1. A [`Partition`] cuts space into a domain per rank, from a [sample] of all spheres. Placement does not change the
//!    result.
//! 2. Every rank tells all others its [`ClassBounds`]: a bounding box for each binade of radius ([`SizeClass`]) and
//!    each species group.
//! 3. *The larger sphere becomes a ghost at the owner of the smaller one*; within a class, ghosts go one way between
//!    two ranks ([`ghost_rule`]). Only spheres that may pair with one in a bounding box are sent
//!    ([`RankBounds::ghosts`]).
//! 4. Each rank searches its own spheres, and between these and its ghosts ([`Search`]). The owner of the smaller
//!    sphere reports a pair of two ranks.
//!
//! Spheres in `f64`, and spaces or tables that `f32` does not represent, have wrapped spheres and bounding boxes of
//! `f64` numbers ([`SphereWrapper::wrap_f64`]), and ghosts with `f64` rows ([`Ghosts::exchange_f64`]).
//!
//! [`Settings`] compares what all ranks must share.
//!
//! # Correctness
//!
//! 1. *Each pair is reported once.* Of two spheres on different ranks exactly one becomes a ghost at the other's owner,
//!    by a rule of size classes and ranks that both know.
//! 2. *No pair is lost.* A sphere that may pair with one in a bounding box overlaps the box, within the cutoff of the
//!    two species groups, by a test that no rounding makes fail ([`ClassBounds::overlaps`]).

#![allow(missing_docs, reason = "most names and types are clear")]

mod across;
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
