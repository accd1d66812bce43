//! The GPU engine: wgpu on Vulkan, Metal or DirectX 12, with hardware or in software.
//!
//! [`GpuDetector`] records into a caller's encoder, from GPU buffers to GPU buffers. [`GpuSession`] transfers spheres
//! and pairs between host and device.

mod calibration;
pub(crate) mod choice;
pub(crate) mod config;
pub(crate) mod costs;
pub(crate) mod detector;
pub(crate) mod device;
mod encode;
pub mod plan;
pub(crate) mod session;
#[cfg(test)]
pub(crate) mod test_support;

pub use calibration::{CrossoverSample, calibrate};
pub use config::GpuConfig;
pub use costs::{Calibration, Crossover};
pub use detector::{
    BufferRange, CellOrder, GpuDetector, GpuOutput, GpuSkinDetector, GpuSpheres, SphereCount, read_outcome,
};
pub use device::{AdapterId, AdapterSummary, GpuDevice, SoftwareAdapter, adapters, optional_features};
pub use encode::{BoundScan, BoundSort, KeyValueBuffers, PrefixScan, RadixSort};
pub use lazygrid_host::SkinCosts;
pub use lazygrid_kernels::kernel::Access;
pub use lazygrid_kernels::layout::{ColumnLayout, Outcome, SkinState};
pub use lazygrid_kernels::wgsl;
pub use plan::{CallCost, DeviceLimits, GpuPhase};
pub use session::{GpuSession, SubmissionCounts, Ticket};
pub use wgpu;
