mod tables;
mod timer;

use std::collections::VecDeque;

use lazygrid_kernels::kernel::{self as k, Variant};
use lazygrid_kernels::layout::{Call, Outcome};
use lazygrid_kernels::{Algorithm, Interactions};

use tables::Tables;
use timer::Timer;

use super::GpuError;
use super::input::{Count, GpuSettings, GpuSpheres, check, check_buffer};
use super::pipelines::Pipelines;
use super::plan::{DeviceLimits, Plan, Request, Resource, Slot, most_entries, plan};
use super::primitives::pass_buffers;
use super::recording::{Buffers, Recording, constant_buffer};
use super::scope::scoped;
use crate::choice;

/// Recordings kept for callers that alternate between a few buffers.
const KEPT_RECORDINGS: usize = 4;

/// Finds overlapping pairs of spheres in GPU buffers and leaves them in GPU buffers.
///
/// [`encode`](Self::encode) records into the caller's encoder and neither submits nor polls. What a call found is
/// in [`outcome`](Self::outcome) (laid out as [`Outcome`]) and [`pairs`](Self::pairs) (unordered, `i < j`). Spheres
/// that are not finite or have a negative radius pair with nothing and are counted.
#[derive(Debug)]
pub struct GpuDetector {
    device: wgpu::Device,
    settings: GpuSettings,
    entry_room: EntryRoom,
    /// See [`Call::part_tiles`].
    part_tiles: u32,
    pipelines: Pipelines,
    tables: Option<Tables>,
    prepared: Option<Prepared>,
    timer: Option<Timer>,
}

/// Entries there is to be room for at least, by the binary digits of the spheres of the call that needed them: in
/// calls of as many digits or more.
#[derive(Clone, Copy, Debug)]
struct EntryRoom([u32; u32::BITS as usize + 1]);

impl EntryRoom {
    const NONE: Self = Self([0; u32::BITS as usize + 1]);

    fn digits(spheres: u32) -> usize {
        (u32::BITS - spheres.leading_zeros()) as usize
    }

    fn of(&self, spheres: u32) -> u32 {
        self.0[..=Self::digits(spheres)].iter().copied().max().unwrap_or_default()
    }
}

/// What was raised for calls that needed more, to be restored where the device has not so much.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Raised {
    entries: EntryRoom,
    pairs: u32,
}

/// Everything that depends on the size of a call.
#[derive(Debug)]
struct Prepared {
    plan: Plan,
    buffers: Buffers,
    recordings: VecDeque<(Key, Recording)>,
    /// The one that was used last.
    current: usize,
}

/// What a recording was made for.
#[derive(Clone, Debug, PartialEq)]
struct Key {
    spheres: wgpu::Buffer,
    species: Option<wgpu::Buffer>,
    count: Option<wgpu::Buffer>,
    call: Call,
}

impl GpuDetector {
    /// A detector on the caller's device. Kernels are compiled when first needed.
    ///
    /// # Errors
    /// [`Error::Setting`](crate::Error::Setting) and [`Error::NotOnBackend`](crate::Error::NotOnBackend) for settings; otherwise where the device refuses something.
    pub fn new(device: &wgpu::Device, settings: GpuSettings) -> Result<Self, GpuError> {
        Self::with_pipelines(device, Pipelines::new(device), settings)
    }

    pub(crate) fn with_pipelines(
        device: &wgpu::Device,
        pipelines: Pipelines,
        settings: GpuSettings,
    ) -> Result<Self, GpuError> {
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

    /// Bytes of device memory for calls of up to `spheres` spheres, the output included and the input not.
    ///
    /// # Errors
    /// [`Error::LimitExceeded`](crate::Error::LimitExceeded) where the device cannot hold it.
    pub fn memory_for(&self, spheres: u32) -> Result<u64, GpuError> {
        Ok(self.plan_for(spheres)?.bytes())
    }

    /// What a call of up to `spheres` spheres would use, and why.
    pub fn choice(&self, spheres: u32) -> (Algorithm, String) {
        choice::algorithm(self.settings.algorithm, (spheres, 1), (self.settings.crossover, "given"))
    }

    /// What a call of up to `spheres` spheres would do.
    ///
    /// # Errors
    /// As [`memory_for`](Self::memory_for).
    pub fn plan_for(&self, spheres: u32) -> Result<Plan, GpuError> {
        let species = self.settings.interactions.as_ref().map_or(0, Interactions::species);
        let (pairs, (algorithm, _)) = (self.settings.pair_capacity, self.choice(spheres));
        let (entries, periodic) = (self.entry_room.of(spheres), self.settings.space.is_periodic());
        let radix_from = self.settings.radix_from;
        let request = Request { spheres, pairs, entries, algorithm, species, periodic, radix_from };
        plan(&request, &DeviceLimits::of(&self.device))
    }

    /// Allocates for calls of up to `spheres` spheres, unless that is there already. Buffers of an earlier, smaller
    /// size are released.
    ///
    /// # Errors
    /// [`Error::LimitExceeded`](crate::Error::LimitExceeded), [`Error::DeviceOutOfMemory`](crate::Error::DeviceOutOfMemory), or where the device is lost.
    pub fn reserve(&mut self, spheres: u32) -> Result<(), GpuError> {
        let wanted = self.plan_for(spheres)?;
        // Buffers for more spheres serve fewer: those of a grid also all pairs.
        match &mut self.prepared {
            Some(prepared) if prepared.buffers.have_room_for(&wanted.buffers) => prepared.plan = wanted,
            _ => {
                // Released first, so that old and new need not fit side by side.
                self.prepared = None;
                let buffers = Buffers::allocate(&self.device, &wanted.buffers)?;
                self.prepared =
                    Some(Prepared { plan: wanted, buffers, recordings: VecDeque::new(), current: 0 });
            }
        }
        Ok(())
    }

    /// How many pairs the output of the next call holds.
    pub fn pair_capacity(&self) -> u32 {
        self.settings.pair_capacity
    }

    /// Whether calls need species ids.
    pub fn has_interactions(&self) -> bool {
        self.tables.is_some()
    }

    /// Changes how many pairs the output holds; the output is allocated anew by the next call.
    pub fn set_pair_capacity(&mut self, pairs: u32) {
        self.settings.pair_capacity = pairs;
    }

    /// Makes room for at least so many (cell, object) entries, as [`Outcome::entries`] tells after a call that had
    /// too little, and for some more; the next call allocates anew. Calls of less than half
    /// as many spheres do without. False where the device cannot hold them.
    pub fn set_entry_capacity(&mut self, entries: u64) -> bool {
        let spheres = self.plan().map_or(0, |plan| plan.spheres);
        self.raise_entries(entries, spheres)
    }

    /// As [`set_entry_capacity`](Self::set_entry_capacity), for a call of so many spheres.
    pub(crate) fn raise_entries(&mut self, entries: u64, spheres: u32) -> bool {
        let most = most_entries(&DeviceLimits::of(&self.device));
        if entries > most {
            return false;
        }
        // Below 2³⁰, the most that there are anywhere.
        self.entry_room.0[EntryRoom::digits(spheres)] = (entries + entries / 8).min(most) as u32;
        true
    }

    /// What [`set_room`](Self::set_room) restores.
    pub(crate) fn room(&self) -> Raised {
        Raised { entries: self.entry_room, pairs: self.settings.pair_capacity }
    }

    pub(crate) fn set_room(&mut self, room: Raised) {
        self.entry_room = room.entries;
        self.settings.pair_capacity = room.pairs;
    }

    /// Changes which algorithm later calls use; see [`GpuSettings::algorithm`].
    ///
    /// # Errors
    /// [`Error::NotOnBackend`](crate::Error::NotOnBackend) for one without kernels.
    pub fn set_algorithm(&mut self, algorithm: Algorithm) -> Result<(), GpuError> {
        let before = std::mem::replace(&mut self.settings.algorithm, algorithm);
        check(&self.settings).inspect_err(|_| self.settings.algorithm = before)
    }

    /// Has later calls end before their crowded search is done, where it is more than so many distance tests:
    /// [`encode_rest`](Self::encode_rest) records a further part while the outcome is partial.
    pub(crate) fn set_part_tests(&mut self, tests: u64) {
        let tile = u64::from(k::GROUP) * u64::from(k::GROUP);
        self.part_tiles = u32::try_from(tests / tile).unwrap_or(Call::UNPARTED);
    }

    /// Records a further part of the last recorded call, whose search it is timed as.
    pub(crate) fn encode_rest(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(prepared) = &self.prepared {
            let recording = &prepared.recordings[prepared.current].1;
            recording.encode_rest(encoder, self.timer.as_ref().map(Timer::queries));
            if let Some(timer) = &self.timer {
                timer.resolve(encoder);
            }
        }
    }

    /// Changes the cell edge; see [`GpuSettings::raster_ratio`].
    ///
    /// # Errors
    /// [`Error::Setting`](crate::Error::Setting) where it is out of range.
    pub fn set_raster_ratio(&mut self, ratio: f32) -> Result<(), GpuError> {
        let before = std::mem::replace(&mut self.settings.raster_ratio, ratio);
        check(&self.settings).inspect_err(|_| self.settings.raster_ratio = before)
    }

    /// Records the detection, all of it in this encoder however crowded the spheres are: where a submission must end
    /// within a watchdog's time, [`GpuSession`](super::GpuSession) splits it. Nothing is submitted, polled or read
    /// back; after the first call of a size nothing of that size is allocated. With a larger size than before, buffers
    /// are replaced: take [`pairs`](Self::pairs) and [`outcome`](Self::outcome) after the call, or
    /// [`reserve`](Self::reserve) first.
    ///
    /// # Errors
    /// [`Error::Buffer`](crate::Error::Buffer) and [`Error::SpeciesBuffer`](crate::Error::SpeciesBuffer) for what was handed over, and as [`reserve`](Self::reserve).
    pub fn encode(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        input: &GpuSpheres<'_>,
    ) -> Result<(), GpuError> {
        let spheres = match input.count {
            Count::Host(count) => count,
            Count::Buffer { buffer, at_most } => {
                check_buffer("count", buffer, 4)?;
                at_most
            }
        };
        check_buffer("spheres", input.spheres, u64::from(spheres.max(1)) * 16)?;
        if let Some(species) = input.species {
            check_buffer("species", species, u64::from(spheres.max(1)) * 4)?;
        }
        if input.species.is_some() != self.tables.is_some() {
            return Err(GpuError::SpeciesBuffer);
        }
        self.reserve(spheres)?;
        self.record(encoder, input, spheres)
    }

    /// The pairs of the last recorded call as `[u32; 2]`; `STORAGE` and `COPY_SRC` usage. `None` before the first.
    pub fn pairs(&self) -> Option<&wgpu::Buffer> {
        self.prepared.as_ref().map(|p| p.buffers.get(Slot::Pairs))
    }

    /// The [`Outcome`] of the last recorded call; `STORAGE`, `INDIRECT` and `COPY_SRC` usage. A consumer with a
    /// thread per pair is dispatched from [`Outcome::DISPATCH_OFFSET`]. `None` before the first call.
    pub fn outcome(&self) -> Option<&wgpu::Buffer> {
        self.prepared.as_ref().map(|p| p.buffers.get(Slot::Outcome))
    }

    /// The plan of the last recorded call.
    pub fn plan(&self) -> Option<&Plan> {
        self.prepared.as_ref().map(|p| &p.plan)
    }

    /// The ticks at either end of each phase (`u64`, in the order of [`Phase::ALL`](super::Phase::ALL)); `None` where calls are not
    /// timed.
    pub fn ticks(&self) -> Option<&wgpu::Buffer> {
        self.timer.as_ref().map(Timer::ticks)
    }

    fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        input: &GpuSpheres<'_>,
        spheres: u32,
    ) -> Result<(), GpuError> {
        let Some(prepared) = &mut self.prepared else { return Ok(()) };
        let [period_x, period_y, period_z] =
            self.settings.space.lengths().map(|length| length.unwrap_or_default());
        let call = Call {
            spheres,
            pair_capacity: prepared.plan.pairs,
            entry_capacity: prepared.plan.entries,
            key_bits: prepared.plan.key_bits,
            raster_ratio: self.settings.raster_ratio,
            species: self.settings.interactions.as_ref().map_or(0, Interactions::species),
            search_groups: prepared.plan.search_groups,
            consumer_group: self.settings.consumer_group,
            window_begin: input.window.start,
            window_end: input.window.end,
            refinement: prepared.plan.refinement as u32,
            tau: self.settings.tau,
            density_slots: prepared.plan.density_slots,
            part_tiles: self.part_tiles,
            period_x,
            period_y,
            period_z,
            cells: prepared.plan.cells,
            counters: if prepared.plan.tile == 0 { prepared.plan.counters } else { 0 },
            split: 0,
            tile: prepared.plan.tile,
            share: prepared.plan.share,
        };
        let count = match input.count {
            Count::Host(_) => None,
            Count::Buffer { buffer, .. } => Some(buffer.clone()),
        };
        let key = Key { spheres: input.spheres.clone(), species: input.species.cloned(), count, call };
        let position = prepared.recordings.iter().position(|(known, _)| *known == key);
        let position = match position {
            Some(position) => position,
            None => {
                let tables = self.tables.as_ref();
                let recording = prepared.bind(&self.device, &self.pipelines, &key, tables)?;
                prepared.recordings.truncate(KEPT_RECORDINGS - 1);
                prepared.recordings.push_front((key, recording));
                0
            }
        };
        prepared.current = position;
        let recording = &prepared.recordings[position].1;
        match &self.timer {
            None => recording.encode(encoder),
            Some(timer) => {
                recording.encode_timed(encoder, timer.queries());
                timer.resolve(encoder);
            }
        }
        Ok(())
    }
}

impl Prepared {
    fn bind(
        &self,
        device: &wgpu::Device,
        pipelines: &Pipelines,
        key: &Key,
        tables: Option<&Tables>,
    ) -> Result<Recording, GpuError> {
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

/// What a call found, read from a copy of the outcome buffer.
///
/// # Errors
/// [`Error::Buffer`](crate::Error::Buffer) where there are too few bytes.
pub fn read_outcome(bytes: &[u8]) -> Result<Outcome, GpuError> {
    let needed = size_of::<Outcome>();
    match bytes.get(..needed) {
        Some(bytes) => Ok(bytemuck::pod_read_unaligned(bytes)),
        None => {
            let (size, needed) = (bytes.len() as u64, needed as u64);
            Err(GpuError::Buffer { what: "outcome", size, needed, usage: "" })
        }
    }
}

#[cfg(test)]
mod tests;
