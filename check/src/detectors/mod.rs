//! Checks of whole detectors against the definition of the pairs.

pub mod compare;
pub mod fuzz;
pub mod sequence;

mod variant;

pub(crate) use variant::text;
pub use variant::{DetectorVariant, Gpu, TargetDevice, catch_panic};
