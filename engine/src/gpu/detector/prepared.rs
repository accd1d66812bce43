//! The buffers of calls of a size, with what was recorded for them.

use std::collections::VecDeque;

use lazygrid_kernels::Algorithm;
use lazygrid_kernels::kernel::Variant;
use lazygrid_kernels::layout::Call;

use super::tables::Tables;
use super::{GpuPairs, GpuSorted};
use crate::Error;
use crate::gpu::pipelines::Pipelines;
use crate::gpu::plan::{Plan, Resource, Slot};
use crate::gpu::primitives::pass_buffers;
use crate::gpu::recording::{Buffers, Recording, constant_buffer};

/// Everything that depends on the size of a call.
#[derive(Debug)]
pub(super) struct Prepared {
    pub(super) plan: Plan,
    pub(super) buffers: Buffers,
    pub(super) recordings: VecDeque<(Key, Recording)>,
    /// The one that was used last.
    pub(super) current: usize,
}

/// What a recording was made for.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Key {
    pub(super) spheres: wgpu::Buffer,
    pub(super) species: Option<wgpu::Buffer>,
    pub(super) count: Option<wgpu::Buffer>,
    pub(super) call: Call,
}

impl Prepared {
    pub(super) fn output(&self) -> GpuPairs {
        let [pairs, outcome] = [Slot::Pairs, Slot::Outcome].map(|slot| self.buffers.get(slot).clone());
        let sorted = (self.plan.algorithm == Algorithm::CellList).then(|| GpuSorted {
            order: self.buffers.get(self.plan.order()).clone(),
            spheres: self.buffers.get(Slot::Sorted).clone(),
            species: self.buffers.find(Slot::SortedSpecies).cloned(),
        });
        GpuPairs { pairs, capacity: self.plan.pairs, outcome, sorted }
    }

    pub(super) fn bind(
        &self,
        device: &wgpu::Device,
        pipelines: &Pipelines,
        key: &Key,
        tables: Option<&Tables>,
    ) -> Result<Recording, Error> {
        let call = constant_buffer(device, "call", bytemuck::bytes_of(&key.call))?;
        let passes = pass_buffers(device, &self.plan.digits())?;
        let species = tables.is_some();
        let variant = Variant { species, periodic: self.plan.periodic, ..pipelines.variant() };
        let stages = self.plan.stages.iter().cloned();
        Recording::new(device, pipelines, variant, stages, |stage, binding| {
            match (self.plan.resource(stage, binding), tables, &key.species) {
                (Resource::Own(slot), ..) => self.buffers.get(slot),
                (Resource::Spheres, ..) => &key.spheres,
                (Resource::Count, ..) => key.count.as_ref().unwrap_or(&call),
                (Resource::Pass(pass), ..) => &passes[pass as usize],
                (Resource::Species, _, Some(species)) => species,
                (Resource::Reach, Some(tables), _) => &tables.reach,
                (Resource::Table, Some(tables), _) => &tables.table,
                _ => &call,
            }
        })
    }
}
