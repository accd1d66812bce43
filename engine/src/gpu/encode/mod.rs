mod bound_buffer;
mod primitives;
mod recording;
mod small_cache;

pub(crate) use bound_buffer::BoundBuffer;
pub use primitives::{BoundScan, BoundSort, KeyValueBuffers, PrefixScan, RadixSort};
pub(crate) use recording::{Buffers, Recording};
pub(crate) use small_cache::SmallCache;
