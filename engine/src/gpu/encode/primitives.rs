use lazygrid_kernels::kernel::SCAN_TILE;
use lazygrid_kernels::layout::{RadixPass, SortCounts};

use super::recording::{Buffers, Recording};
use crate::Error;
use crate::gpu::device::{Pipelines, constant_buffer};
use crate::gpu::plan::{BufferId, digits, scan_dispatches, sort_buffers, sort_dispatches};

/// A stable radix sort of `u32` keys with a `u32` payload. No workgroup waits for another, so it runs on every device.
#[derive(Debug)]
pub struct RadixSort {
    device: wgpu::Device,
    pipelines: Pipelines,
}

/// Keys and payload with `STORAGE` usage.
#[derive(Clone, Debug)]
pub struct KeyValueBuffers {
    /// One `u32` per item.
    pub keys: wgpu::Buffer,
    /// One `u32` per item, which moves with its key.
    pub payload: wgpu::Buffer,
}

/// A sort of bound buffers.
#[derive(Debug)]
pub struct BoundSort {
    recording: Recording,
    sorted: KeyValueBuffers,
}

impl RadixSort {
    /// Creates the sort. `subgroups` permits subgroup operations.
    pub fn new(device: &wgpu::Device, subgroups: bool) -> Self {
        Self { device: device.clone(), pipelines: pipelines(device, subgroups) }
    }

    /// Binds a sort of the first `count` keys by their lowest `bits` bits, at least one. It overwrites the input.
    ///
    /// # Errors
    /// [`Error::BufferSize`] if `input` has less than `count` words; fails if the device refuses a buffer or a binding.
    pub fn bind(&self, input: &KeyValueBuffers, count: u32, bits: u32) -> Result<BoundSort, Error> {
        check_words("keys", &input.keys, count)?;
        check_words("payload", &input.payload, count)?;
        let mut sizes = sort_buffers(count).to_vec();
        sizes.retain(|(id, _)| !matches!(id, BufferId::Keys(false) | BufferId::Objects(false)));
        let buffers = Buffers::allocate(&self.device, &sizes)?;
        let lengths = SortCounts::for_sort(count);
        let lengths = constant_buffer(&self.device, "lengths", bytemuck::bytes_of(&lengths))?;
        let keys = [&input.keys, buffers.get(BufferId::Keys(true))];
        let payload = [&input.payload, buffers.get(BufferId::Objects(true))];
        let variant = self.pipelines.variant();
        let uniforms = pass_buffers(&self.device, &digits(bits.clamp(1, 32), false))?;
        let passes = uniforms.len() as u32;
        let dispatches = sort_dispatches(count, passes).filter(|dispatch| dispatch.groups > 0);
        let recording =
            Recording::new(&self.device, &self.pipelines, variant, dispatches, |dispatch, binding| {
                let front = dispatch.pass as usize % 2;
                match binding {
                    "digit_pass" => &uniforms[dispatch.pass as usize],
                    "sort_counts" => &lengths,
                    "keys" => keys[front],
                    "payload" => payload[front],
                    "sorted_keys" => keys[1 - front],
                    "sorted_payload" => payload[1 - front],
                    "totals" => buffers.get(BufferId::Totals),
                    _ => buffers.get(BufferId::Counts),
                }
            })?;
        let last = if count == 0 { 0 } else { passes as usize % 2 };
        let sorted = KeyValueBuffers { keys: keys[last].clone(), payload: payload[last].clone() };
        Ok(BoundSort { recording, sorted })
    }
}

impl BoundSort {
    /// Records the sort.
    pub fn encode(&self, encoder: &mut wgpu::CommandEncoder) {
        self.recording.encode(encoder);
    }

    /// Returns the buffers of the result: the input or others.
    pub fn sorted(&self) -> &KeyValueBuffers {
        &self.sorted
    }
}

fn check_words(what: &'static str, buffer: &wgpu::Buffer, count: u32) -> Result<(), Error> {
    let (size, needed) = (buffer.size(), 4 * u64::from(count));
    if size < needed { Err(Error::BufferSize { what, size, needed }) } else { Ok(()) }
}

fn pass_buffers(device: &wgpu::Device, digits: &[RadixPass]) -> Result<Vec<wgpu::Buffer>, Error> {
    digits.iter().map(|digit| constant_buffer(device, "radix pass", bytemuck::bytes_of(digit))).collect()
}

/// Exclusive prefix sums of `u32` values in place. Sums keep their low 32 bits; the total has 64.
#[derive(Debug)]
pub struct PrefixScan {
    device: wgpu::Device,
    pipelines: Pipelines,
}

/// A scan of a bound buffer.
#[derive(Debug)]
pub struct BoundScan {
    recording: Recording,
    total: wgpu::Buffer,
}

impl PrefixScan {
    /// Creates the scan. `subgroups` permits subgroup operations.
    pub fn new(device: &wgpu::Device, subgroups: bool) -> Self {
        Self { device: device.clone(), pipelines: pipelines(device, subgroups) }
    }

    /// Binds a scan of the first `count` values; `values` needs `STORAGE` usage.
    ///
    /// # Errors
    /// [`Error::BufferSize`] if `values` has less than `count` words; fails if the device refuses a buffer or a
    /// binding.
    pub fn bind(&self, values: &wgpu::Buffer, count: u32) -> Result<BoundScan, Error> {
        check_words("values", values, count)?;
        let sums = u64::from(count.div_ceil(SCAN_TILE)).max(2) * 8;
        let buffers = Buffers::allocate(&self.device, &[(BufferId::Sums, sums), (BufferId::Total, 16)])?;
        let lengths = SortCounts { items: 0, counters: count };
        let lengths = constant_buffer(&self.device, "lengths", bytemuck::bytes_of(&lengths))?;
        let variant = self.pipelines.variant();
        let dispatches = scan_dispatches(count, 0).into_iter().filter(|dispatch| dispatch.groups > 0);
        let total = buffers.get(BufferId::Total);
        let recording =
            Recording::new(&self.device, &self.pipelines, variant, dispatches, |_, binding| match binding {
                "sort_counts" => &lengths,
                "values" => values,
                "sums" => buffers.get(BufferId::Sums),
                _ => total,
            })?;
        Ok(BoundScan { recording, total: total.clone() })
    }
}

impl BoundScan {
    /// Records the scan.
    pub fn encode(&self, encoder: &mut wgpu::CommandEncoder) {
        self.recording.encode(encoder);
    }

    /// Buffer of the total as (low, high).
    pub fn total(&self) -> &wgpu::Buffer {
        &self.total
    }
}

fn pipelines(device: &wgpu::Device, subgroups: bool) -> Pipelines {
    let pipelines = Pipelines::new(device);
    if subgroups { pipelines } else { pipelines.without_subgroups() }
}
