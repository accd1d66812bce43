//! The vocabulary that every lazygrid detector shares: spheres in, pairs out, and the rules between them.
//!
//! This crate makes no device call. It holds the types whose memory layout the CPU
//! detectors, the GPU kernels and the bindings agree on.
//!
//! * [`Sphere`], [`Spheres`] — input, as rows or as columns, without copying;
//! * [`Query`] — one set of spheres or two, and the pairs that are excluded;
//! * [`Interactions`] — which species may pair, and at which distance;
//! * [`Exclusions`] — pairs that are none, such as bonds;
//! * [`Space`] — unbounded, or periodic along some axes or edges;
//! * [`Pair`] — one overlapping pair, smaller index first;
//! * [`Algorithm`], [`Backend`] — the detectors, and where they run, by name;
//! * [`Error`], [`InputError`] — why there is no result, on any backend, and what can be wrong with an input;
//! * [`kernel`], [`layout`] — the GPU kernels in WGSL with their metadata, and the structures they share with Rust;
//! * [`wgsl`] — texts from pieces.

mod algorithm;
mod backend;
mod bond;
mod error;
mod exclusions;
mod interactions;
pub mod kernel;
mod lattice;
pub mod layout;
mod memory;
mod pair;
mod query;
mod shear;
mod space;
mod sphere;
pub mod wgsl;
mod wide;

pub use algorithm::Algorithm;
pub use backend::Backend;
pub use bond::Bond;
pub use error::{Error, InputError, UnknownName};
pub use exclusions::Exclusions;
pub use interactions::{Interaction, Interactions, Reach};
pub use lattice::{Folded, Lattice};
pub use memory::make_room;
pub use pair::Pair;
pub use query::Query;
pub use shear::{Shear, Straight};
pub use space::Space;
pub use sphere::{MAX_SPHERES, Sphere, Spheres};
pub use wide::{Radii, Real, Strided};
