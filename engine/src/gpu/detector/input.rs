//! The input of a [`GpuDetector`]: a configuration once, spheres at every call.

use std::ops::Range;

use crate::Error;
#[cfg(doc)]
use crate::gpu::{GpuDetector, Outcome};

/// The number of spheres of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SphereCount<'a> {
    /// Known to the host.
    Host(u32),
    /// The first `u32` of a buffer with `STORAGE` usage, read on the GPU.
    Buffer {
        /// The buffer.
        buffer: &'a wgpu::Buffer,
        /// The most it may say; more set [`Outcome::OVERFLOW_SPHERES`] in the overflow flag.
        at_most: u32,
    },
}

impl From<u32> for SphereCount<'_> {
    fn from(count: u32) -> Self {
        Self::Host(count)
    }
}

/// Spheres that are on the GPU already.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GpuSpheres<'a> {
    /// `x, y, z, r` as four `f32` per sphere; `STORAGE` usage.
    pub(in crate::gpu) spheres: &'a wgpu::Buffer,
    /// The number of spheres.
    pub(in crate::gpu) count: SphereCount<'a>,
    /// A `u32` species id per sphere, where the settings have interactions; `STORAGE` usage.
    pub(in crate::gpu) species: Option<&'a wgpu::Buffer>,
    /// Only pairs whose smaller index lies in here are counted and written.
    pub(in crate::gpu) window: Range<u32>,
    /// The number of spheres of the first of two sets, before those of the second; 0 for one set.
    pub(in crate::gpu) split: u32,
}

impl<'a> GpuSpheres<'a> {
    /// The first `count` spheres of a buffer, a number or a [`SphereCount`]: all their pairs, for any species.
    pub fn new(spheres: &'a wgpu::Buffer, count: impl Into<SphereCount<'a>>) -> Self {
        Self { spheres, count: count.into(), species: None, window: Self::ALL, split: 0 }
    }

    /// Adds a `u32` species id per sphere, needed if the settings have interactions; `STORAGE` usage.
    pub fn with_species(self, species: &'a wgpu::Buffer) -> Self {
        Self { species: Some(species), ..self }
    }

    /// Asks for pairs whose smaller index is in `window` only, so that a result larger than the output can be taken in
    /// parts. Default: [`ALL`](Self::ALL).
    pub fn in_window(self, window: Range<u32>) -> Self {
        Self { window, ..self }
    }

    /// Asks for pairs of one of the first `first` spheres and one of the others only.
    pub fn across(self, first: u32) -> Self {
        match first {
            // In a call 0 stands for one set.
            0 => Self { window: 0..0, split: 0, ..self },
            split => Self { split, ..self },
        }
    }

    /// The window that every pair is in.
    pub const ALL: Range<u32> = 0..u32::MAX;

    /// Refuses buffers that are too short or cannot be bound, and species if there is no table, or none if there is.
    /// Returns how many spheres there may be.
    pub(in crate::gpu) fn check(&self, has_table: bool) -> Result<u32, Error> {
        let spheres = match self.count {
            SphereCount::Host(count) => count,
            SphereCount::Buffer { buffer, at_most } => {
                check_buffer("count", buffer, 4)?;
                at_most
            }
        };
        check_buffer("spheres", self.spheres, u64::from(spheres.max(1)) * 16)?;
        if let Some(species) = self.species {
            check_buffer("species", species, u64::from(spheres.max(1)) * 4)?;
        }
        match self.species.is_some() == has_table {
            true => Ok(spheres),
            false => Err(Error::SpeciesBuffer),
        }
    }
}

/// Refuses a buffer that is too short or cannot be bound.
pub(in crate::gpu) fn check_buffer(
    what: &'static str,
    buffer: &wgpu::Buffer,
    needed: u64,
) -> Result<(), Error> {
    let storage = buffer.usage().contains(wgpu::BufferUsages::STORAGE);
    if buffer.size() < needed || !storage {
        let usage = if storage { "" } else { ", with STORAGE usage" };
        return Err(Error::Buffer { what, size: buffer.size(), needed, usage });
    }
    Ok(())
}
