//! Candidates that stay on the device from call to call.
//!
//! Spheres are kept, larger by half the skin, when candidates are found among them. Each call measures how far they have
//! gone since. The device decides whether that is too far, and only then do the dispatches that find candidates have
//! workgroups; nothing is read back. Then candidates are tested where the spheres are now.

use std::collections::VecDeque;

use bytemuck::Zeroable;
use lazygrid_kernels::kernel::{self as k, Kernel, Variant};
use lazygrid_kernels::layout::{Call, Outcome, Skin, SkinState};
use lazygrid_kernels::{Interaction, Interactions};

use super::detector::{GpuDetector, GpuPairs, Tables};
use super::input::{Count, GpuSettings, GpuSpheres, check};
use super::pipelines::Pipelines;
use super::plan::{Phase, Stage};
use super::recording::{Recording, constant_buffer};
use super::scope::scoped;
use crate::Error;

/// Recordings kept for callers that alternate between a few buffers.
const KEPT_RECORDINGS: usize = 4;
/// Skins whose half has a square that devices neither flush nor make infinite.
const SKINS: std::ops::RangeInclusive<f32> = 1e-14..=1e17;
/// The part of its half of the skin that a sphere may use up: less than all of it by more than rounding can hide.
const USABLE: f32 = 1.0 - 1.0 / 1024.0;
/// By how much distances of species grow besides the skin, as the radii do.
const ROUNDING: f32 = 1.0 + 1.0 / (1 << 19) as f32;
/// Candidates that there is room for by default, for each pair that the output holds.
const PER_PAIR: u32 = 4;

/// Finds overlapping pairs of spheres that move little from call to call, in GPU buffers.
///
/// As [`GpuDetector`], but pairs that are up to a skin too far apart to touch stay on the device as candidates, until some
/// sphere has gone half of the skin. That is decided on the device, at every call, and never shows in a result. Another
/// number of spheres, another radius or another species has candidates found anew.
#[derive(Debug)]
pub struct GpuSkinDetector {
    device: wgpu::Device,
    settings: GpuSettings,
    skin: f32,
    pipelines: Pipelines,
    tables: Option<Tables>,
    /// Finds the candidates, among the spheres that are kept.
    search: GpuDetector,
    resident: Option<Resident>,
}

/// What stays on the device.
#[derive(Debug)]
struct Resident {
    /// Spheres that there is room for.
    spheres: u32,
    kept: wgpu::Buffer,
    kept_species: wgpu::Buffer,
    state: wgpu::Buffer,
    dispatch: wgpu::Buffer,
    outcome: wgpu::Buffer,
    pairs: wgpu::Buffer,
    capacity: u32,
    /// The candidates, by the search for them.
    found: Option<GpuPairs>,
    recordings: VecDeque<(Key, Parts)>,
}

/// What a recording was made for.
#[derive(Clone, Debug, PartialEq)]
struct Key {
    spheres: wgpu::Buffer,
    species: Option<wgpu::Buffer>,
    count: Option<wgpu::Buffer>,
    call: Call,
    groups: Vec<u32>,
}

/// What comes before the search for candidates and behind it.
#[derive(Debug)]
struct Parts {
    before: Recording,
    /// Workgroups of the search's dispatches, by then.
    gate: wgpu::Buffer,
    behind: Recording,
}

impl GpuSkinDetector {
    /// A detector on the caller's device with a skin of this width, in the unit of the coordinates. A wider one lasts
    /// longer and has more candidates: a good one is a few times as wide as the fastest sphere goes in a call.
    /// [`GpuSettings::sorted_pairs`] and [`GpuSettings::timed`] are of no effect.
    ///
    /// # Errors
    /// [`Error::Setting`] and [`Error::NotOnBackend`] for settings; otherwise where the device refuses something.
    pub fn new(device: &wgpu::Device, settings: GpuSettings, skin: f32) -> Result<Self, Error> {
        check(&settings)?;
        if !SKINS.contains(&skin) {
            let (value, range) = (skin.to_string(), "choose between 1e-14 and 1e17, or a `GpuDetector`");
            return Err(Error::Setting { name: "skin", value, range });
        }
        let pipelines = Pipelines::new(device);
        let wide = GpuSettings {
            interactions: settings.interactions.as_ref().map(|table| widened(table, skin)).transpose()?,
            pair_capacity: settings.pair_capacity.saturating_mul(PER_PAIR),
            sorted_pairs: false,
            timed: false,
            ..settings.clone()
        };
        let tables = settings.interactions.as_ref().map(|table| Tables::new(device, table)).transpose()?;
        let search = GpuDetector::with_pipelines(device, pipelines.clone(), wide)?;
        let pipelines = if settings.subgroups { pipelines } else { pipelines.without_subgroups() };
        Ok(Self { device: device.clone(), settings, skin, pipelines, tables, search, resident: None })
    }

    /// Changes how many candidates there is room for, by default four for each pair that the output holds. After a call
    /// that had too little ([`Outcome::CANDIDATES`]) [`Outcome::entries`] tells how many there are.
    pub fn set_candidate_capacity(&mut self, candidates: u32) {
        self.search.set_pair_capacity(candidates);
    }

    /// As [`GpuDetector::set_entry_capacity`].
    pub fn set_entry_capacity(&mut self, entries: u64) -> bool {
        self.search.set_entry_capacity(entries)
    }

    /// What is known of the candidates: [`SkinState`], with `STORAGE` and `COPY_SRC` usage. `None` before the first call.
    pub fn state(&self) -> Option<&wgpu::Buffer> {
        self.resident.as_ref().map(|resident| &resident.state)
    }

    /// Records the detection, as [`GpuDetector::encode`] does. [`Outcome::CANDIDATES`] in the overflow flag says that the
    /// candidates did not fit: the pairs are then not all that there are.
    ///
    /// # Errors
    /// As [`GpuDetector::encode`].
    pub fn encode(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        input: &GpuSpheres<'_>,
    ) -> Result<GpuPairs, Error> {
        let spheres = input.check(self.tables.is_some())?;
        let mut resident = match self.resident.take().filter(|resident| resident.spheres >= spheres) {
            Some(resident) => resident,
            None => self.allocate(spheres)?,
        };
        let kept = GpuSpheres {
            spheres: &resident.kept,
            count: input.count,
            species: self.tables.as_ref().map(|_| &resident.kept_species),
            window: GpuSpheres::ALL,
        };
        let found = self.search.bind_as(self.search.way(), &kept)?;
        if resident.found.as_ref() != Some(&found) {
            // The candidates that there were are gone.
            resident.state = self.buffer("what is known of candidates", size_of::<SkinState>() as u64)?;
            resident.recordings.clear();
            resident.found = Some(found.clone());
        }
        let position = self.recorded(&mut resident, (spheres, &found), input)?;
        let Parts { before, gate, behind } = &resident.recordings[position].1;
        before.encode(encoder);
        if let Some(search) = self.search.recording() {
            search.encode_gated(encoder, gate);
        }
        behind.encode(encoder);
        let (pairs, outcome) = (resident.pairs.clone(), resident.outcome.clone());
        let output = GpuPairs { pairs, capacity: resident.capacity, outcome, sorted: None };
        self.resident = Some(resident);
        Ok(output)
    }

    fn allocate(&self, spheres: u32) -> Result<Resident, Error> {
        let capacity = self.settings.pair_capacity;
        let species = if self.tables.is_some() { spheres } else { 0 };
        Ok(Resident {
            spheres,
            kept: self.buffer("kept spheres", u64::from(spheres) * 16)?,
            kept_species: self.buffer("kept species", u64::from(species) * 4)?,
            state: self.buffer("what is known of candidates", size_of::<SkinState>() as u64)?,
            dispatch: self.buffer("workgroups of the candidates", 16)?,
            outcome: self.buffer("outcome", size_of::<Outcome>() as u64)?,
            pairs: self.buffer("pairs", u64::from(capacity) * 8)?,
            capacity,
            found: None,
            recordings: VecDeque::new(),
        })
    }

    fn buffer(&self, label: &'static str, bytes: u64) -> Result<wgpu::Buffer, Error> {
        let limits = self.device.limits();
        let (size, limit) =
            (bytes.max(16), limits.max_storage_buffer_binding_size.min(limits.max_buffer_size));
        if size > limit {
            let remedy = "ask for fewer pairs, or for fewer spheres at a time";
            return Err(Error::LimitExceeded { what: label, needed: size, limit, remedy });
        }
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::INDIRECT;
        let descriptor =
            wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        scoped(&self.device, label, size, || self.device.create_buffer(&descriptor))
    }

    /// What the kernels of this call read.
    fn call(&self, spheres: u32, input: &GpuSpheres<'_>) -> Call {
        let [period_x, period_y, period_z] =
            self.settings.space.lengths().map(|length| length.unwrap_or_default());
        Call {
            spheres,
            pair_capacity: self.settings.pair_capacity,
            species: self.settings.interactions.as_ref().map_or(0, Interactions::species),
            consumer_group: self.settings.consumer_group,
            window_begin: input.window.start,
            window_end: input.window.end,
            period_x,
            period_y,
            period_z,
            ..Call::zeroed()
        }
    }

    /// The place of what was recorded for this input, or is now.
    fn recorded(
        &self,
        resident: &mut Resident,
        (spheres, found): (u32, &GpuPairs),
        input: &GpuSpheres<'_>,
    ) -> Result<usize, Error> {
        let count = match input.count {
            Count::Host(_) => None,
            Count::Buffer { buffer, .. } => Some(buffer.clone()),
        };
        let groups = self.search.recording().map(Recording::groups).unwrap_or_default();
        let call = self.call(spheres, input);
        let key =
            Key { spheres: input.spheres.clone(), species: input.species.cloned(), count, call, groups };
        if let Some(position) = resident.recordings.iter().position(|(known, _)| *known == key) {
            return Ok(position);
        }
        let parts = self.record(resident, &key, found)?;
        resident.recordings.truncate(KEPT_RECORDINGS - 1);
        resident.recordings.push_front((key, parts));
        Ok(0)
    }

    fn record(&self, resident: &Resident, key: &Key, found: &GpuPairs) -> Result<Parts, Error> {
        let half = self.skin / 2.0;
        let skin = Skin { half, usable: (half * USABLE).powi(2), capacity: found.capacity };
        let call = constant_buffer(&self.device, "call", bytemuck::bytes_of(&key.call))?;
        let skin = constant_buffer(&self.device, "skin", bytemuck::bytes_of(&skin))?;
        let full = constant_buffer(&self.device, "workgroups", bytemuck::cast_slice(&key.groups))?;
        let gate = self.buffer("workgroups of the search", full.size())?;
        let unused = self.buffer("unused", 16)?;
        let of_search = self.search.recording().and_then(Recording::found_groups).unwrap_or(&unused);
        let resolve = |stage: &Stage, binding: &str| match binding {
            "skin" => &skin,
            "count_source" => key.count.as_ref().unwrap_or(&call),
            "spheres" => &key.spheres,
            "species" => key.species.as_ref().unwrap_or(&unused),
            "table" => self.tables.as_ref().map_or(&unused, |tables| &tables.table),
            "kept" => &resident.kept,
            "kept_species" => &resident.kept_species,
            "state" => &resident.state,
            "full" => &full,
            "gate" => &gate,
            "dispatch" if stage.kernel == &k::SKIN_DECIDE => of_search,
            "dispatch" => &resident.dispatch,
            "candidates" => &found.pairs,
            "found" => &found.outcome,
            "outcome" => &resident.outcome,
            "pairs" => &resident.pairs,
            _ => &call,
        };
        let periodic = self.settings.space.is_periodic();
        let variant = Variant { species: self.tables.is_some(), periodic, ..self.pipelines.variant() };
        let [before, behind] = stages(key.call.spheres)
            .map(|stages| Recording::new(&self.device, &self.pipelines, variant, stages, resolve));
        Ok(Parts { before: before?, gate: gate.clone(), behind: behind? })
    }
}

/// The dispatches before the search for candidates and behind it.
fn stages(spheres: u32) -> [Vec<Stage>; 2] {
    let stage =
        |kernel: &'static Kernel, groups, phase| Stage { kernel, groups, indirect: false, phase, pass: 0 };
    let per_sphere = spheres.div_ceil(k::GROUP);
    let before = vec![
        stage(&k::SKIN_MEASURE, per_sphere, Phase::Survey),
        stage(&k::SKIN_DECIDE, 1, Phase::Survey),
        stage(&k::SKIN_KEEP, per_sphere, Phase::Survey),
    ];
    let behind = vec![
        stage(&k::CANDIDATES_OPEN, 1, Phase::Search),
        Stage { indirect: true, ..stage(&k::CANDIDATES_TEST, 0, Phase::Search) },
        stage(&k::OUTCOME_FINISH, 1, Phase::Search),
    ];
    [before, behind]
}

/// The table by which species are candidates.
fn widened(table: &Interactions, skin: f32) -> Result<Interactions, Error> {
    let mut wide = Interactions::new(table.species(), Interaction::Never)?;
    for (a, b) in (0..table.species()).flat_map(|a| (a..table.species()).map(move |b| (a, b))) {
        let interaction = match table.get(a, b) {
            Interaction::Within(distance) => {
                Interaction::Within(((distance + skin) * ROUNDING).min(f32::MAX))
            }
            other => other,
        };
        wide.set(a, b, interaction)?;
    }
    Ok(wide)
}
