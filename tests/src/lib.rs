//! Helpers of the tests in `suite/`:
//!
//! * [`TestInput`]: spheres, species, space and exclusions, with the [oracle](TestInput::oracle), a plain double loop
//!   that `lazygrid check` uses too.
//! * [`Subject`]: a detector variant; [`Subject::all`] lists all variants, and a new backend is added there.
//! * [`periodic`]: oracles and generators of scenarios in periodic spaces.
//! * [`sheared`]: generators of scenarios in triclinic cells.
//! * [`difference`]: compares a result with the expected pairs and explains the first wrong pair.
//! * [`device`]: a GPU device, if an adapter exists.
//! * [`command`]: runs built commands.
//! * [`adversary`]: generators of spheres that are hard on grids, with shrinking.

pub mod adversary;
pub mod command;
pub mod periodic;
pub mod sheared;

mod adapter;
mod gpu;
mod subject;

pub use gpu::device;
pub use lazygrid_check::{SceneSeed, SeedReader, SpeciesSetup, TestInput, Tolerance, checksum, difference};
pub use subject::{Subject, THREADS, in_pool};
