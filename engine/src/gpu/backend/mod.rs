mod auto_backend;
mod gpu_backend;
mod skin_controller;
mod slab_search;
mod slabs;

pub(crate) use auto_backend::AutoBackend;
pub(crate) use gpu_backend::GpuBackend;
