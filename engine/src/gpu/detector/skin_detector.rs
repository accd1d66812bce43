//! Candidates that stay on the device from call to call.
//!
//! Spheres are kept, larger by half the skin, when candidates are found among them. Each call measures how far they have
//! gone since. The device decides whether that is too far, and only then do the dispatches that find candidates have
//! workgroups; nothing is read back. Then candidates are tested where the spheres are now.

use lazygrid_host::SKIN_RANGE;
use lazygrid_kernels::kernel::{self as k, Variant};
use lazygrid_kernels::layout::SkinParams;
use lazygrid_kernels::{Interaction, Interactions};

use super::input::GpuSpheres;
use super::output::GpuOutput;
use super::prepared::Key;
use super::tables::Tables;
use super::{AlgorithmChoice, GpuDetector};
use crate::Error;
use crate::gpu::config::{GpuConfig, check};
use crate::gpu::device::{Pipelines, constant_buffer};
use crate::gpu::encode::{Buffers, Recording, SmallCache};
use crate::gpu::plan::{BufferId, DeviceLimits, Dispatch, Plan, check_buffers, skin};
#[cfg(doc)]
use crate::gpu::{Outcome, SkinState};

/// The part of its half of the skin that a sphere may use up: less than all of it by more than rounding can hide.
const USABLE: f32 = 1.0 - 1.0 / 1024.0;
/// By how much distances of species grow besides the skin, as the radii do.
const ROUNDING: f32 = 1.0 + 1.0 / (1 << 19) as f32;
/// Candidates that there is room for by default, for each pair that the output holds.
const PER_PAIR: u32 = 4;

/// Finds overlapping pairs of spheres that move little from call to call, in GPU buffers.
///
/// The same as [`GpuDetector`], but pairs that are up to a skin too far apart to touch stay on the device as candidates, until some
/// sphere has gone half of the skin. That is decided on the device, at every call, and never shows in a result. Another
/// number of spheres, another radius or another species has candidates found anew.
#[derive(Debug)]
pub struct GpuSkinDetector {
    device: wgpu::Device,
    settings: GpuConfig,
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
    /// Spheres that there is room for, and pairs.
    room: [u32; 2],
    buffers: Buffers,
    candidates: Option<Candidates>,
}

/// The candidates, by the search for them, and what is known of them.
#[derive(Debug)]
struct Candidates {
    found: GpuOutput,
    state: Buffers,
    /// By the call and the workgroups of the search.
    parts: SmallCache<(Key, Vec<u32>), Parts>,
}

/// What comes before the search for candidates and behind it.
#[derive(Debug)]
struct Parts {
    before: Recording,
    /// Workgroups of the search's dispatches, by then.
    gate: Buffers,
    behind: Recording,
}

impl GpuSkinDetector {
    /// A detector on the caller's device with a skin of this width, in the unit of the coordinates. A wider one lasts
    /// longer and has more candidates: a good one is a few times as wide as the fastest sphere goes in a call.
    /// [`GpuConfig::pairs_in_cell_order`] and [`GpuConfig::timestamps`] are of no effect.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`] and [`Error::NotOnBackend`] for settings; otherwise where the device refuses something.
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
        let tables = settings.interactions.as_ref().map(|table| Tables::new(device, table)).transpose()?;
        let search = search(device, pipelines.clone(), &settings, skin)?;
        let pipelines = if settings.subgroups { pipelines } else { pipelines.without_subgroups() };
        Ok(Self { device: device.clone(), settings, skin, pipelines, tables, search, resident: None })
    }

    /// How wide the skin is.
    pub(crate) fn skin(&self) -> f32 {
        self.skin
    }

    /// Changes how wide it is. The next call finds candidates anew, in the buffers that there are.
    ///
    /// # Errors
    /// The same as [`new`](Self::new).
    pub(crate) fn set_skin(&mut self, skin: f32) -> Result<(), Error> {
        check_skin(skin)?;
        if self.tables.is_some() {
            // Distances of species grow by the skin.
            let room = self.search.pair_capacity();
            self.search = search(&self.device, self.pipelines.clone(), &self.settings, skin)?;
            self.search.set_pair_capacity(room);
        }
        if let Some(resident) = &mut self.resident {
            resident.candidates = None;
        }
        self.skin = skin;
        Ok(())
    }

    /// Changes how many candidates there is room for, by default four for each pair that the output holds. After a call
    /// that had too little ([`Outcome::OVERFLOW_CANDIDATES`]) [`Outcome::entries_needed`] tells how many there are.
    pub fn set_candidate_capacity(&mut self, candidates: u32) {
        self.search.set_pair_capacity(candidates);
    }

    pub(crate) fn candidate_capacity(&self) -> u32 {
        self.search.pair_capacity()
    }

    /// Changes how many pairs the output holds; the output is allocated anew by the next call, which finds candidates anew.
    pub fn set_pair_capacity(&mut self, pairs: u32) {
        self.settings.pair_capacity = pairs;
    }

    /// The same as [`GpuDetector::set_entry_capacity`].
    pub fn set_entry_capacity(&mut self, entries: u64) -> bool {
        self.search.set_entry_capacity(entries)
    }

    /// Bytes of device memory for calls of up to `spheres` spheres, candidates and the output included and the input not.
    ///
    /// # Errors
    /// The same as [`GpuDetector::memory_for`].
    pub fn memory_for(&self, spheres: u32) -> Result<u64, Error> {
        let gpu = skin::buffers(spheres, self.settings.pair_capacity, self.tables.is_some());
        Ok(self.search.memory_for(spheres)? + gpu.iter().map(|(_, bytes)| bytes).sum::<u64>())
    }

    /// The part of what it may go, between 0 and 1, that a sphere has gone whose square has these bits.
    pub(crate) fn part(&self, moved: u32) -> f32 {
        f32::from_bits(moved).sqrt() / (self.skin / 2.0)
    }

    /// The plan of the search for candidates that was recorded last.
    pub(crate) fn plan(&self) -> Option<&Plan> {
        self.search.plan()
    }

    /// What is known of the candidates: [`SkinState`], with `STORAGE` and `COPY_SRC` usage. `None` before the first call.
    pub fn state(&self) -> Option<&wgpu::Buffer> {
        let candidates = self.resident.as_ref()?.candidates.as_ref()?;
        Some(candidates.state.get(BufferId::SkinState))
    }

    /// Records the detection, as [`GpuDetector::encode`] does. [`Outcome::OVERFLOW_CANDIDATES`] in the overflow flag says that the
    /// candidates did not fit: the pairs are then not all that there are.
    ///
    /// # Errors
    /// The same as [`GpuDetector::encode`].
    pub fn encode(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        input: &GpuSpheres<'_>,
    ) -> Result<GpuOutput, Error> {
        self.encode_as(self.search.algorithm_choice(), encoder, input)
    }

    /// The same as [`encode`](Self::encode), with candidates found in another way than the settings say.
    pub(crate) fn encode_as(
        &mut self,
        choice: AlgorithmChoice,
        encoder: &mut wgpu::CommandEncoder,
        input: &GpuSpheres<'_>,
    ) -> Result<GpuOutput, Error> {
        let spheres = input.check(self.tables.is_some())?;
        let pairs = self.settings.pair_capacity;
        let has_room = |had: &Resident| had.room[0] >= spheres && had.room[1] == pairs;
        let mut resident = match self.resident.take().filter(has_room) {
            Some(resident) => resident,
            None => self.allocate([spheres, pairs])?,
        };
        let Resident { buffers, candidates, .. } = &mut resident;
        // Candidates serve any window, and one set as well as two.
        let kept = GpuSpheres {
            spheres: buffers.get(BufferId::ReferenceSpheres),
            count: input.count,
            species: buffers.find(BufferId::ReferenceSpecies),
            window: GpuSpheres::ALL,
            split: 0,
        };
        let found = self.search.bind_as(choice, &kept)?;
        // With other buffers of the search those that there were are gone.
        let candidates = match candidates.take().filter(|candidates| candidates.found == found) {
            Some(same) => candidates.insert(same),
            None => {
                let state = Buffers::allocate(&self.device, &[skin::STATE])?;
                candidates.insert(Candidates { found, state, parts: SmallCache::NONE })
            }
        };
        let key = Key::of(input, self.settings.call(spheres, input));
        self.record(buffers, candidates, key)?;
        if let (Some(Parts { before, gate, behind }), Some(search)) =
            (candidates.parts.current(), self.search.recording())
        {
            before.encode(encoder);
            search.encode_indirect(encoder, gate.get(BufferId::DispatchCounts));
            behind.encode(encoder);
        }
        let [pairs, outcome] = [BufferId::Pairs, BufferId::Outcome].map(|slot| buffers.get(slot).clone());
        self.resident = Some(resident);
        Ok(GpuOutput { pairs, capacity: self.settings.pair_capacity, outcome, sorted: None })
    }

    fn allocate(&self, room: [u32; 2]) -> Result<Resident, Error> {
        let [spheres, pairs] = room;
        let buffers = skin::buffers(spheres, pairs, self.tables.is_some());
        check_buffers(&buffers, &DeviceLimits::of(&self.device))?;
        let buffers = Buffers::allocate(&self.device, &buffers)?;
        Ok(Resident { room, buffers, candidates: None })
    }

    /// Binds all dispatches of such a call, unless they are.
    fn record(&self, buffers: &Buffers, candidates: &mut Candidates, key: Key) -> Result<(), Error> {
        let Candidates { found, state, parts } = candidates;
        let search = self.search.recording();
        let groups = search.map(Recording::workgroup_counts).unwrap_or_default();
        parts.get_or_insert_with((key, groups), |(key, groups)| {
            let half = self.skin / 2.0;
            let limit_squared = (half * USABLE).powi(2);
            let skin = SkinParams { half_skin: half, limit_squared, candidate_capacity: found.capacity };
            let call = constant_buffer(&self.device, "call", bytemuck::bytes_of(&key.call))?;
            let skin = constant_buffer(&self.device, "skin", bytemuck::bytes_of(&skin))?;
            let full = constant_buffer(&self.device, "workgroups", bytemuck::cast_slice(groups))?;
            let gate = Buffers::allocate(&self.device, &[(BufferId::DispatchCounts, full.size())])?;
            let gpu = |slot| buffers.get(slot);
            let resolve = |dispatch: &Dispatch, binding: &str| match (binding, &self.tables, &key.species) {
                ("skin", ..) => &skin,
                ("count_source", ..) => key.count.as_ref().unwrap_or(&call),
                ("spheres", ..) => &key.spheres,
                ("species", _, Some(species)) => species,
                ("table", Some(tables), _) => &tables.table,
                ("reference", ..) => gpu(BufferId::ReferenceSpheres),
                ("reference_species", Some(_), _) => gpu(BufferId::ReferenceSpecies),
                ("state", ..) => state.get(BufferId::SkinState),
                ("full_counts", ..) => &full,
                ("dispatch_counts", ..) => gate.get(BufferId::DispatchCounts),
                // Of the search, where it finds workgroups itself; its own, which is written again, where it does not.
                ("dispatch", ..) if dispatch.kernel == &k::SKIN_CHECK => {
                    search.and_then(Recording::indirect_args).unwrap_or(gpu(BufferId::DispatchArgs))
                }
                ("dispatch", ..) => gpu(BufferId::DispatchArgs),
                ("candidates", ..) => &found.pairs,
                ("found", ..) => &found.outcome,
                ("outcome", ..) => gpu(BufferId::Outcome),
                ("pairs", ..) => gpu(BufferId::Pairs),
                _ => &call,
            };
            let periodic = self.settings.space.is_periodic();
            let variant = Variant { species: self.tables.is_some(), periodic, ..self.pipelines.variant() };
            let [before, behind] = skin::dispatches(key.call.spheres).map(|dispatches| {
                Recording::new(&self.device, &self.pipelines, variant, dispatches, resolve)
            });
            Ok(Parts { before: before?, gate, behind: behind? })
        })
    }
}

fn check_skin(skin: f32) -> Result<(), Error> {
    if SKIN_RANGE.contains(&skin) {
        return Ok(());
    }
    let (value, range) = (skin.to_string(), "choose between 1e-14 and 1e17, or a `GpuDetector`");
    Err(Error::InvalidSetting { name: "skin", value, range })
}

/// What finds the candidates.
fn search(
    device: &wgpu::Device,
    pipelines: Pipelines,
    settings: &GpuConfig,
    skin: f32,
) -> Result<GpuDetector, Error> {
    let wide = settings
        .clone()
        .interactions(settings.interactions.as_ref().map(|table| widened(table, skin)).transpose()?)
        .pair_capacity(settings.pair_capacity.saturating_mul(PER_PAIR))
        .pairs_in_cell_order(false)
        .timestamps(false);
    GpuDetector::with_pipelines(device, pipelines, wide)
}

/// The table by which species are candidates.
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
