//! Recording dispatches into command encoders.

mod primitives;
mod recording;
mod small_cache;

pub use primitives::{BoundScan, BoundSort, KeyValueBuffers, PrefixScan, RadixSort};
pub(crate) use recording::{Buffers, Recording};
pub(crate) use small_cache::SmallCache;
