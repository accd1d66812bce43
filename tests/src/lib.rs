//! Helpers of the tests in `suite/`:
//!
//! * [`TestInput`]: spheres, species, space and exclusions, with the [oracle](TestInput::oracle), a plain double loop.
//! * [`DetectorVariant`]: a detector variant; [`variants::all`] lists all variants, and [`SuiteVariant`] runs one.
//! * [`periodic`]: oracles and generators of scenarios in periodic spaces.
//! * [`triclinic`]: generators of scenarios in triclinic cells.
//! * [`difference`]: compares a result with the expected pairs and explains the first wrong pair.
//! * [`device`]: a GPU device, if an adapter exists.
//! * [`browser`]: finds a browser, and decodes its screenshots.
//! * [`command`]: runs built commands.
//! * [`hard`]: generators of spheres that are hard on grids, with shrinking.

pub mod browser;
pub mod command;
pub mod hard;
pub mod periodic;
pub mod triclinic;
pub mod variants;

mod adapter;

use lazygrid::gpu::{GpuDevice, SoftwareAdapter};

pub use lazygrid_check::{
    DetectorVariant, SceneSeed, SeedReader, SpeciesSetup, TestInput, Tolerance, checksum, difference,
};
pub use variants::{SuiteVariant, THREADS, in_pool};

/// Opens a new device. If no adapter exists, returns `None` and prints that the test is skipped.
///
/// # Panics
/// Panics if no adapter exists but `LAZYGRID_REQUIRE_GPU` is set.
pub fn device() -> Option<GpuDevice> {
    adapter::or_skip(GpuDevice::open(SoftwareAdapter::Allow))
}
