//! The CPU backend of lazygrid: finds every pair of overlapping spheres on rayon threads.
//!
//! Start with [`HostDetector`]. Data flows one way: spheres → [`InputStats`] → [`algorithm_choice`] → plan → detector →
//! pairs.

#![cfg_attr(test, allow(clippy::disallowed_methods, clippy::disallowed_macros))]

mod cell_list;
mod compare;
#[allow(missing_docs, reason = "no part of the interface of `lazygrid`")]
mod detector;
mod disjoint_writes;
mod executor;
#[allow(missing_docs, reason = "no part of the interface of `lazygrid`")]
mod frame;
mod grids;
#[allow(missing_docs, reason = "no part of the interface of `lazygrid`")]
mod input;
mod math;
mod memory;
mod naive;
mod output;
mod radix;
mod report;
#[allow(missing_docs, reason = "no part of the interface of `lazygrid`")]
mod settings;
mod size_class;
mod skin;
mod species_classes;
#[cfg(test)]
mod test_support;

pub use compare::{CandidateFilter, PairConsumer, PairFilter, Simd};
pub use detector::{
    ChunkConsumer, HostBackend, HostDetector, PairFinder, PairSource, SearchBackend, Work, algorithm_choice,
    ranges,
};
pub use executor::{
    Executor, Team, check_thread_memory, default_threads, start_thread, start_threads, thread_pool,
};
pub use frame::SearchFrame;
pub use input::{
    InputStats, Preparation, PreparedQuery, QueryBuffers, SizeClass, SpeciesGroups, SpeciesPartition, check,
    check_valid, sample_species,
};
pub use lazygrid_kernels::{Error, InputError};
pub use output::{
    ContactTest, FoundPairs, ListOptions, NeighborList, NeighborListBuilder, Neighbors, NeighborsBuilder,
    NeighborsIter, PeriodicImages,
};
pub use report::{CandidateListStats, PhaseTime, RebuildReason, Report};
pub use settings::{Order, SKIN_RANGE, Settings, Skin};
pub use size_class::SIZE_CLASSES;
pub use skin::{SkinCosts, SkinTuner};
