//! The building blocks on their own: a stable radix sort and an exclusive prefix scan.

use lazygrid_kernels::kernel::SCAN_TILE;
use lazygrid_kernels::layout::{Lengths, Pass};

use super::GpuError;
use super::pipelines::Pipelines;
use super::plan::{DeviceLimits, Slot, digits, scan_stages, sort_buffers, sort_stages};
use super::recording::{Buffers, Recording, constant_buffer};

/// A stable sort of `u32` keys with a `u32` payload, least significant digit first, up to eight bits a pass.
///
/// Keys that are equal in the bits sorted by keep their order. Nothing spins on another workgroup, so that it
/// runs on every device.
#[derive(Debug)]
pub struct RadixSort {
    device: wgpu::Device,
    pipelines: Pipelines,
}

/// Where a recorded sort leaves its result, and the buffers it works in.
#[derive(Debug)]
pub struct Sorted {
    /// The keys in order.
    pub keys: wgpu::Buffer,
    /// The payload, moved with its keys.
    pub payload: wgpu::Buffer,
}

impl RadixSort {
    /// With `subgroups` their operations are used where the device was made with them.
    pub fn new(device: &wgpu::Device, subgroups: bool) -> Self {
        Self { device: device.clone(), pipelines: pipelines(device, subgroups) }
    }

    /// Records a sort of the first `count` keys by their lowest `bits` bits, at least one. The buffers that come in are
    /// overwritten; the result is in those that come back.
    ///
    /// # Errors
    /// Where the device refuses a buffer or a binding.
    pub fn encode(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        input: &Sorted,
        count: u32,
        bits: u32,
    ) -> Result<Sorted, GpuError> {
        let tile = DeviceLimits::of(&self.device).radix_tile();
        let mut sizes = sort_buffers(count, tile).to_vec();
        sizes.retain(|(slot, _)| !matches!(slot, Slot::Keys(false) | Slot::Objects(false)));
        let buffers = Buffers::allocate(&self.device, &sizes)?;
        let lengths = Lengths::for_sort(count, tile);
        let lengths = constant_buffer(&self.device, "lengths", bytemuck::bytes_of(&lengths))?;
        let keys = [&input.keys, buffers.get(Slot::Keys(true))];
        let payload = [&input.payload, buffers.get(Slot::Objects(true))];
        let variant = self.pipelines.variant();
        let uniforms = pass_buffers(&self.device, &digits(bits.clamp(1, 32), false))?;
        let passes = uniforms.len() as u32;
        let stages = sort_stages(count, tile, passes).filter(|stage| stage.groups > 0);
        let recording = Recording::new(&self.device, &self.pipelines, variant, stages, |stage, binding| {
            let front = stage.pass as usize % 2;
            match binding {
                "digit_pass" => &uniforms[stage.pass as usize],
                "lengths" => &lengths,
                "keys" => keys[front],
                "payload" => payload[front],
                "sorted_keys" => keys[1 - front],
                "sorted_payload" => payload[1 - front],
                "totals" => buffers.get(Slot::Totals),
                _ => buffers.get(Slot::Counts),
            }
        })?;
        recording.encode(encoder);
        let last = if count == 0 { 0 } else { passes as usize % 2 };
        Ok(Sorted { keys: keys[last].clone(), payload: payload[last].clone() })
    }
}

/// The uniforms of radix passes.
pub(crate) fn pass_buffers(device: &wgpu::Device, digits: &[Pass]) -> Result<Vec<wgpu::Buffer>, GpuError> {
    digits.iter().map(|digit| constant_buffer(device, "radix pass", bytemuck::bytes_of(digit))).collect()
}

/// Exclusive prefix sums of `u32` values in place. Sums beyond 32 bits keep their low word; the total is exact in
/// 64 bits.
#[derive(Debug)]
pub struct PrefixScan {
    device: wgpu::Device,
    pipelines: Pipelines,
}

impl PrefixScan {
    /// With `subgroups` their operations are used where the device was made with them.
    pub fn new(device: &wgpu::Device, subgroups: bool) -> Self {
        Self { device: device.clone(), pipelines: pipelines(device, subgroups) }
    }

    /// Records a scan of the first `count` values; returns the buffer that gets the total as (low, high).
    ///
    /// # Errors
    /// Where the device refuses a buffer or a binding.
    pub fn encode(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        values: &wgpu::Buffer,
        count: u32,
    ) -> Result<wgpu::Buffer, GpuError> {
        let sums = u64::from(count.div_ceil(SCAN_TILE)).max(2) * 8;
        let buffers = Buffers::allocate(&self.device, &[(Slot::Sums, sums), (Slot::Total, 16)])?;
        let lengths = Lengths { items: 0, counters: count };
        let lengths = constant_buffer(&self.device, "lengths", bytemuck::bytes_of(&lengths))?;
        let variant = self.pipelines.variant();
        let stages = scan_stages(count, 0).into_iter().filter(|stage| stage.groups > 0);
        Recording::new(&self.device, &self.pipelines, variant, stages, |_, binding| match binding {
            "lengths" => &lengths,
            "values" => values,
            "sums" => buffers.get(Slot::Sums),
            _ => buffers.get(Slot::Total),
        })?
        .encode(encoder);
        Ok(buffers.get(Slot::Total).clone())
    }
}

fn pipelines(device: &wgpu::Device, subgroups: bool) -> Pipelines {
    let pipelines = Pipelines::new(device);
    if subgroups { pipelines } else { pipelines.without_subgroups() }
}
