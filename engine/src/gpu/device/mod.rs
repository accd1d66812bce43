mod adapter;
mod constant;
mod error_scope;
mod gpu_device;
mod mapping;
mod pipelines;
mod subgroup_probe;

#[cfg(test)]
pub(crate) use adapter::card;
pub use adapter::{AdapterId, AdapterSummary, adapters, optional_features};
pub(crate) use constant::constant_buffer;
pub(crate) use error_scope::with_error_scope;
#[cfg(test)]
pub(crate) use gpu_device::device_or_skip;
pub use gpu_device::{GpuDevice, SoftwareAdapter};
pub(crate) use mapping::{Mapping, Wait};
pub(crate) use pipelines::Pipelines;
