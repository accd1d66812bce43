//! The vocabulary that every lazygrid detector shares: spheres in, pairs out, and the rules between them.
//!
//! This crate makes no device call. It holds the types whose memory layout the CPU
//! detectors, the GPU kernels and the bindings agree on.
//!
//! * [`Sphere`], [`Spheres`] — input, as rows or as columns, without copying;
//! * [`Interactions`] — which species may pair, and at which distance;
//! * [`Space`] — unbounded, or periodic along some axes;
//! * [`Pair`] — one overlapping pair, smaller index first;
//! * [`Algorithm`] — the detectors by name;
//! * [`InputError`] — what can be wrong with an input;
//! * [`kernel`], [`layout`] — the GPU kernels in WGSL with their metadata, and the structures they share with Rust;
//! * [`wgsl`] — texts from pieces.

mod algorithm;
mod error;
mod interactions;
pub mod kernel;
pub mod layout;
mod pair;
mod space;
mod sphere;
pub mod wgsl;

pub use algorithm::Algorithm;
pub use error::InputError;
pub use interactions::{Interaction, Interactions, Reach};
pub use pair::Pair;
pub use space::Space;
pub use sphere::{MAX_SPHERES, Sphere, Spheres};
