//! Overlapping spheres over many ranks, as pure functions: which rank owns a sphere, which spheres become ghosts, and which
//! rank reports a pair.
//!
//! Functions that need messages take a [`Communicator`]. `lazygrid-mpi` has one over MPI, and [`threads`] has one for ranks
//! that are threads. The tests of this crate and [`in_process`] play all ranks in one process.
//!
//! 1. A [`Partition`] cuts space into one domain per rank, from a [sample] of all spheres. It is optional: the placement of
//!    spheres does not change the answer.
//! 2. Every rank tells all others its [`ClassBounds`]: one bounding box for each binade of radius ([`SizeClass`]) and each
//!    group of species that occurs among its spheres.
//! 3. *The larger sphere becomes a ghost at the owner of the smaller one*; within a class, ghosts go one way between two
//!    ranks ([`ghost_rule`]). Only spheres that may pair with a sphere of a bounding box are sent ([`RankBounds::ghosts`]).
//! 4. Each rank searches among its own spheres, and between its own spheres and its ghosts ([`Search`]). The owner of the
//!    smaller sphere reports a pair of two ranks.
//!
//! All ranks need the same space and interactions, which [`Settings`] compares.
//!
//! # Correctness
//!
//! 1. *Each pair is reported once.* Of two spheres on different ranks exactly one becomes a ghost at the other's owner. The
//!    rule looks at size classes and ranks only, so both ranks know its result without a message.
//! 2. *No pair is lost.* Every sphere that may pair with a sphere of a bounding box overlaps the box by a test that no
//!    rounding makes fail ([`ClassBounds::overlaps`]).

mod across;
mod communicator;
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
