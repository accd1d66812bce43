//! The types, rules and GPU kernels that all lazygrid detectors share. No function calls a device.

mod algorithm;
mod backend;
mod error;
#[allow(missing_docs, reason = "internal to the workspace: most names and types are clear")]
pub mod kernel;
#[allow(missing_docs, reason = "internal to the workspace: most names and types are clear")]
pub mod layout;
mod limits;
mod memory;
mod types;
mod unknown_name;
pub mod wgsl;

pub use algorithm::Algorithm;
pub use backend::Backend;
#[doc(hidden)]
pub use error::short;
pub use error::{Error, InputError};
pub use limits::MAX_SPHERES;
pub use memory::try_reserve;
pub use types::exclusions::Exclusions;
#[doc(hidden)]
pub use types::interactions::SpeciesRadius;
pub use types::interactions::{EffectiveRadius, Interaction, Interactions};
pub use types::lattice::{Lattice, WrappedPoint};
pub use types::minimum_image::ImageVector;
#[doc(hidden)]
pub use types::orthogonalization::nearest;
pub use types::orthogonalization::{DistanceMap, Orthogonalization};
pub use types::pair::Pair;
pub use types::query::Query;
#[doc(hidden)]
pub use types::real::widened;
pub use types::real::{Radii, Real, Strided};
pub use types::space::Space;
#[doc(hidden)]
pub use types::sphere::SphereValues;
pub use types::sphere::{Sphere, Spheres};
pub use types::triclinic::TriclinicCell;
pub use unknown_name::UnknownName;
