use std::collections::HashMap;
use std::ops::Range;

use lazygrid_kernels::kernel::Variant;

use super::bound_buffer::BoundBuffer;
use crate::Error;
use crate::gpu::device::{Pipelines, with_error_scope};
use crate::gpu::plan::{
    BufferId, DeviceLimits, Dispatch, DispatchSequence, GpuPhase, PlanKernel, Workgroups,
};

#[derive(Debug, Default)]
pub(crate) struct Buffers(HashMap<BufferId, wgpu::Buffer>);

impl Buffers {
    pub(crate) fn allocate(device: &wgpu::Device, sizes: &[(BufferId, u64)]) -> Result<Self, Error> {
        let mut buffers = HashMap::new();
        for &(id, size) in sizes {
            let usage = id.usage().into();
            let label = format!("lazygrid::{id:?}");
            let descriptor =
                wgpu::BufferDescriptor { label: Some(&label), size, usage, mapped_at_creation: false };
            let buffer = with_error_scope(device, "a buffer", size, || device.create_buffer(&descriptor))?;
            buffers.insert(id, buffer);
        }
        Ok(Self(buffers))
    }

    pub(crate) fn have_capacity_for(&self, sizes: &[(BufferId, u64)]) -> bool {
        sizes.iter().all(|(id, size)| self.0.get(id).is_some_and(|buffer| buffer.size() >= *size))
    }

    pub(crate) fn get(&self, id: BufferId) -> &wgpu::Buffer {
        &self.0[&id]
    }

    pub(crate) fn find(&self, id: BufferId) -> Option<&wgpu::Buffer> {
        self.0.get(&id)
    }
}

#[derive(Debug)]
pub(crate) struct Recording {
    dispatches: Vec<BoundDispatch>,
    continuation_start: usize,
    part_starts: Vec<usize>,
    stamps_inside_passes: bool,
    cleared: Option<(wgpu::Buffer, u64)>,
}

#[derive(Debug)]
struct BoundDispatch {
    kernel: &'static str,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    groups: WorkgroupCount,
    phase: GpuPhase,
}

#[derive(Debug)]
enum WorkgroupCount {
    Fixed([u32; 2]),
    Indirect(wgpu::Buffer, u64),
}

impl Recording {
    pub(crate) fn new<B: Into<BoundBuffer> + PartialEq>(
        device: &wgpu::Device,
        pipelines: &Pipelines,
        variant: Variant,
        dispatches: impl IntoIterator<Item = Dispatch>,
        resolve: impl Fn(&Dispatch, &str) -> B,
    ) -> Result<Self, Error> {
        let limits = DeviceLimits::from_device(device);
        let (sequence, buffers) = DispatchSequence::resolved(dispatches, variant, &limits, resolve);
        let buffers: Vec<BoundBuffer> = buffers.into_iter().map(B::into).collect();
        Self::from_sequence(device, pipelines, &sequence, &buffers)
    }

    pub(crate) fn from_sequence(
        device: &wgpu::Device,
        pipelines: &Pipelines,
        sequence: &DispatchSequence,
        buffers: &[BoundBuffer],
    ) -> Result<Self, Error> {
        let mut dispatches = Vec::with_capacity(sequence.dispatches.len());
        for dispatch in &sequence.dispatches {
            let PlanKernel { kernel, variant } = sequence.kernels[dispatch.kernel];
            let compiled = pipelines.get(kernel, variant)?;
            let entries: Vec<_> = (0..)
                .zip(&dispatch.buffers)
                .map(|(binding, &buffer)| wgpu::BindGroupEntry {
                    binding,
                    resource: buffers[buffer].binding(),
                })
                .collect();
            let bindings = with_error_scope(device, kernel.name, 0, || {
                device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some(kernel.name),
                    layout: &compiled.layout,
                    entries: &entries,
                })
            })?;
            let groups = match dispatch.workgroups {
                Workgroups::Fixed(groups) => WorkgroupCount::Fixed(groups),
                Workgroups::Indirect { buffer, offset } => {
                    WorkgroupCount::Indirect(buffers[buffer].buffer.clone(), offset)
                }
            };
            let pipeline = compiled.pipeline;
            let (kernel, phase) = (kernel.name, dispatch.phase);
            dispatches.push(BoundDispatch { kernel, pipeline, bindings, groups, phase });
        }
        let (continuation_start, part_starts) = (sequence.continuation, sequence.part_starts.clone());
        let stamps_inside_passes = device.features().contains(wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES);
        Ok(Self { dispatches, continuation_start, part_starts, stamps_inside_passes, cleared: None })
    }

    pub(crate) fn clearing(self, buffer: &wgpu::Buffer, bytes: u64) -> Self {
        Self { cleared: Some((buffer.clone(), bytes)), ..self }
    }

    pub(crate) fn encode(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass = begin_pass(encoder, "lazygrid", None);
        self.dispatches.iter().for_each(|dispatch| dispatch.record(&mut pass));
    }

    pub(crate) fn workgroup_counts(&self) -> Vec<u32> {
        let counts_of = |dispatch: &BoundDispatch| match dispatch.groups {
            WorkgroupCount::Fixed([x, y]) => [x, y, 1],
            WorkgroupCount::Indirect(..) => [0; 3],
        };
        self.dispatches.iter().flat_map(counts_of).collect()
    }

    pub(crate) fn indirect_args(&self) -> Option<&wgpu::Buffer> {
        self.dispatches.iter().find_map(|dispatch| match &dispatch.groups {
            WorkgroupCount::Fixed(_) => None,
            WorkgroupCount::Indirect(buffer, _) => Some(buffer),
        })
    }

    /// Records a part whose workgroup counts are in `counts`: [`workgroup_counts`](Self::workgroup_counts) or zeros.
    pub(crate) fn encode_indirect_part(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        part: u32,
        counts: &wgpu::Buffer,
    ) {
        let mut pass = begin_pass(encoder, "lazygrid indirect", None);
        let range = self.range_of_part(part);
        for (offset, dispatch) in (12 * range.start as u64..).step_by(12).zip(&self.dispatches[range]) {
            dispatch.bind(&mut pass);
            match &dispatch.groups {
                WorkgroupCount::Fixed(_) => pass.dispatch_workgroups_indirect(counts, offset),
                WorkgroupCount::Indirect(found, at) => pass.dispatch_workgroups_indirect(found, *at),
            }
        }
    }

    pub(crate) fn kernels(&self) -> impl Iterator<Item = &'static str> {
        self.dispatches.iter().map(|dispatch| dispatch.kernel)
    }

    pub(crate) fn encode_stamped(&self, encoder: &mut wgpu::CommandEncoder, queries: &wgpu::QuerySet) {
        if let Some((buffer, bytes)) = &self.cleared {
            encoder.clear_buffer(buffer, 0, Some(*bytes));
        }
        let mut pass = begin_pass(encoder, "lazygrid stamped", None);
        for (index, dispatch) in (0..).zip(&self.dispatches) {
            pass.write_timestamp(queries, index);
            dispatch.record(&mut pass);
        }
        pass.write_timestamp(queries, self.dispatches.len() as u32);
    }

    pub(crate) fn encode_continuation(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        queries: Option<&wgpu::QuerySet>,
    ) {
        let timestamps = queries.and_then(|queries| ends_of(GpuPhase::Search, queries, [true; 2]));
        let mut pass = begin_pass(encoder, "lazygrid continuation", timestamps);
        self.dispatches[self.continuation_start..].iter().for_each(|dispatch| dispatch.record(&mut pass));
    }

    pub(crate) fn parts(&self) -> u32 {
        1 + self.part_starts.len() as u32
    }

    fn range_of_part(&self, part: u32) -> Range<usize> {
        let start_of = |part: u32| match part {
            0 => 0,
            part => self.part_starts.get(part as usize - 1).copied().unwrap_or(self.dispatches.len()),
        };
        start_of(part)..start_of(part + 1)
    }

    pub(crate) fn encode_part(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        part: u32,
        queries: Option<&wgpu::QuerySet>,
    ) {
        let dispatches = &self.dispatches[self.range_of_part(part)];
        if let Some((buffer, bytes)) = self.cleared.as_ref().filter(|_| part == 0) {
            encoder.clear_buffer(buffer, 0, Some(*bytes));
        }
        let Some(queries) = queries else {
            let mut pass = begin_pass(encoder, "lazygrid", None);
            dispatches.iter().for_each(|dispatch| dispatch.record(&mut pass));
            return;
        };
        let is_last = part + 1 == self.parts();
        let ends_in_part = |phase| match phase {
            GpuPhase::Search => [part == 0, is_last],
            _ => [part == 0; 2],
        };
        let of_phase = |phase| dispatches.iter().filter(move |dispatch| dispatch.phase == phase);
        if self.stamps_inside_passes {
            let mut pass = begin_pass(encoder, "lazygrid timed", None);
            for &phase in GpuPhase::ALL {
                let [begins, ends] = ends_in_part(phase);
                if begins {
                    pass.write_timestamp(queries, 2 * phase as u32);
                }
                of_phase(phase).for_each(|dispatch| dispatch.record(&mut pass));
                if ends {
                    pass.write_timestamp(queries, 2 * phase as u32 + 1);
                }
            }
            return;
        }
        for &phase in GpuPhase::ALL {
            if part > 0 && of_phase(phase).next().is_none() {
                continue;
            }
            let mut pass = begin_pass(encoder, phase.name(), ends_of(phase, queries, ends_in_part(phase)));
            of_phase(phase).for_each(|dispatch| dispatch.record(&mut pass));
        }
    }
}

fn begin_pass<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    label: &str,
    timestamp_writes: Option<wgpu::ComputePassTimestampWrites<'_>>,
) -> wgpu::ComputePass<'a> {
    encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes })
}

fn ends_of(
    phase: GpuPhase,
    queries: &wgpu::QuerySet,
    [begins, ends]: [bool; 2],
) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
    let first = 2 * phase as u32;
    (begins || ends).then_some(wgpu::ComputePassTimestampWrites {
        query_set: queries,
        beginning_of_pass_write_index: begins.then_some(first),
        end_of_pass_write_index: ends.then_some(first + 1),
    })
}

impl BoundDispatch {
    fn bind(&self, pass: &mut wgpu::ComputePass<'_>) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
    }

    fn record(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.bind(pass);
        match &self.groups {
            WorkgroupCount::Fixed([x, y]) => pass.dispatch_workgroups(*x, *y, 1),
            WorkgroupCount::Indirect(buffer, at) => pass.dispatch_workgroups_indirect(buffer, *at),
        }
    }
}
