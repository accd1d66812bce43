use bytemuck::Pod;
use lazygrid_kernels::layout::{Outcome, SkinState};
use lazygrid_kernels::{Pair, Sphere, Spheres, try_reserve};

use crate::Error;
use crate::gpu::detector::read_outcome;
use crate::gpu::device::{GpuDevice, with_error_scope};
use crate::gpu::plan::GpuPhase;

/// Byte offset of the pairs in a staging buffer. The outcome is at 0, the ticks or the candidate list's state at
/// [`TICKS_AT`].
const PAIRS_AT: u64 = 128;
const TICKS_AT: u64 = 64;

#[derive(Debug, Default)]
pub(crate) struct CallBuffers {
    pub(crate) count: u32,
    pub(crate) spheres: Option<wgpu::Buffer>,
    species: Option<wgpu::Buffer>,
    has_species: bool,
    /// `None` while a call reads it. That of an abandoned call is not used again: wgpu 30 keeps the request to map it,
    /// and would grant the next request when the abandoned call ends.
    staging: Option<wgpu::Buffer>,
    rows: Vec<Sphere>,
}

impl CallBuffers {
    pub(crate) fn upload(&mut self, gpu: &GpuDevice, spheres: Spheres<'_>) -> Result<(), Error> {
        self.count = spheres.len() as u32;
        self.has_species = spheres.species().is_some();
        match spheres.as_rows() {
            Some(rows) => write(gpu, &mut self.spheres, "spheres", rows)?,
            None => {
                self.rows.clear();
                try_reserve(&mut self.rows, spheres.len(), "rows of spheres")?;
                self.rows.extend(spheres.iter());
                write(gpu, &mut self.spheres, "spheres", &self.rows)?;
            }
        }
        match spheres.species() {
            Some(species) => write(gpu, &mut self.species, "species", species),
            None => Ok(()),
        }
    }

    pub(crate) fn species(&self) -> Option<&wgpu::Buffer> {
        self.species.as_ref().filter(|_| self.has_species)
    }

    pub(crate) fn staging(&mut self, gpu: &GpuDevice, pairs: u64) -> Result<wgpu::Buffer, Error> {
        let needed = PAIRS_AT + pairs * 8;
        if let Some(staging) = self.staging.as_ref().filter(|staging| staging.size() >= needed) {
            return Ok(staging.clone());
        }
        let size = PAIRS_AT + pairs.next_power_of_two() * 8;
        let staging = with_error_scope(&gpu.device, "staging", size, || {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("lazygrid::staging"),
                size,
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })?;
        Ok(self.staging.insert(staging).clone())
    }

    /// A finished call returns the buffer.
    pub(crate) fn lend_staging(&mut self) {
        self.staging = None;
    }

    pub(crate) fn return_staging(&mut self, staging: wgpu::Buffer) {
        self.staging = Some(staging);
    }

    pub(crate) fn device_bytes(&self) -> u64 {
        [&self.spheres, &self.species, &self.staging].into_iter().flatten().map(wgpu::Buffer::size).sum()
    }
}

pub(crate) fn copy_to_staging(
    encoder: &mut wgpu::CommandEncoder,
    from: [Option<&wgpu::Buffer>; 3],
    staging: &wgpu::Buffer,
    pairs: u64,
) {
    let [outcome, details, list] = from;
    for (source, at, most) in
        [(outcome, 0, TICKS_AT), (details, TICKS_AT, TICKS_AT), (list, PAIRS_AT, pairs * 8)]
    {
        if let Some(source) = source {
            let bytes = source.size().min(most);
            if bytes > 0 {
                encoder.copy_buffer_to_buffer(source, 0, staging, at, bytes);
            }
        }
    }
}

pub(crate) struct Readback<'a>(pub(crate) &'a [u8]);

impl Readback<'_> {
    pub(crate) fn outcome(&self) -> Result<Outcome, Error> {
        read_outcome(self.0)
    }

    pub(crate) fn ticks(&self, phase: GpuPhase) -> [u64; 2] {
        let at = TICKS_AT as usize + phase as usize * size_of::<[u64; 2]>();
        bytemuck::pod_read_unaligned(&self.0[at..at + size_of::<[u64; 2]>()])
    }

    pub(crate) fn state(&self) -> SkinState {
        let at = TICKS_AT as usize;
        bytemuck::pod_read_unaligned(&self.0[at..at + size_of::<SkinState>()])
    }

    pub(crate) fn append_pairs(&self, count: usize, pairs: &mut Vec<Pair>) -> Result<(), Error> {
        let at = PAIRS_AT as usize;
        try_reserve(pairs, count, "pairs")?;
        pairs.extend_from_slice(bytemuck::cast_slice(&self.0[at..at + count * size_of::<Pair>()]));
        Ok(())
    }
}

fn write<T: Pod>(
    gpu: &GpuDevice,
    buffer: &mut Option<wgpu::Buffer>,
    what: &'static str,
    data: &[T],
) -> Result<(), Error> {
    let bytes: &[u8] = bytemuck::cast_slice(data);
    let needed = bytes.len() as u64;
    let limit = gpu.device.limits().max_storage_buffer_binding_size.min(gpu.device.limits().max_buffer_size);
    if needed > limit {
        let remedy = "split the spheres or take a device with a larger limit";
        return Err(Error::LimitExceeded { what: "the sphere buffer", needed, limit, remedy });
    }
    let size = needed.next_power_of_two().clamp(16, limit);
    // A buffer that could not be created also reports the requested size, so it is not kept.
    let fitting = buffer.take().filter(|buffer| buffer.size() >= needed);
    *buffer = Some(with_error_scope(&gpu.device, what, size, || {
        let target = fitting.unwrap_or_else(|| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(what),
                size,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        });
        gpu.queue.write_buffer(&target, 0, bytes);
        target
    })?);
    Ok(())
}
