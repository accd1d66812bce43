//! The simulation on the GPU. Particles stay on the device between readbacks.
//!
//! Random numbers, rules and the matching are the CPU's; runs diverge only by rounding. A step that exceeds a capacity
//! *halts* the run before it changes particles, and the host repeats it with more capacity
//! (`docs/design/simulator.md`).

mod chemotaxis;
mod detectors;
mod device;
mod dispatches;
mod kernel;
mod layout;
mod ligand_rows;
mod membrane_rows;
mod model_check;
mod path_bounds;
mod plan;
mod receiver_cells;
mod receiver_trajectory;
mod scene_rows;
mod simulation;
mod submissions;
mod tables;
mod tally_layout;
#[cfg(test)]
mod tests;

pub(crate) use model_check::{can_log_arrivals, check};
pub use plan::GpuOptions;
pub use simulation::GpuSimulation;
pub(crate) use simulation::ReceptorRequests;
#[cfg(test)]
pub(crate) use tests::{device, limited};
