//! The simulation on the GPU: particles, random numbers and reactions stay on the device between readbacks.
//!
//! The simulation embeds a [`lazygrid::gpu::GpuDetector`]. One encoder records many steps, each of which moves the particles,
//! finds their pairs, and consumes the pairs in place. Random numbers, rules and the matching are those of the CPU. Runs have
//! the same reactions wherever arithmetic is exact. A device may round differently; then runs diverge, and only their
//! statistics agree.
//!
//! A step is a transaction: it reads particles from one set of buffers and writes them back at its end. If a capacity is
//! exceeded, the device *halts* before that, and all later recorded steps do nothing. The host sees the flag at the next
//! readback, enlarges the capacity and repeats that step. No event is lost or applied twice.
//!
//! The host computes bursts with [`Model::release`](crate::Model::release), and the positions of receivers, because both are
//! known in advance. It uploads them with the steps.

mod device;
mod dispatches;
mod kernel;
mod layout;
mod plan;
mod receiver_cells;
mod receiver_trajectory;
mod simulation;
mod tables;
#[cfg(test)]
mod tests;

pub use plan::GpuOptions;
pub use simulation::GpuSimulation;
