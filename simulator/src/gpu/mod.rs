//! The simulator on the GPU: particles, random numbers and reactions stay there, and the host only looks now and then.
//!
//! It embeds [`lazygrid::gpu::GpuDetector`] as any program with a device of its own can: one encoder takes many steps,
//! each of which moves the particles, has their pairs found, and consumes the pairs where they lie. Draws, rules and
//! the matching are those of the CPU, so that a run has the same reactions wherever arithmetic leaves no choice; where
//! a device rounds differently, runs part ways after a while and only their statistics agree.
//!
//! A step reads the particles from one set of buffers and leaves them there again only at its very end. When the
//! detector finds more pairs than there is room for, the device stops before that: it *freezes*, and all steps recorded
//! behind do nothing. The host sees it when it looks, makes room and goes on with that very step. Nothing is lost and
//! nothing is done twice.
//!
//! Bursts are computed on the host by [`Model::release`](crate::Model::release), as it knows their steps and ids
//! beforehand, and go up with the steps. So does where receivers are in each of them.

mod device;
mod journey;
mod kernel;
mod layout;
mod nearby;
mod plan;
mod simulation;
mod stages;
mod tables;
#[cfg(test)]
mod tests;

pub use plan::GpuOptions;
pub use simulation::GpuSimulation;
