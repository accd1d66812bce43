//! A candidate list that stays on the device between calls.
//!
//! A rebuild searches the stored spheres with radii larger by half the skin. Each call records that search with
//! indirect workgroup counts, which the device sets to zero if the list is still valid.

use std::sync::Arc;

use lazygrid_host::SKIN_RANGE;
use lazygrid_kernels::kernel::{self as k, Variant};
use lazygrid_kernels::layout::{SearchParams, SkinParams};
use lazygrid_kernels::{Interaction, Interactions, Pair};

use super::input::GpuSpheres;
use super::output::GpuOutput;
use super::prepared::{Key, params_buffers};
use super::tables::Tables;
use super::{AlgorithmChoice, GpuDetector, LayoutSource};
use crate::Error;
use crate::gpu::Outcome;
#[cfg(doc)]
use crate::gpu::SkinState;
use crate::gpu::config::{GpuConfig, check};
use crate::gpu::device::{Pipelines, constant_buffer};
use crate::gpu::encode::{BoundBuffer, Buffers, Recording, SmallCache};
use crate::gpu::plan::{BufferId, DeviceLimits, Dispatch, Plan, check_buffers, column_named, skin};

/// Usable fraction of half the skin, below 1 by more than the rounding error.
const USABLE: f32 = 1.0 - 1.0 / 1024.0;
/// Species distances grow by this factor in addition to the skin, as radii do.
const ROUNDING: f32 = 1.0 + 1.0 / (1 << 19) as f32;
/// Candidate capacity per pair of the output, unless the device cannot bind it.
const PER_PAIR: u32 = 4;

/// Finds overlapping pairs of slowly moving spheres in GPU buffers by a list of candidates: pairs with gaps up to the
/// skin.
///
/// The device rebuilds the list if a sphere has moved half the skin, or the number of spheres, a radius or a species
/// has changed.
#[derive(Debug)]
pub struct GpuSkinDetector {
    device: wgpu::Device,
    settings: GpuConfig,
    skin: f32,
    pipelines: Pipelines,
    tables: Option<Tables>,
    search: GpuDetector,
    resident: Option<ResidentBuffers>,
}

#[derive(Debug)]
struct ResidentBuffers {
    /// Spheres, pairs and parts.
    capacities: [u32; 3],
    buffers: Buffers,
    candidates: Option<Candidates>,
}

#[derive(Debug)]
struct Candidates {
    found: GpuOutput,
    state: Buffers,
    recordings: SmallCache<(Key, Vec<u32>), SkinRecordings>,
}

#[derive(Debug)]
struct SkinRecordings {
    before: Recording,
    counts: Buffers,
    after: Recording,
}

impl GpuSkinDetector {
    /// Creates a detector with a skin in the unit of the coordinates, such as a few times the fastest displacement per
    /// call. A wider skin lasts longer and has more candidates. [`GpuConfig::pairs_in_cell_order`] and
    /// [`GpuConfig::timestamps`] have no effect.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`] and [`Error::NotOnBackend`] for settings, or an error of the device.
    pub fn new(device: &wgpu::Device, settings: GpuConfig, skin: f32) -> Result<Self, Error> {
        Self::with_pipelines(device, Pipelines::new(device), settings, skin)
    }

    pub(crate) fn with_pipelines(
        device: &wgpu::Device,
        pipelines: Pipelines,
        settings: GpuConfig,
        skin: f32,
    ) -> Result<Self, Error> {
        check(&settings)?;
        check_skin(skin)?;
        let tables = Tables::new(device, &settings)?;
        let search = search(device, pipelines.clone(), &settings, skin)?;
        let pipelines = if settings.subgroups { pipelines } else { pipelines.without_subgroups() };
        Ok(Self { device: device.clone(), settings, skin, pipelines, tables, search, resident: None })
    }

    pub(crate) fn skin(&self) -> f32 {
        self.skin
    }

    pub(crate) fn set_skin(&mut self, skin: f32) -> Result<(), Error> {
        check_skin(skin)?;
        if self.tables.is_some() {
            let capacities = self.search.capacities();
            self.search = search(&self.device, self.pipelines.clone(), &self.settings, skin)?;
            self.search.restore_capacities(capacities);
        }
        if let Some(resident) = &mut self.resident {
            resident.candidates = None;
        }
        self.skin = skin;
        Ok(())
    }

    /// Sets the candidate capacity, such as [`Outcome::candidates_needed`] after [`Outcome::OVERFLOW_CANDIDATES`].
    /// Default: four per pair of the output, if the device can bind these.
    pub fn set_candidate_capacity(&mut self, candidates: u32) {
        self.search.set_pair_capacity(candidates);
    }

    /// Sets [`GpuConfig::deferred_parts`].
    pub fn set_deferred_parts(&mut self, parts: u32) {
        self.search.set_deferred_parts(parts);
    }

    pub(crate) fn deferred_parts(&self) -> u32 {
        self.search.settings().deferred_parts
    }

    /// Works like [`GpuDetector::needed_deferred_parts`].
    pub fn needed_deferred_parts(&self, outcome: &Outcome) -> u32 {
        self.search.needed_deferred_parts(outcome)
    }

    pub(crate) fn candidate_capacity(&self) -> u32 {
        self.search.pair_capacity()
    }

    /// Changes the pair capacity; the next call allocates a new output and rebuilds the list.
    pub fn set_pair_capacity(&mut self, pairs: u32) {
        self.settings.pair_capacity = pairs;
    }

    /// Works like [`GpuDetector::set_entry_capacity`].
    pub fn set_entry_capacity(&mut self, entries: u64) -> bool {
        self.search.set_entry_capacity(entries)
    }

    /// Works like [`GpuDetector::memory_for`], with candidates.
    ///
    /// # Errors
    /// See [`GpuDetector::memory_for`].
    pub fn memory_for(&self, spheres: u32) -> Result<u64, Error> {
        let (parts, _) = skin::candidate_parts(self.search.pair_capacity(), self.search.budget());
        let buffers = self.buffers([spheres, self.settings.pair_capacity, parts]);
        Ok(self.search.memory_for(spheres)? + buffers.iter().map(|(_, bytes)| bytes).sum::<u64>())
    }

    pub(crate) fn plan(&self) -> Option<&Arc<Plan>> {
        self.search.plan()
    }

    /// Returns the [`SkinState`] buffer, with `STORAGE` and `COPY_SRC` usage; `None` before the first call.
    pub fn state(&self) -> Option<&wgpu::Buffer> {
        let candidates = self.resident.as_ref()?.candidates.as_ref()?;
        Some(candidates.state.get(BufferId::SkinState))
    }

    /// Works like [`GpuDetector::encode`]. With [`Outcome::OVERFLOW_CANDIDATES`], pairs are missing.
    ///
    /// # Errors
    /// See [`GpuDetector::encode`].
    pub fn encode(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        input: &GpuSpheres<'_>,
    ) -> Result<GpuOutput, Error> {
        let output = self.bind(input)?;
        (0..self.parts()).for_each(|part| self.encode_part(encoder, part));
        Ok(output)
    }

    /// Works like [`GpuDetector::bind`].
    ///
    /// # Errors
    /// See [`GpuDetector::encode`].
    pub fn bind(&mut self, input: &GpuSpheres<'_>) -> Result<GpuOutput, Error> {
        self.bind_as(self.search.algorithm_choice(), input)
    }

    /// Returns the number of parts of the bound call.
    pub fn parts(&self) -> u32 {
        self.search.parts()
    }

    /// Works like [`GpuDetector::encode_part`].
    pub fn encode_part(&self, encoder: &mut wgpu::CommandEncoder, part: u32) {
        let candidates = self.resident.as_ref().and_then(|resident| resident.candidates.as_ref());
        let recordings = candidates.and_then(|candidates| candidates.recordings.current());
        if let (Some(SkinRecordings { before, counts, after }), Some(search)) =
            (recordings, self.search.recording())
        {
            if part == 0 {
                before.encode(encoder);
            }
            search.encode_indirect_part(encoder, part, counts.get(BufferId::DispatchCounts));
            if part + 1 == search.parts() {
                after.encode(encoder);
            }
        }
    }

    pub(crate) fn bind_as(
        &mut self,
        choice: AlgorithmChoice,
        input: &GpuSpheres<'_>,
    ) -> Result<GpuOutput, Error> {
        let spheres = input.check(&self.settings, &self.device)?;
        let pairs = self.settings.pair_capacity;
        let (parts, _) = skin::candidate_parts(self.search.pair_capacity(), self.search.budget());
        let has_capacity =
            |had: &ResidentBuffers| had.capacities[0] >= spheres && had.capacities[1..] == [pairs, parts];
        let mut resident = match self.resident.take().filter(has_capacity) {
            Some(resident) => resident,
            None => self.allocate([spheres, pairs, parts])?,
        };
        let ResidentBuffers { buffers, candidates, .. } = &mut resident;
        // Without window and split, the candidates serve any.
        let mut reference = GpuSpheres::new(buffers.get(BufferId::ReferenceSpheres), input.count);
        reference.species = buffers.find(BufferId::ReferenceSpecies).map(Into::into);
        let found = self.search.bind_as(choice, &reference, LayoutSource::ThisCall)?;
        // New search buffers invalidate the candidates.
        let candidates = match candidates.take().filter(|candidates| candidates.found == found) {
            Some(same) => candidates.insert(same),
            None => {
                let state = Buffers::allocate(&self.device, &[skin::STATE])?;
                candidates.insert(Candidates { found, state, recordings: SmallCache::NONE })
            }
        };
        let (window, split) = input.search();
        let key = Key {
            input: input.bound(spheres, self.settings.columns.as_ref())?,
            call: self.settings.call(spheres, &window, split),
            reuses_layout: false,
        };
        self.record(buffers, candidates, key)?;
        let [pairs, outcome] = [BufferId::Pairs, BufferId::Outcome].map(|id| buffers.get(id).clone());
        self.resident = Some(resident);
        Ok(GpuOutput { pairs, capacity: self.settings.pair_capacity, outcome, sorted: None })
    }

    fn buffers(&self, capacities: [u32; 3]) -> Vec<(BufferId, u64)> {
        skin::buffers(capacities, self.tables.is_some(), self.settings.columns.is_some())
    }

    fn allocate(&self, capacities: [u32; 3]) -> Result<ResidentBuffers, Error> {
        let buffers = self.buffers(capacities);
        let limits = DeviceLimits::from_device(&self.device);
        check_buffers(&buffers, &limits)?;
        limits.check_indirect()?;
        let buffers = Buffers::allocate(&self.device, &buffers)?;
        Ok(ResidentBuffers { capacities, buffers, candidates: None })
    }

    fn record(&self, buffers: &Buffers, candidates: &mut Candidates, key: Key) -> Result<(), Error> {
        let Candidates { found, state, recordings } = candidates;
        let search = self.search.recording();
        let groups = search.map(Recording::workgroup_counts).unwrap_or_default();
        recordings.get_or_insert_with((key, groups), |(key, groups)| {
            let half = self.skin / 2.0;
            let limit_squared = (half * USABLE).powi(2);
            let skin = SkinParams { half_skin: half, limit_squared, candidate_capacity: found.capacity };
            let (parts, per_dispatch) = skin::candidate_parts(found.capacity, self.search.budget());
            let columns = self.settings.columns;
            let dispatches = skin::dispatches(key.call.spheres, columns.is_some(), parts, per_dispatch);
            let workgroups_per_dispatch = if parts > 1 { per_dispatch } else { 0 };
            let call = SearchParams { workgroups_per_dispatch, ..key.call };
            let params = params_buffers(&self.device, dispatches.iter().flatten(), &call)?;
            let skin = constant_buffer(&self.device, "skin", bytemuck::bytes_of(&skin))?;
            let columns = columns.unwrap_or_default();
            let columns = constant_buffer(&self.device, "columns", bytemuck::bytes_of(&columns))?;
            let full = constant_buffer(&self.device, "workgroups", bytemuck::cast_slice(groups))?;
            let counts = Buffers::allocate(&self.device, &[(BufferId::DispatchCounts, full.size())])?;
            let own = |id| BoundBuffer::from(buffers.get(id));
            let resolve = |dispatch: &Dispatch, binding: &str| -> BoundBuffer {
                if let Some(column) = column_named(binding) {
                    return key.input.spheres[column].clone();
                }
                match (binding, &self.tables, &key.input.species) {
                    ("skin", ..) => (&skin).into(),
                    ("count_source", ..) => key.input.count.clone().unwrap_or_else(|| (&params[&0]).into()),
                    ("columns", ..) => (&columns).into(),
                    ("rows", ..) => own(BufferId::Rows),
                    ("spheres", ..) if self.settings.columns.is_some() => own(BufferId::Rows),
                    ("spheres", ..) => key.input.spheres[0].clone(),
                    ("species", _, Some(species)) => species.clone(),
                    ("species_params", Some(tables), _) => (&tables.species_params).into(),
                    ("table", Some(tables), _) => (&tables.table).into(),
                    ("reference", ..) => own(BufferId::ReferenceSpheres),
                    ("reference_species", Some(_), _) => own(BufferId::ReferenceSpecies),
                    ("state", ..) => state.get(BufferId::SkinState).into(),
                    ("full_counts", ..) => (&full).into(),
                    ("dispatch_counts", ..) => counts.get(BufferId::DispatchCounts).into(),
                    // Without indirect arguments, nothing reads the buffer.
                    ("dispatch", ..) if dispatch.kernel == &k::SKIN_CHECK => search
                        .and_then(Recording::indirect_args)
                        .map_or_else(|| own(BufferId::DispatchArgs), BoundBuffer::from),
                    ("dispatch", ..) => own(BufferId::DispatchArgs),
                    ("candidates", ..) => (&found.pairs).into(),
                    ("found", ..) => (&found.outcome).into(),
                    ("outcome", ..) => own(BufferId::Outcome),
                    ("pairs", ..) => own(BufferId::Pairs),
                    _ => (&params[&dispatch.first_group]).into(),
                }
            };
            let periodic = self.settings.space.is_periodic();
            let variant = Variant { species: self.tables.is_some(), periodic, ..self.pipelines.variant() };
            let [before, after] = dispatches.map(|dispatches| {
                Recording::new(&self.device, &self.pipelines, variant, dispatches, resolve)
            });
            Ok(SkinRecordings { before: before?, counts, after: after? })
        })
    }
}

/// Returns the used fraction of half the skin; `squared_bits` has the bits of a squared displacement.
pub(crate) fn displacement_fraction(squared_bits: u32, skin: f32) -> f32 {
    f32::from_bits(squared_bits).sqrt() / (skin / 2.0)
}

fn check_skin(skin: f32) -> Result<(), Error> {
    if SKIN_RANGE.contains(&skin) {
        return Ok(());
    }
    let (value, range) = (skin.to_string(), "choose between 1e-14 and 1e17, or a `GpuDetector`");
    Err(Error::InvalidSetting { name: "skin", value, range })
}

fn search(
    device: &wgpu::Device,
    pipelines: Pipelines,
    settings: &GpuConfig,
    skin: f32,
) -> Result<GpuDetector, Error> {
    let most = DeviceLimits::from_device(device).bytes() / size_of::<Pair>() as u64;
    let candidates =
        settings.pair_capacity.saturating_mul(PER_PAIR).min(u32::try_from(most).unwrap_or(u32::MAX));
    let wide = settings
        .clone()
        .interactions(settings.interactions.as_ref().map(|table| widened(table, skin)).transpose()?)
        .pair_capacity(candidates)
        .pairs_in_cell_order(false)
        .timestamps(false)
        .columns(None);
    GpuDetector::with_pipelines(device, pipelines, wide)
}

fn widened(table: &Interactions, skin: f32) -> Result<Interactions, Error> {
    let mut wide = Interactions::new(table.species(), Interaction::Never)?;
    for (a, b) in (0..table.species()).flat_map(|a| (a..table.species()).map(move |b| (a, b))) {
        let interaction = match table.get(a, b) {
            Interaction::Within(distance) => {
                let wide = (distance as f32 + skin) * ROUNDING;
                Interaction::Within(f64::from(wide.min(f32::MAX)))
            }
            other => other,
        };
        wide.set(a, b, interaction)?;
    }
    Ok(wide)
}
