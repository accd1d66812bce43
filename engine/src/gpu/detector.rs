mod prepared;
mod room;
mod tables;
mod timer;

use lazygrid_kernels::kernel as k;
use lazygrid_kernels::layout::{Call, Outcome};
use lazygrid_kernels::{Algorithm, Interactions, Space};

pub(crate) use prepared::Key;
use prepared::Prepared;
use room::EntryRoom;
pub(crate) use room::Raised;
pub(crate) use tables::Tables;
use timer::Timer;

use super::input::{GpuConfig, GpuSpheres, check};
use super::pipelines::Pipelines;
use super::plan::{Cost, DeviceLimits, Plan, Request, most_entries, plan};
use super::recording::{Buffers, Recent, Recording};
use super::scope::scoped;
use crate::{Error, choice};

/// Finds overlapping pairs of spheres in GPU buffers and leaves them in GPU buffers.
///
/// [`encode`](Self::encode) records into the caller's encoder and neither submits nor polls. What a call found is
/// in the buffers of [`GpuPairs`]. Spheres that are not finite or have a negative radius pair with nothing and are
/// counted.
#[derive(Debug)]
pub struct GpuDetector {
    device: wgpu::Device,
    settings: GpuConfig,
    entry_room: EntryRoom,
    /// See [`Call::part_tiles`].
    part_tiles: u32,
    pipelines: Pipelines,
    tables: Option<Tables>,
    prepared: Option<Prepared>,
    timer: Option<Timer>,
}

/// The buffers that hold the result of a call.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct GpuPairs {
    /// The pairs as `[u32; 2]`, unordered, `i < j`; `STORAGE` and `COPY_SRC` usage.
    pub pairs: wgpu::Buffer,
    /// The capacity of the buffer in pairs.
    pub capacity: u32,
    /// The [`Outcome`]: how many pairs there are, and what did not fit; `STORAGE`, `INDIRECT` and `COPY_SRC` usage. A
    /// consumer with a thread per pair is dispatched from [`Outcome::DISPATCH_OFFSET`].
    pub outcome: wgpu::Buffer,
    /// The spheres in the order of the cells, where the call runs by the cell list.
    pub sorted: Option<GpuSorted>,
}

/// The spheres in the order of a cell list's cells: neighbours in space are mostly neighbours in memory. Who takes this
/// order over, every now and then, makes the next calls faster, which then read memory nearly in sequence; and with
/// [`GpuConfig::sorted_pairs`] its own work on pairs as well. All buffers have `STORAGE` and `COPY_SRC` usage, hold what a
/// call left until the next one, and have as many elements as the call had spheres.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct GpuSorted {
    /// The index that each had in the input, as `u32`: each once. Spheres that are not valid come last.
    pub order: wgpu::Buffer,
    /// `x, y, z, r` as four `f32` for each; in a periodic space the image nearest to the origin.
    pub spheres: wgpu::Buffer,
    /// The species of each as `u32`, where the settings have interactions.
    pub species: Option<wgpu::Buffer>,
}

/// The settings of one call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Way {
    pub(crate) algorithm: Algorithm,
    pub(crate) raster_ratio: f32,
}

impl GpuDetector {
    /// A detector on the caller's device. Kernels are compiled when first needed.
    ///
    /// # Errors
    /// [`Error::Setting`] and [`Error::NotOnBackend`] for settings; otherwise where the device refuses something.
    pub fn new(device: &wgpu::Device, settings: GpuConfig) -> Result<Self, Error> {
        Self::with_pipelines(device, Pipelines::new(device), settings)
    }

    pub(crate) fn with_pipelines(
        device: &wgpu::Device,
        pipelines: Pipelines,
        settings: GpuConfig,
    ) -> Result<Self, Error> {
        check(&settings)?;
        let tables = settings.interactions.as_ref().map(|table| Tables::new(device, table)).transpose()?;
        let timer = (settings.timed && device.features().contains(wgpu::Features::TIMESTAMP_QUERY))
            .then(|| scoped(device, "timestamps", 0, || Timer::new(device)))
            .transpose()?;
        Ok(Self {
            device: device.clone(),
            pipelines: if settings.subgroups { pipelines } else { pipelines.without_subgroups() },
            tables,
            prepared: None,
            timer,
            settings,
            entry_room: EntryRoom::NONE,
            part_tiles: Call::UNPARTED,
        })
    }

    /// Returns the cost of a call of up to `spheres` spheres, without making one.
    ///
    /// # Errors
    /// [`Error::LimitExceeded`] where the device cannot hold it.
    pub fn cost(&self, spheres: u32) -> Result<Cost, Error> {
        Ok(self.plan_for(spheres, self.way())?.cost())
    }

    /// Bytes of device memory for calls of up to `spheres` spheres, the output included and the input not.
    ///
    /// # Errors
    /// The same as [`cost`](Self::cost).
    pub fn memory_for(&self, spheres: u32) -> Result<u64, Error> {
        self.cost(spheres).map(|cost| cost.working_bytes + cost.pair_bytes)
    }

    /// Returns the algorithm of a call of up to `spheres` spheres, and the reason for it.
    pub fn choice(&self, spheres: u32) -> (Algorithm, String) {
        self.chosen(self.settings.algorithm, spheres)
    }

    fn chosen(&self, algorithm: Algorithm, spheres: u32) -> (Algorithm, String) {
        choice::algorithm(algorithm, (spheres, None, 1), (self.settings.crossover, "given"))
    }

    /// Changes the space, which must repeat along the same axes.
    pub(super) fn set_space(&mut self, space: Space) {
        debug_assert_eq!(
            self.settings.space.lengths().map(|l| l.is_some()),
            space.lengths().map(|l| l.is_some())
        );
        self.settings.space = space;
    }

    /// The settings of calls by the configuration.
    pub(crate) fn way(&self) -> Way {
        Way { algorithm: self.settings.algorithm, raster_ratio: self.settings.raster_ratio }
    }

    fn plan_for(&self, spheres: u32, way: Way) -> Result<Plan, Error> {
        let species = self.settings.interactions.as_ref().map_or(0, Interactions::species);
        let (pairs, (algorithm, _)) = (self.settings.pair_capacity, self.chosen(way.algorithm, spheres));
        let (entries, periodic) = (self.entry_room.of(spheres), self.settings.space.is_periodic());
        let radix_from = self.settings.radix_from;
        let request = Request { spheres, pairs, entries, algorithm, species, periodic, radix_from };
        plan(&request, &DeviceLimits::of(&self.device))
    }

    /// Allocates for calls of up to `spheres` spheres, unless that is there already. Buffers of an earlier, smaller
    /// size are released.
    ///
    /// # Errors
    /// [`Error::LimitExceeded`], [`Error::DeviceOutOfMemory`], or where the device is lost.
    pub fn reserve(&mut self, spheres: u32) -> Result<GpuPairs, Error> {
        let prepared = self.prepare(spheres, self.way())?;
        Ok(self.prepared.insert(prepared).output())
    }

    /// Returns the buffers if their capacity suffices, else new ones.
    fn prepare(&mut self, spheres: u32, way: Way) -> Result<Prepared, Error> {
        let plan = self.plan_for(spheres, way)?;
        // Released first, so that old and new need not fit side by side. Buffers for more spheres serve fewer: those of a
        // grid also all pairs.
        let kept = self.prepared.take().filter(|prepared| prepared.buffers.have_room_for(&plan.buffers));
        if let Some(prepared) = kept {
            return Ok(Prepared { plan, ..prepared });
        }
        let buffers = Buffers::allocate(&self.device, &plan.buffers)?;
        Ok(Prepared { plan, buffers, recordings: Recent::NONE })
    }

    pub(crate) fn settings(&self) -> &GpuConfig {
        &self.settings
    }

    /// The capacity of the next call's output in pairs.
    pub fn pair_capacity(&self) -> u32 {
        self.settings.pair_capacity
    }

    /// Returns `true` if calls need species ids.
    pub fn has_interactions(&self) -> bool {
        self.tables.is_some()
    }

    /// Changes how many pairs the output holds; the output is allocated anew by the next call.
    pub fn set_pair_capacity(&mut self, pairs: u32) {
        self.settings.pair_capacity = pairs;
    }

    /// Raises the capacity to at least this number of (cell, object) entries, as [`Outcome::entries`] tells after a call that had
    /// too little, and for some more; the next call allocates anew. Calls of less than half
    /// as many spheres do without. False where the device cannot hold them.
    pub fn set_entry_capacity(&mut self, entries: u64) -> bool {
        let spheres = self.plan().map_or(0, |plan| plan.spheres);
        self.raise_entries(entries, spheres)
    }

    /// The same as [`set_entry_capacity`](Self::set_entry_capacity), for a call of `spheres` spheres.
    pub(crate) fn raise_entries(&mut self, entries: u64, spheres: u32) -> bool {
        let most = most_entries(&DeviceLimits::of(&self.device));
        if entries > most {
            return false;
        }
        // Below 2³⁰, the most that there are anywhere.
        self.entry_room.0[EntryRoom::digits(spheres)] = (entries + entries / 8).min(most) as u32;
        true
    }

    /// The capacities that [`set_room`](Self::set_room) restores.
    pub(crate) fn room(&self) -> Raised {
        Raised { entries: self.entry_room, pairs: self.settings.pair_capacity }
    }

    pub(crate) fn set_room(&mut self, room: Raised) {
        self.entry_room = room.entries;
        self.settings.pair_capacity = room.pairs;
    }

    /// Has later calls end before their crowded search is done, where it is more than so many distance tests:
    /// [`encode_rest`](Self::encode_rest) records a further part while the outcome is partial.
    pub(crate) fn set_part_tests(&mut self, tests: u64) {
        let tile = u64::from(k::GROUP) * u64::from(k::GROUP);
        self.part_tiles = u32::try_from(tests / tile).unwrap_or(Call::UNPARTED);
    }

    /// Records a further part of the last recorded call, whose search it is timed as.
    pub(crate) fn encode_rest(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(recording) = self.recording() {
            recording.encode_rest(encoder, self.timer.as_ref().map(Timer::queries));
            if let Some(timer) = &self.timer {
                timer.resolve(encoder);
            }
        }
    }

    /// Changes the cell edge; see [`GpuConfig::raster_ratio`].
    ///
    /// # Errors
    /// [`Error::Setting`] where it is out of range.
    pub fn set_raster_ratio(&mut self, ratio: f32) -> Result<(), Error> {
        let before = std::mem::replace(&mut self.settings.raster_ratio, ratio);
        check(&self.settings).inspect_err(|_| self.settings.raster_ratio = before)
    }

    /// Records the detection, all of it in this encoder however crowded the spheres are: where a submission must end
    /// within a watchdog's time, [`GpuSession`](super::GpuSession) splits it. Nothing is submitted, polled or read
    /// back; after the first call of a size nothing of that size is allocated. The buffers that come back are those of
    /// the call before, unless this one is larger.
    ///
    /// # Errors
    /// [`Error::Buffer`] and [`Error::SpeciesBuffer`] for what was handed over, and as [`reserve`](Self::reserve).
    pub fn encode(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        input: &GpuSpheres<'_>,
    ) -> Result<GpuPairs, Error> {
        self.encode_as(self.way(), encoder, input)
    }

    /// The same as [`encode`](Self::encode), with other settings of the call.
    pub(crate) fn encode_as(
        &mut self,
        way: Way,
        encoder: &mut wgpu::CommandEncoder,
        input: &GpuSpheres<'_>,
    ) -> Result<GpuPairs, Error> {
        let output = self.bind_as(way, input)?;
        if let Some(recording) = self.recording() {
            match &self.timer {
                None => recording.encode(encoder),
                Some(timer) => {
                    recording.encode_timed(encoder, timer.queries());
                    timer.resolve(encoder);
                }
            }
        }
        Ok(output)
    }

    /// Binds all that a call dispatches, and encodes nothing.
    pub(crate) fn bind_as(&mut self, way: Way, input: &GpuSpheres<'_>) -> Result<GpuPairs, Error> {
        let spheres = input.check(self.tables.is_some())?;
        let mut prepared = self.prepare(spheres, way)?;
        let bound = self.bind(&mut prepared, way, input);
        let output = self.prepared.insert(prepared).output();
        bound.map(|()| output)
    }

    /// The last bindings.
    pub(crate) fn recording(&self) -> Option<&Recording> {
        self.prepared.as_ref().and_then(|prepared| prepared.recordings.current())
    }

    /// The plan of the last recorded call.
    pub(crate) fn plan(&self) -> Option<&Plan> {
        self.prepared.as_ref().map(|p| &p.plan)
    }

    /// The result buffers of the last recorded call.
    pub(crate) fn output(&self) -> Option<GpuPairs> {
        self.prepared.as_ref().map(Prepared::output)
    }

    /// The ticks at either end of each phase (`u64`, in the order of [`Phase::ALL`](super::Phase::ALL)); `None` where calls
    /// are not timed.
    pub fn ticks(&self) -> Option<&wgpu::Buffer> {
        self.timer.as_ref().map(Timer::ticks)
    }

    /// The parameters of a call that the kernels read.
    fn call(&self, plan: &Plan, way: Way, input: &GpuSpheres<'_>) -> Call {
        let sides = self.tables.as_ref().map(|tables| &tables.sides);
        let (meetings, interaction) = if input.split == 0 {
            sides.map_or((Call::FIRST_WITH_ITSELF, Call::TOUCH), |sides| (sides.meetings, sides.interaction))
        } else {
            (Call::FIRST_WITH_SECOND, sides.map_or(Call::TOUCH, |sides| sides.across_sets))
        };
        Call {
            meetings,
            interaction,
            entry_capacity: plan.entries,
            key_bits: plan.key_bits,
            raster_ratio: way.raster_ratio,
            search_groups: plan.search_groups,
            refinement: plan.refinement as u32,
            density_slots: plan.density_slots,
            part_tiles: self.part_tiles,
            cells: plan.cells,
            counters: if plan.tile == 0 { plan.counters } else { 0 },
            tile: plan.tile,
            share: plan.share,
            further_shares: plan.further_shares,
            ..self.settings.call(plan.spheres, input)
        }
    }

    fn bind(&self, prepared: &mut Prepared, way: Way, input: &GpuSpheres<'_>) -> Result<(), Error> {
        let key = Key::of(input, self.call(&prepared.plan, way, input));
        prepared.bind(&self.device, &self.pipelines, key, self.tables.as_ref())
    }
}

/// Reads the outcome of a call from a copy of the outcome buffer.
///
/// # Errors
/// [`Error::Buffer`] if there are too few bytes.
pub fn read_outcome(bytes: &[u8]) -> Result<Outcome, Error> {
    let needed = size_of::<Outcome>();
    match bytes.get(..needed) {
        Some(bytes) => Ok(bytemuck::pod_read_unaligned(bytes)),
        None => {
            let (size, needed) = (bytes.len() as u64, needed as u64);
            Err(Error::Buffer { what: "outcome", size, needed, usage: "" })
        }
    }
}

#[cfg(test)]
mod tests;
