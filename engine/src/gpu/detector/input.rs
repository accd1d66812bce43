use std::ops::Range;

use lazygrid_kernels::layout::ColumnLayout;

use crate::Error;
use crate::gpu::config::GpuConfig;
use crate::gpu::encode::BoundBuffer;
#[cfg(doc)]
use crate::gpu::{GpuDetector, Outcome};

/// The number of spheres of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SphereCount<'a> {
    /// Known to the host.
    Host(u32),
    /// First `u32` of a buffer with `STORAGE` usage, read on the GPU.
    Buffer {
        /// Buffer.
        buffer: &'a wgpu::Buffer,
        /// Largest number; above it, the outcome has [`Outcome::OVERFLOW_SPHERES`].
        at_most: u32,
    },
}

impl From<u32> for SphereCount<'_> {
    fn from(count: u32) -> Self {
        Self::Host(count)
    }
}

/// A buffer or a range of it: `&buffer`, `buffer.slice(..)` or [`BufferRange::new`]. It may exceed the binding limit,
/// because a call binds only the needed bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferRange<'a> {
    buffer: &'a wgpu::Buffer,
    offset: u64,
    size: u64,
}

impl<'a> BufferRange<'a> {
    /// Bytes from `offset`, a multiple of the device's `min_storage_buffer_offset_alignment`.
    pub fn new(buffer: &'a wgpu::Buffer, offset: u64) -> Self {
        Self { buffer, offset, size: buffer.size().saturating_sub(offset) }
    }

    fn bound(self, bytes: u64) -> BoundBuffer {
        BoundBuffer::range(self.buffer, self.offset, bytes)
    }

    fn check(&self, what: &'static str, needed: u64, alignment: u32) -> Result<(), Error> {
        if self.size < needed {
            return Err(Error::BufferSize { what, size: self.size, needed });
        }
        if !self.buffer.usage().contains(wgpu::BufferUsages::STORAGE) {
            return Err(Error::BufferUsage { what, usage: "STORAGE" });
        }
        if !self.offset.is_multiple_of(alignment.into()) {
            let range = "choose a multiple of the device's `min_storage_buffer_offset_alignment`";
            return Err(Error::InvalidSetting {
                name: "buffer offset",
                value: self.offset.to_string(),
                range,
            });
        }
        Ok(())
    }
}

impl<'a> From<&'a wgpu::Buffer> for BufferRange<'a> {
    fn from(buffer: &'a wgpu::Buffer) -> Self {
        Self::new(buffer, 0)
    }
}

impl<'a> From<wgpu::BufferSlice<'a>> for BufferRange<'a> {
    fn from(slice: wgpu::BufferSlice<'a>) -> Self {
        Self { buffer: slice.buffer(), offset: slice.offset(), size: slice.size() }
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum SphereBuffers<'a> {
    Rows(BufferRange<'a>),
    Columns([BufferRange<'a>; 4]),
}

/// Spheres in GPU buffers.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GpuSpheres<'a> {
    pub(crate) spheres: SphereBuffers<'a>,
    pub(crate) count: SphereCount<'a>,
    pub(crate) species: Option<BufferRange<'a>>,
    window: Range<u32>,
    first: Option<u32>,
}

impl<'a> GpuSpheres<'a> {
    /// First `count` spheres of a buffer with `STORAGE` usage.
    pub fn new(spheres: impl Into<BufferRange<'a>>, count: impl Into<SphereCount<'a>>) -> Self {
        Self::from_buffers(SphereBuffers::Rows(spheres.into()), count.into())
    }

    /// First `count` spheres of four arrays in the layout of [`GpuConfig::columns`]. Arrays may share a range.
    pub fn from_columns(columns: [BufferRange<'a>; 4], count: impl Into<SphereCount<'a>>) -> Self {
        Self::from_buffers(SphereBuffers::Columns(columns), count.into())
    }

    fn from_buffers(spheres: SphereBuffers<'a>, count: SphereCount<'a>) -> Self {
        Self { spheres, count, species: None, window: Self::ALL, first: None }
    }

    /// Adds a `u32` species id per sphere, required with interactions; `STORAGE` usage.
    pub fn with_species(self, species: impl Into<BufferRange<'a>>) -> Self {
        Self { species: Some(species.into()), ..self }
    }

    /// Restricts the smaller index of pairs to `window`, to read a large result in parts. Default: [`ALL`](Self::ALL).
    pub fn in_window(self, window: Range<u32>) -> Self {
        Self { window, ..self }
    }

    /// Restricts pairs to one of the first `first` spheres and one of the others.
    pub fn across(self, first: u32) -> Self {
        Self { first: Some(first), ..self }
    }

    pub(crate) fn search(&self) -> (Range<u32>, u32) {
        match self.first {
            Some(0) => (0..0, 0),
            first => (self.window.clone(), first.unwrap_or(0)),
        }
    }

    /// Window of all pairs.
    pub const ALL: Range<u32> = 0..u32::MAX;

    fn sphere_ranges(
        &self,
        spheres: u32,
        columns: Option<&ColumnLayout>,
    ) -> Result<Vec<(BufferRange<'a>, u64)>, Error> {
        let mismatch = |value: &str, range| {
            Err(Error::InvalidSetting { name: "sphere buffers", value: value.to_owned(), range })
        };
        match (&self.spheres, columns) {
            (SphereBuffers::Rows(rows), None) => Ok(vec![(*rows, 16 * u64::from(spheres.max(1)))]),
            (SphereBuffers::Columns(ranges), Some(layout)) => {
                Ok(ranges.iter().copied().zip(layout.bytes(spheres)).collect())
            }
            (SphereBuffers::Rows(_), Some(_)) => {
                mismatch("rows", "pass columns, which `GpuConfig::columns` describes")
            }
            (SphereBuffers::Columns(_), None) => mismatch("columns", "describe them by `GpuConfig::columns`"),
        }
    }

    pub(crate) fn check(&self, settings: &GpuConfig, device: &wgpu::Device) -> Result<u32, Error> {
        let alignment = device.limits().min_storage_buffer_offset_alignment;
        let spheres = match self.count {
            SphereCount::Host(count) => count,
            SphereCount::Buffer { buffer, at_most } => {
                BufferRange::from(buffer).check("count", 4, alignment)?;
                at_most
            }
        };
        for (range, bytes) in self.sphere_ranges(spheres, settings.columns.as_ref())? {
            range.check("spheres", bytes, alignment)?;
        }
        if let Some(species) = self.species {
            species.check("species", 4 * u64::from(spheres.max(1)), alignment)?;
        }
        match self.species.is_some() == settings.interactions.is_some() {
            true => Ok(spheres),
            false => Err(Error::SpeciesBuffer),
        }
    }

    pub(super) fn bound(&self, spheres: u32, columns: Option<&ColumnLayout>) -> Result<BoundInput, Error> {
        let ranges = self.sphere_ranges(spheres, columns)?;
        let count = match self.count {
            SphereCount::Host(_) => None,
            SphereCount::Buffer { buffer, .. } => Some(BufferRange::from(buffer).bound(4)),
        };
        Ok(BoundInput {
            spheres: ranges.into_iter().map(|(range, bytes)| range.bound(bytes)).collect(),
            species: self.species.map(|species| species.bound(4 * u64::from(spheres.max(1)))),
            count,
        })
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BoundInput {
    pub(crate) spheres: Vec<BoundBuffer>,
    pub(crate) species: Option<BoundBuffer>,
    pub(crate) count: Option<BoundBuffer>,
}
