//! What the `lazygrid` command, the tests and the benchmarks share.

pub mod figures;
pub mod measure;
pub mod peers;
pub mod read;
pub mod scenes;
pub mod write;

mod error;

pub use error::{At, Error, Place};
