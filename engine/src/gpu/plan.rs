//! What one call will allocate and dispatch. Pure functions of sizes and limits: no device, no allocation.

use lazygrid_kernels::Algorithm;
use lazygrid_kernels::kernel::{self as k, Kernel};
use lazygrid_kernels::layout::{BOUNDS_BYTES, GRID_BYTES, Lengths, Outcome};

use super::GpuError;

/// Workgroups of the naive search where there is work for them: enough to fill today's largest devices.
const SEARCH_GROUPS: u64 = 2048;
/// The most entries: even if all are in one cell, the crowded search shares them out over one dimension.
const MAX_ENTRIES: u64 = 65_535 * (k::CROWDED_TILES * k::GROUP) as u64;
/// The fewest key bits: folding needs three per axis.
const MIN_KEY_BITS: u32 = 16;

/// The limits of a device that bind a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceLimits {
    /// Bytes of one storage binding.
    pub storage_binding: u64,
    /// Bytes of one buffer.
    pub buffer: u64,
    /// Workgroups per dimension of a dispatch.
    pub groups_per_dimension: u32,
    /// Storage buffers that one kernel may bind.
    pub storage_buffers: u32,
}

impl DeviceLimits {
    /// The limits that the device was made with.
    pub fn of(device: &wgpu::Device) -> Self {
        let limits = device.limits();
        Self {
            storage_binding: limits.max_storage_buffer_binding_size,
            buffer: limits.max_buffer_size,
            groups_per_dimension: limits.max_compute_workgroups_per_dimension,
            storage_buffers: limits.max_storage_buffers_per_shader_stage,
        }
    }

    /// The most bytes a buffer may have that is bound as a whole.
    fn bytes(&self) -> u64 {
        self.storage_binding.min(self.buffer)
    }
}

/// What a plan is made for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Spheres, or the most there may be.
    pub spheres: u32,
    /// Pairs that the output is to hold.
    pub pairs: u32,
    /// One of [`Algorithm::GPU`]: what `Auto` means is settled before.
    pub algorithm: Algorithm,
    /// Species of the interaction table; 0 without one.
    pub species: u32,
}

/// A buffer that the detector owns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Slot {
    /// Bounds of the spheres.
    Bounds,
    /// The raster.
    Grid,
    /// Count, overflow flag, quarantine count and dispatch arguments.
    Outcome,
    /// The pairs.
    Pairs,
    /// How many entries there are.
    Lengths,
    /// Keys of the entries, two of them to sort to and fro.
    Keys(bool),
    /// Objects of the entries, likewise.
    Objects(bool),
    /// Digit counts of a radix pass.
    Counts,
    /// Sums of the tiles of a scan.
    Sums,
    /// Total of a scan.
    Total,
    /// Blocks of entries for the crowded search.
    Crowded,
    /// Workgroups of the crowded search.
    Dispatch,
}

/// What a kernel's binding is bound to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Resource {
    /// A buffer of the detector.
    Own(Slot),
    /// The spheres, from the caller.
    Spheres,
    /// The number of spheres, from the caller or the call's own.
    Count,
    /// Species ids, from the caller.
    Species,
    /// The uniform of this call.
    Call,
    /// The uniform of a radix pass.
    Pass(u32),
    /// Effective radii by species.
    Reach,
    /// The interaction table.
    Table,
}

/// The parts of a call that are timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// Bounds and raster.
    Survey,
    /// Entries of overlapped cells.
    Entries,
    /// Radix sort of the entries.
    Sort,
    /// Distance tests.
    Search,
}

impl Phase {
    /// Every phase in the order they run.
    pub const ALL: [Self; 4] = [Self::Survey, Self::Entries, Self::Sort, Self::Search];

    /// The name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Survey => "survey",
            Self::Entries => "entries",
            Self::Sort => "sort",
            Self::Search => "search",
        }
    }
}

/// One dispatch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stage {
    /// What runs.
    pub kernel: &'static Kernel,
    /// How many workgroups, before they are laid out in two dimensions.
    pub groups: u32,
    /// Whether their number is instead found on the device, in [`Slot::Dispatch`].
    pub indirect: bool,
    /// Which part of the call it belongs to.
    pub phase: Phase,
    /// Which radix pass it belongs to; 0 outside the sort.
    pub pass: u32,
}

/// Everything one call needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// What was asked for.
    pub algorithm: Algorithm,
    /// Spheres it is made for.
    pub spheres: u32,
    /// Pairs that the output holds.
    pub pairs: u32,
    /// Entries that the entry buffers hold; 0 for naive.
    pub entries: u32,
    /// Bits of a cell's key; 0 for naive.
    pub key_bits: u32,
    /// Workgroups of the naive search; 0 without it.
    pub search_groups: u32,
    /// The buffers and their bytes.
    pub buffers: Vec<(Slot, u64)>,
    /// The dispatches, in order.
    pub stages: Vec<Stage>,
}

/// Plans a call.
///
/// # Errors
/// [`GpuError::LimitExceeded`] where a buffer cannot be bound on the device, [`GpuError::NotOnGpu`] for an
/// algorithm without kernels.
pub fn plan(request: &Request, limits: &DeviceLimits) -> Result<Plan, GpuError> {
    let algorithm = match request.algorithm {
        named @ (Algorithm::Naive | Algorithm::ArrayGrid) => named,
        other => return Err(GpuError::NotOnGpu(other)),
    };
    let mut plan = Plan {
        algorithm,
        spheres: request.spheres,
        pairs: request.pairs,
        entries: 0,
        key_bits: 0,
        search_groups: 0,
        buffers: vec![
            (Slot::Bounds, BOUNDS_BYTES),
            (Slot::Grid, GRID_BYTES),
            (Slot::Outcome, size_of::<Outcome>() as u64),
            (Slot::Pairs, bytes_of(request.pairs, 8)),
        ],
        stages: Vec::new(),
    };
    if algorithm == Algorithm::ArrayGrid {
        plan.entries = entry_capacity(request.spheres, limits)?;
        plan.key_bits = key_bits(request.spheres);
        plan.buffers.extend(entry_buffers(plan.entries));
    } else {
        plan.search_groups = naive_groups(request.spheres, limits)?;
    }
    plan.stages = stages(&plan);
    check(&plan, request.species != 0, limits)?;
    Ok(plan)
}

impl Plan {
    /// Bytes of all buffers of the plan.
    pub fn bytes(&self) -> u64 {
        self.buffers.iter().map(|(_, bytes)| bytes).sum()
    }

    /// Radix passes of the sort.
    pub fn passes(&self) -> u32 {
        self.key_bits.div_ceil(k::DIGIT_BITS)
    }

    /// The most turns that all loops of one invocation of a stage take together.
    pub fn turns(&self, stage: &Stage) -> u64 {
        // Loops over what one thread reads, over subgroups, and over 256 samples on three axes.
        const FIXED: u64 = 1024;
        let kernel = stage.kernel;
        if kernel == &k::NAIVE_SEARCH {
            let blocks = self.spheres.div_ceil(k::GROUP).max(1);
            let shares = (self.search_groups / blocks).clamp(1, blocks);
            u64::from(blocks.div_ceil(shares)) * u64::from(k::NAIVE_TURNS)
        } else if kernel == &k::CROWDED_SEARCH {
            u64::from(k::CROWDED_TILES * k::CROWDED_TURNS + u32::BITS)
        } else if kernel == &k::SCAN_SPINE {
            let tiles = Lengths::for_sort(self.entries).counters.div_ceil(k::SCAN_TILE);
            FIXED * u64::from(tiles.div_ceil(k::SCAN_TILE)) / 32
        } else {
            FIXED
        }
    }

    /// The buffer behind a binding's name at a stage.
    pub fn resource(&self, stage: &Stage, binding: &str) -> Resource {
        // Each pass reads what the one before wrote; after the last, the parity of their number says where.
        let front = match stage.phase {
            Phase::Sort => stage.pass % 2 == 1,
            Phase::Search => self.passes() % 2 == 1,
            Phase::Survey | Phase::Entries => false,
        };
        Resource::Own(match binding {
            "call" => return Resource::Call,
            "count_source" => return Resource::Count,
            "digit_pass" => return Resource::Pass(stage.pass),
            "spheres" => return Resource::Spheres,
            "species" => return Resource::Species,
            "reach" => return Resource::Reach,
            "table" => return Resource::Table,
            "bounds" => Slot::Bounds,
            "grid" => Slot::Grid,
            "outcome" => Slot::Outcome,
            "pairs" => Slot::Pairs,
            "lengths" => Slot::Lengths,
            "keys" => Slot::Keys(front),
            "objects" | "payload" => Slot::Objects(front),
            "sorted_keys" => Slot::Keys(!front),
            "sorted_payload" => Slot::Objects(!front),
            "counts" | "values" | "places" => Slot::Counts,
            "sums" => Slot::Sums,
            "total" => Slot::Total,
            "crowded" => Slot::Crowded,
            "dispatch" => Slot::Dispatch,
            other => unreachable!("no kernel binds `{other}`"),
        })
    }
}

/// Workgroups laid out over two dimensions. The last row may be longer than needed; kernels end early there.
pub(super) fn flattened(groups: u32, limits: &DeviceLimits) -> [u32; 2] {
    let rows = groups.div_ceil(limits.groups_per_dimension).max(1);
    [groups.div_ceil(rows), rows]
}

/// The stages of a stable radix sort of at most `items` keys by `passes` digits.
pub(super) fn sort_stages(items: u32, passes: u32) -> impl Iterator<Item = Stage> {
    let tiles = items.div_ceil(k::RADIX_TILE);
    (0..passes).flat_map(move |pass| {
        let stage = move |kernel, groups| Stage { kernel, groups, indirect: false, phase: Phase::Sort, pass };
        let [reduce, spine, spread] = scan_stages(tiles * (1 << k::DIGIT_BITS), pass);
        [stage(&k::RADIX_COUNT, tiles), reduce, spine, spread, stage(&k::RADIX_SCATTER, tiles)]
    })
}

/// The stages of an exclusive scan of at most `values` values.
pub(super) fn scan_stages(values: u32, pass: u32) -> [Stage; 3] {
    let tiles = values.div_ceil(k::SCAN_TILE);
    let stage = |kernel, groups| Stage { kernel, groups, indirect: false, phase: Phase::Sort, pass };
    [stage(&k::SCAN_REDUCE, tiles), stage(&k::SCAN_SPINE, 1), stage(&k::SCAN_SPREAD, tiles)]
}

/// The buffers for entries and their sort.
pub(super) fn entry_buffers(entries: u32) -> [(Slot, u64); 10] {
    let counters = Lengths::for_sort(entries).counters;
    [
        (Slot::Lengths, size_of::<Lengths>() as u64),
        (Slot::Keys(false), bytes_of(entries, 4)),
        (Slot::Keys(true), bytes_of(entries, 4)),
        (Slot::Objects(false), bytes_of(entries, 4)),
        (Slot::Objects(true), bytes_of(entries, 4)),
        (Slot::Counts, bytes_of(counters, 4)),
        (Slot::Sums, bytes_of(counters.div_ceil(k::SCAN_TILE), 8)),
        (Slot::Total, 16),
        (Slot::Crowded, bytes_of(entries.div_ceil(k::GROUP), 4)),
        (Slot::Dispatch, 16),
    ]
}

/// Room for eight entries per sphere, the most there can be, or for as many as the device can bind. Then spheres
/// that lie unluckily may need more: such a call says so in its overflow flag.
fn entry_capacity(spheres: u32, limits: &DeviceLimits) -> Result<u32, GpuError> {
    let most = u64::from(spheres) * k::MAX_ENTRIES_PER_SPHERE;
    let entries = most.min(limits.bytes() / 4).min(MAX_ENTRIES);
    if entries < u64::from(spheres) {
        return Err(GpuError::LimitExceeded {
            what: "the list of (cell, object) entries, at least one per sphere,",
            needed: u64::from(spheres) * 4,
            limit: limits.bytes().min(MAX_ENTRIES * 4),
            remedy: "split the spheres",
        });
    }
    // Below 2³⁰ by the limit.
    Ok(entries as u32)
}

/// So many workgroups that none compares with more than [`k::NAIVE_TILES`] tiles, and that the device is busy.
fn naive_groups(spheres: u32, limits: &DeviceLimits) -> Result<u32, GpuError> {
    let blocks = u64::from(spheres.div_ceil(k::GROUP)).max(1);
    let needed = (blocks * blocks.div_ceil(k::NAIVE_TILES.into())).max(SEARCH_GROUPS.min(blocks * blocks));
    let limit = u64::from(limits.groups_per_dimension).pow(2).min(u32::MAX.into());
    if needed > limit {
        let (what, remedy) = ("the number of workgroups for all pairs", "choose array-grid");
        return Err(GpuError::LimitExceeded { what, needed, limit, remedy });
    }
    // Below 2³² by the limit.
    Ok(needed as u32)
}

/// As many key bits as the spheres could occupy cells, in whole digits. A raster with more cells is folded.
fn key_bits(spheres: u32) -> u32 {
    let bits = u32::BITS - spheres.max(2).leading_zeros();
    bits.next_multiple_of(k::DIGIT_BITS).max(MIN_KEY_BITS)
}

/// Bytes of `count` items; never zero, as an empty buffer cannot be bound.
fn bytes_of(count: u32, size: u64) -> u64 {
    (u64::from(count) * size).max(16)
}

fn stages(plan: &Plan) -> Vec<Stage> {
    let stage = |kernel, groups, phase| Stage { kernel, groups, indirect: false, phase, pass: 0 };
    let mut stages = vec![
        stage(&k::CALL_BEGIN, 1, Phase::Survey),
        stage(&k::BOUNDS_REDUCE, plan.spheres.div_ceil(k::BOUNDS_TILE), Phase::Survey),
        stage(&k::GRID_CONFIGURE, 1, Phase::Survey),
    ];
    if plan.algorithm == Algorithm::Naive {
        stages.push(stage(&k::NAIVE_SEARCH, plan.search_groups, Phase::Search));
    } else {
        stages.push(stage(&k::ENTRIES_EMIT, plan.spheres.div_ceil(k::GROUP), Phase::Entries));
        stages.push(stage(&k::ENTRIES_CLOSE, 1, Phase::Entries));
        stages.extend(sort_stages(plan.entries, plan.passes()));
        stages.push(stage(&k::RUNS_SEARCH, plan.entries.div_ceil(k::GROUP), Phase::Search));
        stages.push(stage(&k::CROWDED_OPEN, 1, Phase::Search));
        stages.push(Stage { indirect: true, ..stage(&k::CROWDED_SEARCH, 1, Phase::Search) });
    }
    stages.push(stage(&k::OUTCOME_FINISH, 1, Phase::Search));
    stages.retain(|stage| stage.groups > 0);
    stages
}

fn check(plan: &Plan, species: bool, limits: &DeviceLimits) -> Result<(), GpuError> {
    let limit = limits.bytes();
    let remedy = "split the spheres or take a device with a larger limit";
    let spheres = bytes_of(plan.spheres, 16);
    if spheres > limit {
        return Err(GpuError::LimitExceeded { what: "the sphere buffer", needed: spheres, limit, remedy });
    }
    if u64::from(plan.spheres) > k::MAX_ENTRY_OBJECTS {
        let (needed, limit) = (plan.spheres.into(), k::MAX_ENTRY_OBJECTS);
        return Err(GpuError::LimitExceeded { what: "the number of spheres", needed, limit, remedy });
    }
    for &(slot, needed) in &plan.buffers {
        if needed > limit {
            let (what, remedy) = match slot {
                Slot::Pairs => {
                    ("the pair buffer", "use a smaller pair capacity and take the result in parts")
                }
                _ => ("a buffer for entries", remedy),
            };
            return Err(GpuError::LimitExceeded { what, needed, limit, remedy });
        }
    }
    let variant = k::Variant { subgroups: None, species };
    let storage = |stage: &Stage| {
        stage.kernel.bindings(variant).filter(|b| b.access != k::Access::Uniform).count() as u64
    };
    let needed = plan.stages.iter().map(storage).max().unwrap_or(0);
    let limit = limits.storage_buffers.into();
    if needed > limit {
        let remedy = "request the adapter's own limits when making the device";
        return Err(GpuError::LimitExceeded {
            what: "a kernel's number of storage buffers",
            needed,
            limit,
            remedy,
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
