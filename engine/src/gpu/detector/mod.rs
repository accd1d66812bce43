mod capacity;
mod input;
mod output;
mod prepared;
mod skin_detector;
mod tables;
mod timer;

use std::sync::Arc;

use lazygrid_kernels::layout::Outcome;
use lazygrid_kernels::{Algorithm, Space};

pub(crate) use capacity::CapacitySnapshot;
use capacity::EntryCapacity;
pub use input::{BufferRange, GpuSpheres, SphereCount};
pub use output::{CellOrder, GpuOutput, read_outcome};
use prepared::{Key, PreparedCall};
pub use skin_detector::GpuSkinDetector;
pub(crate) use skin_detector::displacement_fraction;
use tables::Tables;
use timer::Timer;

use super::config::{GpuConfig, check};
use super::costs::Calibration;
use super::device::{Pipelines, with_error_scope};
use super::encode::{Buffers, Recording, SmallCache};
use super::plan::{
    CallCost, CallSettings, DeviceLimits, Plan, Request, WorkBudget, most_entries, plan, tests_within_limit,
};
use crate::Error;

/// Finds overlapping pairs of spheres in GPU buffers.
///
/// Invalid spheres (non-finite value or negative radius) are counted and never pair.
#[derive(Debug)]
pub struct GpuDetector {
    device: wgpu::Device,
    settings: GpuConfig,
    entry_capacity: EntryCapacity,
    pipelines: Pipelines,
    tables: Option<Tables>,
    prepared: Option<PreparedCall>,
    timer: Option<Timer>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AlgorithmChoice {
    pub(crate) algorithm: Algorithm,
    pub(crate) cell_ratio: f32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LayoutSource {
    ThisCall,
    /// The last submitted call if it had equal parameters, otherwise statistics.
    EarlierCall,
}

impl GpuDetector {
    /// Creates a detector on the caller's device. Kernels are compiled on first use, with subgroup operations only if
    /// [`GpuDevice::from_wgpu`](crate::gpu::GpuDevice::from_wgpu) has probed the adapter.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`] and [`Error::NotOnBackend`] for settings, or an error of the device.
    pub fn new(device: &wgpu::Device, settings: GpuConfig) -> Result<Self, Error> {
        Self::with_pipelines(device, Pipelines::new(device), settings)
    }

    pub(crate) fn with_pipelines(
        device: &wgpu::Device,
        pipelines: Pipelines,
        settings: GpuConfig,
    ) -> Result<Self, Error> {
        check(&settings)?;
        let tables = Tables::new(device, &settings)?;
        let timer = (settings.timestamps && device.features().contains(wgpu::Features::TIMESTAMP_QUERY))
            .then(|| with_error_scope(device, "timestamps", 0, || Timer::new(device)))
            .transpose()?;
        let max_tests = settings.max_tests_per_dispatch.unwrap_or_else(|| {
            let kind = device.adapter_info().device_type;
            let is_integrated = kind == wgpu::DeviceType::IntegratedGpu;
            tests_within_limit(Calibration::assumed_tests_per_second(
                kind != wgpu::DeviceType::Cpu,
                is_integrated,
            ))
        });
        let settings = settings.max_tests_per_dispatch(max_tests);
        Ok(Self {
            device: device.clone(),
            pipelines: if settings.subgroups { pipelines } else { pipelines.without_subgroups() },
            tables,
            prepared: None,
            timer,
            settings,
            entry_capacity: EntryCapacity::NONE,
        })
    }

    /// Returns the cost of a call of up to `spheres` spheres.
    ///
    /// # Errors
    /// [`Error::LimitExceeded`] if the device cannot hold it.
    pub fn cost(&self, spheres: u32) -> Result<CallCost, Error> {
        Ok(self.plan_for(spheres, self.algorithm_choice())?.cost())
    }

    /// Returns the bytes of device memory for calls of up to `spheres` spheres, with output, without input.
    ///
    /// # Errors
    /// See [`cost`](Self::cost).
    pub fn memory_for(&self, spheres: u32) -> Result<u64, Error> {
        self.cost(spheres).map(|cost| cost.working_bytes + cost.pair_bytes)
    }

    /// Returns the algorithm for `spheres` spheres, and the reason.
    pub fn choice(&self, spheres: u32) -> (Algorithm, String) {
        self.settings.chosen(self.settings.algorithm, spheres)
    }

    pub(crate) fn set_space(&mut self, space: Space) {
        debug_assert_eq!(
            self.settings.space.lengths().map(|l| l.is_some()),
            space.lengths().map(|l| l.is_some())
        );
        self.settings.space = space;
    }

    pub(crate) fn algorithm_choice(&self) -> AlgorithmChoice {
        AlgorithmChoice { algorithm: self.settings.algorithm, cell_ratio: self.settings.cell_ratio }
    }

    fn plan_for(&self, spheres: u32, choice: AlgorithmChoice) -> Result<Plan, Error> {
        let (algorithm, _) = self.settings.chosen(choice.algorithm, spheres);
        let request =
            Request::new(&self.settings, algorithm, spheres, self.entry_capacity.for_spheres(spheres));
        plan(&request, &DeviceLimits::from_device(&self.device))
    }

    /// Allocates buffers for calls of up to `spheres` spheres, and releases smaller ones.
    ///
    /// # Errors
    /// [`Error::LimitExceeded`], [`Error::DeviceOutOfMemory`] and [`Error::DeviceLost`].
    pub fn reserve(&mut self, spheres: u32) -> Result<GpuOutput, Error> {
        let prepared = self.prepare(spheres, self.algorithm_choice())?;
        Ok(self.prepared.insert(prepared).output())
    }

    fn prepare(&mut self, spheres: u32, choice: AlgorithmChoice) -> Result<PreparedCall, Error> {
        let plan = self.plan_for(spheres, choice)?;
        // Releasing old buffers first avoids holding both.
        let reusable =
            self.prepared.take().filter(|prepared| prepared.buffers.have_capacity_for(&plan.buffers));
        if let Some(mut prepared) = reusable {
            if prepared.plan.deferred_parts != plan.deferred_parts {
                prepared.recordings = SmallCache::NONE;
            }
            prepared.plan = Arc::new(plan);
            return Ok(prepared);
        }
        let buffers = Buffers::allocate(&self.device, &plan.buffers)?;
        Ok(PreparedCall::new(plan, buffers))
    }

    pub(crate) fn settings(&self) -> &GpuConfig {
        &self.settings
    }

    /// Returns the pair capacity of the next output.
    pub fn pair_capacity(&self) -> u32 {
        self.settings.pair_capacity
    }

    /// Returns `true` if calls need species ids.
    pub fn has_interactions(&self) -> bool {
        self.tables.is_some()
    }

    /// Changes the pair capacity; the next call allocates a new output.
    pub fn set_pair_capacity(&mut self, pairs: u32) {
        self.settings.pair_capacity = pairs;
    }

    /// Raises the capacity to `entries` (cell, sphere) entries, such as [`Outcome::entries_needed`], but not that of
    /// calls of less than half as many spheres. Returns `false` if the device cannot hold them.
    pub fn set_entry_capacity(&mut self, entries: u64) -> bool {
        let spheres = self.plan().map_or(0, |plan| plan.spheres);
        self.raise_entry_capacity(entries, spheres)
    }

    pub(crate) fn raise_entry_capacity(&mut self, entries: u64, spheres: u32) -> bool {
        let most = self.most_entries();
        if entries > most {
            return false;
        }
        let capacity = &mut self.entry_capacity.0[EntryCapacity::digits(spheres)];
        *capacity = (*capacity).max((entries + entries / 8).min(most) as u32);
        true
    }

    pub(crate) fn most_entries(&self) -> u64 {
        most_entries(&DeviceLimits::from_device(&self.device))
    }

    pub(crate) fn capacities(&self) -> CapacitySnapshot {
        let GpuConfig { pair_capacity: pairs, deferred_parts, .. } = self.settings;
        CapacitySnapshot { entries: self.entry_capacity, pairs, deferred_parts }
    }

    pub(crate) fn restore_capacities(&mut self, before: CapacitySnapshot) {
        self.entry_capacity = before.entries;
        self.settings.pair_capacity = before.pairs;
        self.settings.deferred_parts = before.deferred_parts;
    }

    /// Sets [`GpuConfig::deferred_parts`].
    pub fn set_deferred_parts(&mut self, parts: u32) {
        self.settings.deferred_parts = parts;
    }

    /// Returns the parts that the search of crowded cells needs, by the last call's outcome.
    pub fn needed_deferred_parts(&self, outcome: &Outcome) -> u32 {
        self.plan().map_or(1, |plan| plan.deferred_parts_for(outcome)).max(1)
    }

    /// Records a further part of the last call, for an outcome with [`Outcome::has_remaining_work`]. Pairs accumulate
    /// in the output; the search time is replaced.
    pub fn encode_continuation(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(recording) = self.recording() {
            recording.encode_continuation(encoder, self.timer.as_ref().map(Timer::queries));
            if let Some(timer) = &self.timer {
                timer.resolve(encoder);
            }
        }
    }

    /// Sets [`GpuConfig::cell_ratio`].
    ///
    /// # Errors
    /// [`Error::InvalidSetting`] if `ratio` is out of range.
    pub fn set_cell_ratio(&mut self, ratio: f32) -> Result<(), Error> {
        let before = std::mem::replace(&mut self.settings.cell_ratio, ratio);
        check(&self.settings).inspect_err(|_| self.settings.cell_ratio = before)
    }

    /// Records the detection without submit, poll or readback. Returns the previous buffers, unless the call is larger
    /// than all before.
    ///
    /// # Errors
    /// [`Error::BufferSize`], [`Error::BufferUsage`] and [`Error::SpeciesBuffer`] for the input; otherwise as
    /// [`reserve`](Self::reserve).
    pub fn encode(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        input: &GpuSpheres<'_>,
    ) -> Result<GpuOutput, Error> {
        let output = self.bind(input)?;
        (0..self.parts()).for_each(|part| self.encode_part(encoder, part));
        Ok(output)
    }

    /// Binds a call. [`encode_part`](Self::encode_part) records its parts, in one encoder or in several that are
    /// submitted in sequence.
    ///
    /// # Errors
    /// See [`encode`](Self::encode).
    pub fn bind(&mut self, input: &GpuSpheres<'_>) -> Result<GpuOutput, Error> {
        self.bind_as(self.algorithm_choice(), input, LayoutSource::ThisCall)
    }

    /// Returns the number of parts of the bound call; 0 before the first call.
    pub fn parts(&self) -> u32 {
        self.recording().map_or(0, Recording::parts)
    }

    /// Records part `part` of the bound call, below [`parts`](Self::parts). Parts must run in ascending order.
    pub fn encode_part(&self, encoder: &mut wgpu::CommandEncoder, part: u32) {
        if let Some(recording) = self.recording() {
            recording.encode_part(encoder, part, self.timer.as_ref().map(Timer::queries));
            if let Some(timer) = self.timer.as_ref().filter(|_| part + 1 == recording.parts()) {
                timer.resolve(encoder);
            }
        }
    }

    /// Returns the kernel of each dispatch of the bound call, in execution order.
    pub fn kernels(&self) -> Vec<&'static str> {
        self.recording().map_or(vec![], |recording| recording.kernels().collect())
    }

    /// Records the bound call with a timestamp before each of its [`kernels`](Self::kernels) and after the last.
    /// Adjacent kernels may overlap, so single times are less exact than their sum.
    ///
    /// `queries` must have capacity for one timestamp more than kernels, and the device
    /// [`TIMESTAMP_QUERY_INSIDE_PASSES`](wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES).
    pub fn encode_stamped(&self, encoder: &mut wgpu::CommandEncoder, queries: &wgpu::QuerySet) {
        if let Some(recording) = self.recording() {
            recording.encode_stamped(encoder, queries);
        }
    }

    pub(crate) fn bind_as(
        &mut self,
        choice: AlgorithmChoice,
        input: &GpuSpheres<'_>,
        source: LayoutSource,
    ) -> Result<GpuOutput, Error> {
        let spheres = input.check(&self.settings, &self.device)?;
        let mut prepared = self.prepare(spheres, choice)?;
        let bound = self.bind_prepared(&mut prepared, choice, source, input);
        let output = self.prepared.insert(prepared).output();
        bound.map(|()| output)
    }

    /// Returns `true` if the outcome may have [`Outcome::OVERFLOW_LAYOUT`].
    pub(crate) fn reuses_layout(&self) -> bool {
        self.plan().is_some_and(|plan| plan.reuses_layout)
    }

    pub(crate) fn note_submitted(&mut self) {
        if let Some(prepared) = &mut self.prepared {
            prepared.note_submitted();
        }
    }

    pub(crate) fn recording(&self) -> Option<&Recording> {
        self.prepared.as_ref().and_then(|prepared| prepared.recordings.current())
    }

    pub(crate) fn budget(&self) -> WorkBudget {
        WorkBudget::new(&self.settings, &DeviceLimits::from_device(&self.device))
    }

    pub(crate) fn plan(&self) -> Option<&Arc<Plan>> {
        self.prepared.as_ref().map(|p| &p.plan)
    }

    /// Returns the begin and end ticks per phase (`u64`, ordered as [`GpuPhase::ALL`](super::GpuPhase::ALL)); `None`
    /// without timestamps.
    pub fn ticks(&self) -> Option<&wgpu::Buffer> {
        self.timer.as_ref().map(Timer::ticks)
    }

    fn bind_prepared(
        &self,
        prepared: &mut PreparedCall,
        choice: AlgorithmChoice,
        source: LayoutSource,
        input: &GpuSpheres<'_>,
    ) -> Result<(), Error> {
        let (window, split) = input.search();
        let settings = CallSettings {
            config: &self.settings,
            cell_ratio: choice.cell_ratio,
            window,
            split,
            sides: self.tables.as_ref().map(|tables| &tables.bytes.sides),
        };
        let call = prepared.plan.call(&settings);
        prepared.set_call(call, source);
        let input = input.bound(call.spheres, self.settings.columns.as_ref())?;
        let key = Key { input, call, reuses_layout: prepared.plan.reuses_layout };
        prepared.bind(&self.device, &self.pipelines, key, self.tables.as_ref())
    }
}

#[cfg(test)]
mod tests;
