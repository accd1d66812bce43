//! The buffers of calls of a size, with what was recorded for them.

use lazygrid_kernels::Algorithm;
use lazygrid_kernels::kernel::Variant;
use lazygrid_kernels::layout::SearchParams;

use super::input::{GpuSpheres, SphereCount};
use super::output::{CellOrder, GpuOutput};
use super::tables::Tables;
use crate::Error;
use crate::gpu::device::{Pipelines, constant_buffer};
use crate::gpu::encode::{Buffers, Recording, SmallCache, pass_buffers};
use crate::gpu::plan::{BufferId, Plan, Resource};

/// Everything that depends on the size of a call.
#[derive(Debug)]
pub(super) struct Prepared {
    pub(super) plan: Plan,
    pub(super) buffers: Buffers,
    pub(super) recordings: SmallCache<Key, Recording>,
}

/// The buffers and sizes that a recording is valid for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Key {
    pub(crate) spheres: wgpu::Buffer,
    pub(crate) species: Option<wgpu::Buffer>,
    pub(crate) count: Option<wgpu::Buffer>,
    pub(crate) call: SearchParams,
}

impl Key {
    pub(crate) fn of(input: &GpuSpheres<'_>, call: SearchParams) -> Self {
        let count = match input.count {
            SphereCount::Host(_) => None,
            SphereCount::Buffer { buffer, .. } => Some(buffer.clone()),
        };
        Self { spheres: input.spheres.clone(), species: input.species.cloned(), count, call }
    }
}

impl Prepared {
    pub(super) fn output(&self) -> GpuOutput {
        let [pairs, outcome] =
            [BufferId::Pairs, BufferId::Outcome].map(|slot| self.buffers.get(slot).clone());
        let sorted = (self.plan.algorithm == Algorithm::CellList).then(|| CellOrder {
            order: self.buffers.get(self.plan.order()).clone(),
            spheres: self.buffers.get(BufferId::Sorted).clone(),
            species: self.buffers.find(BufferId::SortedSpecies).cloned(),
        });
        GpuOutput { pairs, capacity: self.plan.pairs, outcome, sorted }
    }

    /// Binds all dispatches of such a call, unless they are.
    pub(super) fn bind(
        &mut self,
        device: &wgpu::Device,
        pipelines: &Pipelines,
        key: Key,
        tables: Option<&Tables>,
    ) -> Result<(), Error> {
        let Self { plan, buffers, recordings } = self;
        recordings.get_or_insert_with(key, |key| {
            let call = constant_buffer(device, "call", bytemuck::bytes_of(&key.call))?;
            let passes = pass_buffers(device, &plan.digits())?;
            let species = tables.is_some();
            let variant = Variant { species, periodic: plan.periodic, ..pipelines.variant() };
            let dispatches = plan.dispatches.iter().cloned();
            Recording::new(device, pipelines, variant, dispatches, |dispatch, binding| {
                match (plan.resource(dispatch, binding), tables, &key.species) {
                    (Resource::Own(slot), ..) => buffers.get(slot),
                    (Resource::Spheres, ..) => &key.spheres,
                    (Resource::Count, ..) => key.count.as_ref().unwrap_or(&call),
                    (Resource::RadixPass(pass), ..) => &passes[pass as usize],
                    (Resource::Species, _, Some(species)) => species,
                    (Resource::Reach, Some(tables), _) => &tables.reach,
                    (Resource::Table, Some(tables), _) => &tables.table,
                    _ => &call,
                }
            })
        })
    }
}
