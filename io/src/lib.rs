//! Readers and writers of spheres and pairs, and scenes of tests and benchmarks.

pub mod arguments;
pub mod read;
pub mod scenes;
pub mod write;

mod error;
mod memory;
mod names;
mod system_memory;

pub use error::{Error, Location, Position, excerpt, printed};
pub use system_memory::{
    AvailableMemory, MemoryLimit, available_memory, lacking_address_space, lacking_memory, memory_of_driver,
    memory_of_driver_threads,
};
