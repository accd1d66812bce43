//! The buffers and dispatches of a call, as pure functions of sizes, settings and limits.
//!
//! [`Planner`] makes a [`CallPlan`] for any program that compiles WGSL.

mod buffers;
mod call_plan;
mod cell_list;
mod cost;
mod dispatches;
mod limits;
mod planner;
#[cfg(feature = "serde")]
mod serialize;
mod sides;
pub(super) mod skin;
mod tables;
mod work_budget;

use lazygrid_kernels::Algorithm;
use lazygrid_kernels::kernel as k;
pub use lazygrid_kernels::kernel::SubgroupProbe;
use lazygrid_kernels::layout::{ColumnLayout, Outcome, RadixPass};

use crate::Error;

pub use buffers::BufferUsage;
pub(crate) use buffers::{BufferId, Resource};
use buffers::{bytes_of, call_buffers, cell_buffers, entry_buffers};
pub(super) use buffers::{column_named, sort_buffers};
pub(crate) use call_plan::CallConstants;
pub use call_plan::{
    BufferSource, CallPlan, DispatchSequence, PlanBuffer, PlanDispatch, PlanKernel, Workgroups,
};
pub use cost::CallCost;
pub(crate) use dispatches::Dispatch;
pub use dispatches::GpuPhase;
use dispatches::dispatches;
pub(super) use dispatches::{flattened, scan_dispatches, sort_dispatches};
pub use limits::DeviceLimits;
pub(crate) use planner::CallSettings;
pub use planner::Planner;
pub(crate) use sides::Sides;
pub(crate) use tables::TableBytes;
pub(crate) use work_budget::{WorkBudget, tests_within_limit};

/// Workgroups of a naive search that fill today's largest devices.
const SEARCH_GROUPS: u64 = 2048;
/// Entries that the search of far pairs in a run distributes over one dimension, even if all are in one cell.
const MAX_ENTRIES: u64 = 65_535 * (k::RUN_TILES * k::WORKGROUP_SIZE) as u64;
/// Spheres whose candidates fit the workgroups of one dimension, one per chunk after the first. Below
/// [`k::MAX_ENTRY_OBJECTS`].
const MAX_SPHERES: u64 = 65_536 * k::CANDIDATES_PER_INVOCATION as u64;
/// Hashed keys need three bits per axis at each of up to 32 levels.
const MIN_KEY_BITS: u32 = 16;
/// Half of the table; fits the caches of current devices.
const MAX_OCCUPANCY_SLOTS: u32 = 1 << 22;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Request {
    pub(crate) spheres: u32,
    pub(crate) pairs: u32,
    pub(crate) entries: u32,
    pub(crate) algorithm: Algorithm,
    /// `true` with a table of interactions, which may be empty.
    pub(crate) has_species: bool,
    pub(crate) periodic: bool,
    pub(crate) columns: Option<ColumnLayout>,
    pub(crate) radix_sort_from: u32,
    pub(crate) max_tests: u64,
    pub(crate) deferred_parts: u32,
}

/// Cells that pass smaller spheres to the next level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub(crate) enum SplitPolicy {
    None = 0,
    Every = 1,
    Dense = 2,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Plan {
    pub(crate) algorithm: Algorithm,
    pub(crate) spheres: u32,
    pub(crate) pairs: u32,
    pub(crate) entries: u32,
    pub(crate) key_bits: u32,
    pub(crate) split_policy: SplitPolicy,
    pub(crate) periodic: bool,
    pub(crate) columns: Option<ColumnLayout>,
    /// Counters in either half of the occupancy table, or of a cell list; 0 without one.
    pub(crate) occupancy_slots: u32,
    pub(crate) cells: u32,
    pub(crate) counters: u32,
    /// Keys per workgroup of a radix pass; 0 for a counting sort.
    pub(crate) tile: u32,
    pub(crate) candidates_per_invocation: u32,
    /// 0 if the device defers blocks.
    pub(crate) chunks_per_block: u32,
    pub(crate) search_groups: u32,
    pub(crate) budget: WorkBudget,
    pub(crate) deferred_parts: u32,
    pub(crate) reuses_layout: bool,
    pub(crate) buffers: Vec<(BufferId, u64)>,
    pub(crate) dispatches: Vec<Dispatch>,
}

pub(crate) fn plan(request: &Request, limits: &DeviceLimits) -> Result<Plan, Error> {
    let algorithm = request.algorithm;
    let split_policy = match algorithm {
        Algorithm::Naive | Algorithm::ArrayGrid | Algorithm::CellList => SplitPolicy::None,
        Algorithm::EagerGrid => SplitPolicy::Every,
        Algorithm::LazyGrid => SplitPolicy::Dense,
        other => return Err(Error::NotOnBackend { algorithm: other, backend: crate::Backend::Gpu }),
    };
    let mut plan = Plan {
        algorithm,
        spheres: request.spheres,
        pairs: request.pairs,
        entries: 0,
        key_bits: 0,
        split_policy,
        periodic: request.periodic,
        columns: request.columns,
        occupancy_slots: 0,
        cells: 0,
        counters: 0,
        tile: k::RADIX_TILE,
        candidates_per_invocation: k::CANDIDATES_PER_INVOCATION,
        chunks_per_block: 0,
        search_groups: 0,
        budget: WorkBudget { tests: request.max_tests, row: limits.groups_per_dimension },
        deferred_parts: request.deferred_parts.max(1),
        reuses_layout: false,
        buffers: call_buffers(request.pairs).to_vec(),
        dispatches: Vec::new(),
    };
    if request.columns.is_some() {
        plan.buffers.push((BufferId::Rows, bytes_of(request.spheres, 16)));
    }
    if request.periodic && algorithm != Algorithm::CellList {
        plan.buffers.push((BufferId::Wrapped, bytes_of(request.spheres, 16)));
    }
    if algorithm == Algorithm::Naive {
        plan.search_groups = naive_groups(request.spheres, limits)?;
    } else if algorithm == Algorithm::CellList {
        cell_list::size(&mut plan, request, limits);
        plan.buffers.extend(cell_list::buffers(&plan, request.has_species));
    } else {
        plan.entries = entry_capacity(request, limits)?;
        plan.key_bits = key_bits(request.spheres);
        if split_policy == SplitPolicy::Dense {
            plan.occupancy_slots = occupancy_slots(request.spheres);
        }
        plan.buffers.extend(cell_buffers(&plan));
        plan.buffers.extend(entry_buffers(plan.entries));
    }
    plan.dispatches = dispatches(&plan);
    check(&plan, request.has_species, limits)?;
    Ok(plan)
}

impl Plan {
    pub(crate) fn bytes(&self) -> u64 {
        self.buffers.iter().map(|(_, bytes)| bytes).sum()
    }

    fn naive_tests_per_group(&self) -> u64 {
        let blocks = u64::from(self.spheres.div_ceil(k::WORKGROUP_SIZE)).max(1);
        let groups_per_block = (u64::from(self.search_groups) / blocks).clamp(1, blocks);
        blocks.div_ceil(groups_per_block) * u64::from(k::WORKGROUP_SIZE).pow(2)
    }

    /// Counts a part per dispatch of a divided or deferred search; the last divided and the first deferred one share a
    /// part.
    pub(crate) fn parts(&self) -> u32 {
        let divided = self.dispatches.iter().filter(|dispatch| dispatch.first_group > 0).count();
        let deferred = self.dispatches.iter().filter(|dispatch| dispatch.indirect).count();
        (1 + divided + deferred.saturating_sub(1)) as u32
    }

    pub(crate) fn deferred_parts_for(&self, outcome: &Outcome) -> u32 {
        let tiles = match self.algorithm {
            Algorithm::CellList => self.candidates_per_invocation / k::WORKGROUP_SIZE,
            _ => 1,
        };
        let tiles_per_block = outcome.deferred_max_tiles.max(1).saturating_mul(tiles);
        outcome.deferred_blocks.div_ceil((self.budget.tiles() / tiles_per_block).max(1))
    }

    pub(crate) fn passes(&self) -> u32 {
        self.key_bits.div_ceil(k::DIGIT_BITS)
    }

    pub(crate) fn digits(&self) -> Vec<RadixPass> {
        // A cell list sorts the positions of its keys.
        digits(self.key_bits, self.algorithm == Algorithm::CellList)
    }

    pub(crate) fn order(&self) -> BufferId {
        BufferId::Objects(self.passes() % 2 == 1)
    }

    pub(crate) fn resource(&self, dispatch: &Dispatch, binding: &str) -> Resource {
        // Each pass reads the output of the previous one; the parity names the last output.
        let front = match dispatch.phase {
            GpuPhase::Sort => dispatch.pass % 2 == 1,
            GpuPhase::Search => self.passes() % 2 == 1,
            GpuPhase::Survey | GpuPhase::Entries => false,
        };
        if let Some(column) = column_named(binding) {
            return Resource::Column(column);
        }
        let input_rows =
            if self.columns.is_some() { Resource::Own(BufferId::Rows) } else { Resource::Spheres };
        Resource::Own(match binding {
            "params" => return Resource::SearchParams(dispatch.first_group),
            "count_source" => return Resource::Count,
            "digit_pass" => return Resource::RadixPass(dispatch.pass),
            "columns" => return Resource::Columns,
            "rows" => BufferId::Rows,
            "given" => return input_rows,
            "spheres" if !self.periodic || self.algorithm == Algorithm::CellList => return input_rows,
            "spheres" | "wrapped" => BufferId::Wrapped,
            "species" => return Resource::Species,
            "species_params" => return Resource::SpeciesParams,
            "table" => return Resource::Table,
            "stats" => BufferId::InputStats,
            "cell_list" => BufferId::List,
            "starts" | "values" => BufferId::Starts,
            "cell_ranks" => BufferId::Homes,
            "sorted" => BufferId::Sorted,
            "sorted_species" => BufferId::SortedSpecies,
            "cells" if self.algorithm == Algorithm::CellList => BufferId::Keys(front),
            "order" => BufferId::Objects(front),
            "bounds" => BufferId::Bounds,
            "grid" => BufferId::Grid,
            "outcome" => BufferId::Outcome,
            "pairs" => BufferId::Pairs,
            "sort_counts" => BufferId::SortCounts,
            "keys" => BufferId::Keys(front),
            "objects" | "payload" => BufferId::Objects(front),
            "sorted_keys" => BufferId::Keys(!front),
            "sorted_payload" => BufferId::Objects(!front),
            "counts" => BufferId::Counts,
            "totals" => BufferId::Totals,
            "sums" => BufferId::Sums,
            "total" => BufferId::Total,
            "cells" => BufferId::Cells,
            "occupancy" => BufferId::Density,
            "deferred" => BufferId::Crowded,
            "dispatch" => BufferId::DispatchArgs,
            other => unreachable!("no kernel binds `{other}`"),
        })
    }
}

/// Returns the digits, least significant first: as few as possible, of about equal width.
pub(super) fn digits(bits: u32, is_counted: bool) -> Vec<RadixPass> {
    let passes = bits.div_ceil(k::DIGIT_BITS);
    let width = bits.div_ceil(passes.max(1));
    let digit = |pass: u32| {
        let shift = pass * width;
        let mask = u32::MAX >> (u32::BITS - width.min(bits - shift));
        RadixPass { shift, mask, is_first: u32::from(is_counted && pass == 0) }
    };
    (0..passes).map(digit).collect()
}

pub(super) fn most_spheres(limits: &DeviceLimits) -> u64 {
    (limits.bytes() / 16).min(MAX_SPHERES)
}

pub(super) fn most_entries(limits: &DeviceLimits) -> u64 {
    (limits.bytes() / 4).min(MAX_ENTRIES)
}

/// Returns eight entries per sphere, the most at one level, or as many as the device can bind. Several levels rarely
/// need more, and unused capacity costs workgroups without work.
fn entry_capacity(request: &Request, limits: &DeviceLimits) -> Result<u32, Error> {
    let spheres = request.spheres;
    let wanted = (u64::from(spheres) * k::MAX_ENTRIES_PER_SPHERE).max(request.entries.into());
    let entries = wanted.min(most_entries(limits));
    if entries < u64::from(spheres) {
        return Err(Error::LimitExceeded {
            what: "the list of (cell, object) entries, at least one per sphere,",
            needed: u64::from(spheres) * 4,
            limit: most_entries(limits) * 4,
            remedy: "split the spheres",
        });
    }
    Ok(entries as u32)
}

fn naive_groups(spheres: u32, limits: &DeviceLimits) -> Result<u32, Error> {
    let blocks = u64::from(spheres.div_ceil(k::WORKGROUP_SIZE)).max(1);
    let needed = (blocks * blocks.div_ceil(k::NAIVE_TILES.into())).max(SEARCH_GROUPS.min(blocks * blocks));
    let limit = u64::from(limits.groups_per_dimension).pow(2).min(u32::MAX.into());
    if needed > limit {
        let (what, remedy) = ("the number of workgroups for all pairs", "choose array-grid");
        return Err(Error::LimitExceeded { what, needed, limit, remedy });
    }
    Ok(needed as u32)
}

/// Larger grids are hashed.
fn key_bits(spheres: u32) -> u32 {
    let bits = u32::BITS - spheres.max(2).leading_zeros();
    bits.next_multiple_of(k::DIGIT_BITS).max(MIN_KEY_BITS)
}

/// Returns half as many slots as spheres, because most spheres share cells.
fn occupancy_slots(spheres: u32) -> u32 {
    (spheres.max(512) / 2 + 1).next_power_of_two().min(MAX_OCCUPANCY_SLOTS)
}

const SPLIT: &str = "split the spheres or take a device with a larger limit";

pub(super) fn check_buffers(buffers: &[(BufferId, u64)], limits: &DeviceLimits) -> Result<(), Error> {
    let limit = limits.bytes();
    for &(id, needed) in buffers {
        if needed > limit {
            let (what, remedy) = match id {
                BufferId::Pairs => {
                    ("the pair buffer", "use a smaller pair capacity and take the result in parts")
                }
                BufferId::ReferenceSpheres | BufferId::ReferenceSpecies => ("the sphere buffer", SPLIT),
                _ => ("a buffer for entries", SPLIT),
            };
            return Err(Error::LimitExceeded { what, needed, limit, remedy });
        }
    }
    Ok(())
}

fn check(plan: &Plan, species: bool, limits: &DeviceLimits) -> Result<(), Error> {
    let limit = limits.bytes();
    let remedy = SPLIT;
    let columns = plan.columns.map(|columns| columns.bytes(plan.spheres));
    let needed = columns.into_iter().flatten().fold(bytes_of(plan.spheres, 16), u64::max);
    if needed > limit {
        return Err(Error::LimitExceeded { what: "the sphere buffer", needed, limit, remedy });
    }
    if u64::from(plan.spheres) > MAX_SPHERES {
        let (needed, limit) = (plan.spheres.into(), MAX_SPHERES);
        return Err(Error::LimitExceeded { what: "the number of spheres", needed, limit, remedy });
    }
    check_buffers(&plan.buffers, limits)?;
    if plan.dispatches.iter().any(|dispatch| dispatch.indirect) {
        limits.check_indirect()?;
    }
    let variant = k::Variant { species, periodic: plan.periodic, ..k::Variant::default() };
    let storage = |dispatch: &Dispatch| {
        dispatch.kernel.bindings(variant).filter(|b| b.access != k::Access::Uniform).count() as u64
    };
    let needed = plan.dispatches.iter().map(storage).max().unwrap_or(0);
    let limit = limits.storage_buffers.into();
    if needed > limit {
        let remedy = "request the adapter's own limits when making the device";
        return Err(Error::LimitExceeded {
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
