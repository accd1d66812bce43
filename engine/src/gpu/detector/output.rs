use lazygrid_kernels::layout::Outcome;

use crate::Error;
#[cfg(doc)]
use crate::gpu::GpuConfig;

/// The buffers that hold the result of a call.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct GpuOutput {
    /// Pairs as `[u32; 2]`, unordered, `i < j`; `STORAGE` and `COPY_SRC` usage.
    pub pairs: wgpu::Buffer,
    /// Capacity of the buffer in pairs.
    pub capacity: u32,
    /// The [`Outcome`], with dispatch arguments of a consumer with a thread per pair at [`Outcome::DISPATCH_OFFSET`];
    /// `STORAGE`, `INDIRECT` and `COPY_SRC` usage.
    pub outcome: wgpu::Buffer,
    /// Spheres in cell order, if the cell list ran.
    pub sorted: Option<CellOrder>,
}

/// The spheres in cell order, until the next call; `STORAGE` and `COPY_SRC` usage. Adopting this order now and then
/// accelerates later calls and, with [`GpuConfig::pairs_in_cell_order`], work on pairs.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct CellOrder {
    /// Input index as `u32`. Invalid spheres come last.
    pub order: wgpu::Buffer,
    /// `x, y, z, r` as four `f32`, wrapped into a periodic space.
    pub spheres: wgpu::Buffer,
    /// Species as `u32`, with interactions.
    pub species: Option<wgpu::Buffer>,
}

/// Reads an outcome from a copy of its buffer.
///
/// # Errors
/// [`Error::BufferSize`] for too few bytes.
pub fn read_outcome(bytes: &[u8]) -> Result<Outcome, Error> {
    let needed = size_of::<Outcome>();
    match bytes.get(..needed) {
        Some(bytes) => Ok(bytemuck::pod_read_unaligned(bytes)),
        None => {
            let (size, needed) = (bytes.len() as u64, needed as u64);
            Err(Error::BufferSize { what: "outcome", size, needed })
        }
    }
}
