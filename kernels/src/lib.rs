//! The vocabulary that every lazygrid detector shares: spheres in, pairs out, and the rules between them.
//!
//! This crate makes no device call. It holds the types whose memory layout the CPU detectors, the GPU kernels and the
//! bindings agree on.
//!
//! * [`Sphere`], [`Spheres`] — input, as rows or as columns, without copying;
//! * [`Query`] — one set of spheres or two, and the excluded pairs;
//! * [`Interactions`] — the species that pair, and their distances;
//! * [`Exclusions`] — pairs that are never reported, such as bonds;
//! * [`Space`] — unbounded, or periodic along some axes or cell vectors;
//! * [`Pair`] — one overlapping pair, smaller index first;
//! * [`Algorithm`], [`Backend`] — the detectors by name, and the processor that runs them;
//! * [`Error`], [`InputError`] — the failures of a call, and the faults of an input;
//! * [`kernel`], [`layout`] — the GPU kernels in WGSL with their metadata, and the structures they share with Rust;
//! * [`wgsl`] — the WGSL preprocessor.

mod algorithm;
mod backend;
mod error;
pub mod kernel;
pub mod layout;
mod limits;
mod memory;
mod types;
mod unknown_name;
pub mod wgsl;

pub use algorithm::Algorithm;
pub use backend::Backend;
pub use error::{Error, InputError};
pub use limits::MAX_SPHERES;
pub use memory::try_reserve;
pub use types::exclusions::Exclusions;
pub use types::image_vector::ImageVector;
pub use types::interactions::{EffectiveRadius, Interaction, Interactions};
pub use types::lattice::{Lattice, WrappedPoint};
pub use types::pair::Pair;
pub use types::query::Query;
pub use types::real::{Radii, Real, Strided};
pub use types::space::Space;
pub use types::sphere::{Sphere, Spheres};
pub use types::triclinic::{Orthogonalization, TriclinicCell};
pub use unknown_name::UnknownName;
