use lazygrid_kernels::layout::Outcome;

use crate::Error;
#[cfg(doc)]
use crate::gpu::GpuConfig;

/// The buffers that hold the result of a call.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct GpuOutput {
    /// The pairs as `[u32; 2]`, unordered, `i < j`; `STORAGE` and `COPY_SRC` usage.
    pub pairs: wgpu::Buffer,
    /// The capacity of the buffer in pairs.
    pub capacity: u32,
    /// The [`Outcome`]: the number of pairs, and what did not fit; `STORAGE`, `INDIRECT` and `COPY_SRC` usage. A
    /// consumer with a thread per pair is dispatched from [`Outcome::DISPATCH_OFFSET`].
    pub outcome: wgpu::Buffer,
    /// The spheres in the order of the cells, if the call ran by the cell list.
    pub sorted: Option<CellOrder>,
}

/// The spheres in the order of a cell list's cells: neighbors in space are mostly neighbors in memory. A caller that
/// adopts this order now and then makes later calls faster, and with [`GpuConfig::pairs_in_cell_order`] its own work on
/// pairs. All buffers have `STORAGE` and `COPY_SRC` usage, are valid until the next call, and have as many elements as
/// the call had spheres.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct CellOrder {
    /// The input index of each, as `u32`. Invalid spheres come last.
    pub order: wgpu::Buffer,
    /// `x, y, z, r` as four `f32` for each, wrapped into a periodic space.
    pub spheres: wgpu::Buffer,
    /// The species of each as `u32`, with interactions.
    pub species: Option<wgpu::Buffer>,
}

/// Reads the outcome of a call from a copy of the outcome buffer.
///
/// # Errors
/// [`Error::Buffer`] if there are too few bytes.
pub fn read_outcome(bytes: &[u8]) -> Result<Outcome, Error> {
    let needed = size_of::<Outcome>();
    match bytes.get(..needed) {
        Some(bytes) => Ok(bytemuck::pod_read_unaligned(bytes)),
        None => {
            let (size, needed) = (bytes.len() as u64, needed as u64);
            Err(Error::Buffer { what: "outcome", size, needed, usage: "" })
        }
    }
}
