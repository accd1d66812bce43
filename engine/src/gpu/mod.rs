//! The GPU engine: wgpu on Vulkan, Metal or DirectX 12, with hardware or in software.
//!
//! [`GpuDetector`] records into a caller's encoder on a caller's device: spheres in GPU buffers in, pairs in GPU
//! buffers out, with no submit, poll or readback in between. [`RadixSort`] and [`PrefixScan`] are its building
//! blocks. [`GpuSession`] carries spheres and pairs between host and device. [`Cost`] says before a call what it takes.

pub(crate) mod adapter;
mod auto_backend;
mod calibration;
mod course;
mod detector;
mod device_backend;
mod device_search;
mod input;
mod mapping;
mod pipelines;
mod plan;
mod primitives;
mod recording;
mod scope;
mod session;
mod sides;
mod skin;
mod slabs;
mod slot;

pub use adapter::{AdapterId, AdapterSummary, GpuDevice, adapters, wanted_features};
pub(crate) use auto_backend::AutoBackend;
pub use calibration::{Calibration, Crossover, Sample, SkinCosts, calibrate};
pub use detector::{GpuDetector, GpuPairs, GpuSorted, read_outcome};
pub(crate) use device_backend::DeviceBackend;
pub use input::{Count, GpuConfig, GpuSpheres};
pub use lazygrid_kernels::kernel::Access;
pub use lazygrid_kernels::layout::{Outcome, SkinState};
pub use lazygrid_kernels::wgsl;
pub use plan::{Cost, DeviceLimits, Phase};
pub use primitives::{BoundScan, BoundSort, Keyed, PrefixScan, RadixSort};
pub use session::{GpuSession, Ticket};
pub use skin::GpuSkinDetector;
pub use wgpu;
