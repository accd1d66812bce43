use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use lazygrid_kernels::Algorithm;
use lazygrid_kernels::layout::SearchParams;

use super::LayoutSource;
use super::input::BoundInput;
use super::output::{CellOrder, GpuOutput};
use super::tables::Tables;
use crate::Error;
use crate::gpu::device::{Pipelines, constant_buffer};
use crate::gpu::encode::{BoundBuffer, Buffers, Recording, SmallCache};
use crate::gpu::plan::{BufferId, CallConstants, DeviceLimits, Dispatch, Plan, Resource};

#[derive(Debug)]
pub(super) struct PreparedCall {
    pub(super) plan: Arc<Plan>,
    pub(super) buffers: Buffers,
    pub(super) recordings: SmallCache<Key, Recording>,
    /// Parameters of the submitted call that chose the cells.
    layout: Option<SearchParams>,
    bound: SearchParams,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Key {
    pub(crate) input: BoundInput,
    pub(crate) call: SearchParams,
    pub(crate) reuses_layout: bool,
}

impl PreparedCall {
    pub(super) fn new(plan: Plan, buffers: Buffers) -> Self {
        let bound = SearchParams::default();
        Self { plan: Arc::new(plan), buffers, recordings: SmallCache::NONE, layout: None, bound }
    }

    /// Reuses the cells in the buffers if they were chosen for equal parameters. The device then checks them.
    pub(super) fn set_call(&mut self, call: SearchParams, source: LayoutSource) {
        let may_reuse = source == LayoutSource::EarlierCall && call.spheres > 0;
        if may_reuse && self.layout == Some(layout_params(&call)) {
            Arc::make_mut(&mut self.plan).reuse_layout();
        } else {
            self.layout = None;
        }
        self.bound = call;
    }

    pub(super) fn note_submitted(&mut self) {
        let chose = self.plan.algorithm == Algorithm::CellList;
        self.layout = chose.then(|| layout_params(&self.bound));
    }

    pub(super) fn output(&self) -> GpuOutput {
        let [pairs, outcome] = [BufferId::Pairs, BufferId::Outcome].map(|id| self.buffers.get(id).clone());
        let sorted = (self.plan.algorithm == Algorithm::CellList).then(|| CellOrder {
            order: self.buffers.get(self.plan.order()).clone(),
            spheres: self.buffers.get(BufferId::Sorted).clone(),
            species: self.buffers.find(BufferId::SortedSpecies).cloned(),
        });
        GpuOutput { pairs, capacity: self.plan.pairs, outcome, sorted }
    }

    pub(super) fn bind(
        &mut self,
        device: &wgpu::Device,
        pipelines: &Pipelines,
        key: Key,
        tables: Option<&Tables>,
    ) -> Result<(), Error> {
        let Self { plan, buffers, recordings, .. } = self;
        recordings.get_or_insert_with(key, |key| {
            let constants = CallConstants {
                call: key.call,
                count_in_buffer: key.input.count.is_some(),
                tables: tables.map(|tables| &tables.bytes),
            };
            let call_plan =
                plan.call_plan(&constants, pipelines.variant(), &DeviceLimits::from_device(device));
            let bound = call_plan.buffers.iter().map(|buffer| {
                Ok(match (buffer.resource, tables, &key.input.species, &key.input.count) {
                    (Resource::Own(id), ..) => buffers.get(id).into(),
                    (Resource::Spheres, ..) => key.input.spheres[0].clone(),
                    (Resource::Column(column), ..) => key.input.spheres[column].clone(),
                    (Resource::Species, _, Some(species), _) => species.clone(),
                    (Resource::Count, _, _, Some(count)) => count.clone(),
                    (Resource::SpeciesParams, Some(tables), ..) => (&tables.species_params).into(),
                    (Resource::SpeciesParamsBySide, Some(tables), ..) => {
                        (&tables.species_params_by_side).into()
                    }
                    (Resource::Table, Some(tables), ..) => (&tables.table).into(),
                    _ => (&constant_buffer(device, "a constant of a call", buffer.constant())?).into(),
                })
            });
            let bound = bound.collect::<Result<Vec<BoundBuffer>, Error>>()?;
            let recording = Recording::from_sequence(device, pipelines, &call_plan.sequence, &bound)?;
            Ok(match plan.cleared_bytes() {
                0 => recording,
                bytes => recording.clearing(buffers.get(BufferId::Starts), bytes),
            })
        })
    }
}

fn layout_params(call: &SearchParams) -> SearchParams {
    SearchParams { window_begin: 0, window_end: 0, pair_capacity: 0, ..*call }
}

pub(super) fn params_buffers<'a>(
    device: &wgpu::Device,
    dispatches: impl IntoIterator<Item = &'a Dispatch>,
    call: &SearchParams,
) -> Result<HashMap<u32, wgpu::Buffer>, Error> {
    let firsts: BTreeSet<u32> =
        dispatches.into_iter().map(|dispatch| dispatch.first_group).chain([0]).collect();
    let buffer = |first_workgroup: u32| {
        let params = SearchParams { first_workgroup, ..*call };
        Ok((first_workgroup, constant_buffer(device, "call", bytemuck::bytes_of(&params))?))
    };
    firsts.into_iter().map(buffer).collect()
}
