//! The simulation on the GPU: particles, random numbers and reactions stay on the device between readbacks.
//!
//! One encoder records many steps, each of which moves the particles, finds their pairs with a
//! [`lazygrid::gpu::GpuDetector`], and consumes the pairs in place. Random numbers, rules and the matching are those of
//! the CPU. Where a device rounds differently, runs diverge and only their statistics agree.
//!
//! A step is a transaction: it reads particles from one set of buffers and writes them back at its end. If a capacity
//! is exceeded, the device *halts* before that, and later recorded steps do nothing. The host sees the flag at the next
//! readback, enlarges the capacity and repeats that step. No event is lost or applied twice.
//!
//! The host computes bursts and the positions of receivers in advance and uploads them with the steps.

mod detectors;
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
