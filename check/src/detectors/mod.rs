pub mod compare;
pub mod results;
pub mod sequence;

mod variant;

pub(crate) use variant::text;
pub use variant::{DetectorVariant, Gpu, TargetDevice, catch_panic};
