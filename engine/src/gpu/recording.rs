use std::collections::{HashMap, VecDeque};

use lazygrid_kernels::kernel::{CROWDED_OPEN, SHARES_OPEN, Variant};

use super::pipelines::Pipelines;
use super::plan::{DeviceLimits, Phase, Slot, Stage, flattened};
use super::scope::scoped;
use crate::Error;

/// The buffers that a detector or a primitive owns.
#[derive(Debug, Default)]
pub(crate) struct Buffers(HashMap<Slot, wgpu::Buffer>);

impl Buffers {
    pub(crate) fn allocate(device: &wgpu::Device, sizes: &[(Slot, u64)]) -> Result<Self, Error> {
        let mut buffers = HashMap::new();
        for &(slot, size) in sizes {
            let mut usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
            if matches!(slot, Slot::Outcome | Slot::Dispatch | Slot::Gate) {
                usage |= wgpu::BufferUsages::INDIRECT;
            }
            if slot == Slot::Total {
                usage |= wgpu::BufferUsages::COPY_DST;
            }
            let label = format!("lazygrid::{slot:?}");
            let descriptor =
                wgpu::BufferDescriptor { label: Some(&label), size, usage, mapped_at_creation: false };
            let buffer = scoped(device, "a buffer", size, || device.create_buffer(&descriptor))?;
            buffers.insert(slot, buffer);
        }
        Ok(Self(buffers))
    }

    /// Returns `true` if these would do where buffers of `sizes` are needed.
    pub(crate) fn have_room_for(&self, sizes: &[(Slot, u64)]) -> bool {
        sizes.iter().all(|(slot, size)| self.0.get(slot).is_some_and(|buffer| buffer.size() >= *size))
    }

    pub(crate) fn get(&self, slot: Slot) -> &wgpu::Buffer {
        &self.0[&slot]
    }

    /// One that there may not be.
    pub(crate) fn find(&self, slot: Slot) -> Option<&wgpu::Buffer> {
        self.0.get(&slot)
    }
}

/// A read-only buffer with these contents. Needs no queue, so that it can be made while recording.
pub(crate) fn constant_buffer(
    device: &wgpu::Device,
    label: &'static str,
    contents: &[u8],
) -> Result<wgpu::Buffer, Error> {
    let size = (contents.len() as u64).max(16).next_multiple_of(16);
    let descriptor = wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: true,
    };
    scoped(device, label, size, || -> Result<wgpu::Buffer, wgpu::MapRangeError> {
        let buffer = device.create_buffer(&descriptor);
        buffer.slice(..contents.len() as u64).get_mapped_range_mut()?.copy_from_slice(contents);
        buffer.unmap();
        Ok(buffer)
    })?
    .map_err(|error| Error::Validation { what: label, reason: error.to_string() })
}

/// The last few things that were made, for callers that alternate between a few buffers.
#[derive(Debug)]
pub(crate) struct Recent<K, V> {
    made: VecDeque<(K, V)>,
    /// The one that was turned to last.
    current: usize,
}

impl<K: PartialEq, V> Recent<K, V> {
    const MOST: usize = 4;

    pub(crate) const NONE: Self = Self { made: VecDeque::new(), current: 0 };

    /// Turns to what was made for this, and makes it first where it was not.
    pub(crate) fn turn_to(&mut self, key: K, make: impl FnOnce(&K) -> Result<V, Error>) -> Result<(), Error> {
        self.current = match self.made.iter().position(|(known, _)| *known == key) {
            Some(position) => position,
            None => {
                let value = make(&key)?;
                self.made.truncate(Self::MOST - 1);
                self.made.push_front((key, value));
                0
            }
        };
        Ok(())
    }

    pub(crate) fn current(&self) -> Option<&V> {
        self.made.get(self.current).map(|(_, value)| value)
    }
}

/// Dispatches with everything bound, ready to be put into any encoder.
#[derive(Debug)]
pub(crate) struct Recording {
    steps: Vec<Step>,
    /// Where a further part of a call begins; after the last step if there is none.
    rest: usize,
}

#[derive(Debug)]
struct Step {
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    groups: Groups,
    phase: Phase,
}

/// The number of workgroups of a step.
#[derive(Debug)]
enum Groups {
    Fixed([u32; 2]),
    /// The number that this buffer holds when the step runs.
    Indirect(wgpu::Buffer),
}

impl Recording {
    /// Binds what `resolve` names for each binding of each stage.
    pub(crate) fn new<'a>(
        device: &wgpu::Device,
        pipelines: &Pipelines,
        variant: Variant,
        stages: impl IntoIterator<Item = Stage>,
        resolve: impl Fn(&Stage, &str) -> &'a wgpu::Buffer,
    ) -> Result<Self, Error> {
        let limits = DeviceLimits::of(device);
        let mut steps = Vec::new();
        let mut rest = None;
        for stage in stages {
            if stage.kernel == &CROWDED_OPEN || stage.kernel == &SHARES_OPEN {
                rest = Some(steps.len());
            }
            let compiled = pipelines.get(stage.kernel, variant)?;
            let entries: Vec<_> = (0..)
                .zip(stage.kernel.bindings(variant))
                .map(|(binding, bound)| wgpu::BindGroupEntry {
                    binding,
                    resource: resolve(&stage, bound.name).as_entire_binding(),
                })
                .collect();
            let bindings = scoped(device, stage.kernel.name, 0, || {
                device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some(stage.kernel.name),
                    layout: &compiled.layout,
                    entries: &entries,
                })
            })?;
            let groups = match stage.indirect {
                false => Groups::Fixed(flattened(stage.groups, &limits)),
                true => Groups::Indirect(resolve(&stage, "dispatch").clone()),
            };
            steps.push(Step { pipeline: compiled.pipeline, bindings, groups, phase: stage.phase });
        }
        Ok(Self { rest: rest.unwrap_or(steps.len()), steps })
    }

    /// Records all dispatches in one pass.
    pub(crate) fn encode(&self, encoder: &mut wgpu::CommandEncoder) {
        let descriptor = wgpu::ComputePassDescriptor { label: Some("lazygrid"), timestamp_writes: None };
        let mut pass = encoder.begin_compute_pass(&descriptor);
        self.steps.iter().for_each(|step| step.dispatch(&mut pass));
    }

    /// The workgroups of each step, three words for each; none where an earlier step finds how many.
    pub(crate) fn groups(&self) -> Vec<u32> {
        let of = |step: &Step| match step.groups {
            Groups::Fixed([x, y]) => [x, y, 1],
            Groups::Indirect(_) => [0; 3],
        };
        self.steps.iter().flat_map(of).collect()
    }

    /// Where earlier steps say how many workgroups a later one has.
    pub(crate) fn found_groups(&self) -> Option<&wgpu::Buffer> {
        self.steps.iter().find_map(|step| match &step.groups {
            Groups::Fixed(_) => None,
            Groups::Indirect(buffer) => Some(buffer),
        })
    }

    /// Records all dispatches in one pass, each with as many workgroups as `gate` says by then, where it has
    /// [`groups`](Self::groups) or zeros.
    pub(crate) fn encode_gated(&self, encoder: &mut wgpu::CommandEncoder, gate: &wgpu::Buffer) {
        let descriptor =
            wgpu::ComputePassDescriptor { label: Some("lazygrid gated"), timestamp_writes: None };
        let mut pass = encoder.begin_compute_pass(&descriptor);
        for (offset, step) in (0..).step_by(12).zip(&self.steps) {
            step.bind(&mut pass);
            match &step.groups {
                Groups::Fixed(_) => pass.dispatch_workgroups_indirect(gate, offset),
                Groups::Indirect(found) => pass.dispatch_workgroups_indirect(found, 0),
            }
        }
    }

    /// Records a further part of a call that is too much for one submission; with timestamps if there are queries,
    /// in place of those of the search before.
    pub(crate) fn encode_rest(&self, encoder: &mut wgpu::CommandEncoder, queries: Option<&wgpu::QuerySet>) {
        let descriptor = wgpu::ComputePassDescriptor {
            label: Some("lazygrid rest"),
            timestamp_writes: queries.map(|queries| ends_of(Phase::Search, queries)),
        };
        let mut pass = encoder.begin_compute_pass(&descriptor);
        self.steps[self.rest..].iter().for_each(|step| step.dispatch(&mut pass));
    }

    /// Records a pass for each phase with a timestamp at either end.
    pub(crate) fn encode_timed(&self, encoder: &mut wgpu::CommandEncoder, queries: &wgpu::QuerySet) {
        for phase in Phase::ALL {
            let descriptor = wgpu::ComputePassDescriptor {
                label: Some(phase.name()),
                timestamp_writes: Some(ends_of(phase, queries)),
            };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            self.steps.iter().filter(|step| step.phase == phase).for_each(|step| step.dispatch(&mut pass));
        }
    }
}

/// Has a pass write the times at which it begins and ends, as those of a phase.
fn ends_of(phase: Phase, queries: &wgpu::QuerySet) -> wgpu::ComputePassTimestampWrites<'_> {
    wgpu::ComputePassTimestampWrites {
        query_set: queries,
        beginning_of_pass_write_index: Some(2 * phase as u32),
        end_of_pass_write_index: Some(2 * phase as u32 + 1),
    }
}

impl Step {
    fn bind(&self, pass: &mut wgpu::ComputePass<'_>) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
    }

    fn dispatch(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.bind(pass);
        match &self.groups {
            Groups::Fixed([x, y]) => pass.dispatch_workgroups(*x, *y, 1),
            Groups::Indirect(buffer) => pass.dispatch_workgroups_indirect(buffer, 0),
        }
    }
}
