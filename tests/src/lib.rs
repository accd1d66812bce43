//! Shared code of the tests in `suite/`.

#![allow(missing_docs, reason = "internal to the workspace: most names and types are clear")]

pub mod browser;
pub mod command;
pub mod hard;
pub mod periodic;
pub mod results;
pub mod running;
pub mod triclinic;
pub mod variants;

mod adapter;

use lazygrid::gpu::{GpuDevice, SoftwareAdapter};

pub use adapter::skip::skip;
pub use lazygrid_check::{
    DetectorVariant, SceneSeed, SeedReader, SpeciesSetup, TestInput, Tolerance, checksum, difference,
};
pub use variants::{SuiteVariant, THREADS, in_pool};

/// Shared by all tests of a process.
///
/// # Panics
/// Panics if no adapter exists but `LAZYGRID_REQUIRE_GPU` is set.
pub fn device() -> Option<GpuDevice> {
    adapter::or_skip(GpuDevice::shared(SoftwareAdapter::Allow))
}
