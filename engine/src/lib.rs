//! All pairs of overlapping spheres, at every step of a simulation.
//!
//! ```
//! use lazygrid::{Pair, Sphere, detect};
//!
//! let spheres = [
//!     Sphere::new([0.0, 0.0, 0.0], 1.0),
//!     Sphere::new([1.5, 0.0, 0.0], 1.0),
//!     Sphere::new([9.0, 0.0, 0.0], 0.1),
//! ];
//! assert_eq!(detect(&spheres)?, [Pair::new(0, 1)]);
//! # Ok::<(), lazygrid::Error>(())
//! ```
//!
//! # Features
//!
//! `gpu`, on by default: the module [`gpu`]. Without it [`Backend::Auto`] is the CPU, and wgpu is not compiled.
//!
//! # On the GPU
//!
//! A simulation on the GPU passes its own device, encoder and buffers: see [`gpu`] and the examples `embedded` and
//! `service`.

#![cfg_attr(not(feature = "gpu"), allow(rustdoc::broken_intra_doc_links))]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod backend;
mod choice;
mod config;
mod detector;
mod geometry;
#[cfg(feature = "gpu")]
pub mod gpu;
#[cfg(feature = "gpu")]
mod gpu_backend;
mod report;

pub use config::Config;
pub use detector::{Detector, detect};
pub use glam;
pub use lazygrid_host::{
    CandidateListStats, ListOptions, NeighborList, Neighbors, NeighborsIter, Order, PhaseTime, RebuildReason,
    Simd, Skin, start_threads,
};
/// For the other crates of this repository; no part of the stable interface.
#[doc(hidden)]
pub use lazygrid_host::{check_thread_memory, default_threads, start_thread, thread_pool};
/// For messages about files; no part of the stable interface.
#[doc(hidden)]
pub use lazygrid_kernels::short;
pub use lazygrid_kernels::{
    Algorithm, Backend, EffectiveRadius, Error, Exclusions, ImageVector, InputError, Interaction,
    Interactions, MAX_SPHERES, Pair, Query, Radii, Real, Space, Sphere, Spheres, Strided, UnknownName,
};
/// For runs on several ranks; no part of the stable interface.
#[doc(hidden)]
pub use lazygrid_kernels::{Orthogonalization, SpeciesRadius, TriclinicCell};
pub use report::Report;

#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
#[doc = include_str!("../../docs/rust.md")]
struct Readme;
