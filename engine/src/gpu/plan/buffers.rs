use encase::ShaderType;
use lazygrid_kernels::kernel as k;
use lazygrid_kernels::layout::{Bounds, Grid, Outcome, SortCounts};

use super::Plan;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum BufferId {
    Bounds,
    Grid,
    Outcome,
    Pairs,
    Rows,
    Wrapped,
    Cells,
    Density,
    SortCounts,
    Keys(bool),
    Objects(bool),
    Counts,
    Totals,
    Sums,
    Total,
    Crowded,
    DispatchArgs,
    InputStats,
    List,
    Starts,
    Homes,
    Sorted,
    SortedSpecies,
    ReferenceSpheres,
    ReferenceSpecies,
    SkinState,
    DispatchCounts,
}

impl BufferId {
    pub(crate) fn usage(self) -> BufferUsage {
        BufferUsage {
            storage: true,
            copy_src: true,
            indirect: matches!(self, Self::Outcome | Self::DispatchArgs | Self::DispatchCounts),
            copy_dst: matches!(self, Self::Total | Self::Starts),
            uniform: false,
        }
    }

    pub(crate) fn name(self) -> String {
        let mut name = String::new();
        for letter in format!("{self:?}").replace("(false)", "_0").replace("(true)", "_1").chars() {
            if letter.is_ascii_uppercase() && !name.is_empty() {
                name.push('_');
            }
            name.push(letter.to_ascii_lowercase());
        }
        name
    }
}

/// Buffer usages, named as in WebGPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
#[expect(clippy::struct_excessive_bools, reason = "a set of flags")]
pub struct BufferUsage {
    /// Storage binding.
    pub storage: bool,
    /// Uniform binding.
    pub uniform: bool,
    /// Source of indirect workgroup counts.
    pub indirect: bool,
    /// Source of copies.
    pub copy_src: bool,
    /// Destination of copies.
    pub copy_dst: bool,
}

impl BufferUsage {
    /// Names of the usages, in lower case.
    pub fn names(self) -> Vec<&'static str> {
        let Self { storage, uniform, indirect, copy_src, copy_dst } = self;
        let all = [
            (storage, "storage"),
            (uniform, "uniform"),
            (indirect, "indirect"),
            (copy_src, "copy_src"),
            (copy_dst, "copy_dst"),
        ];
        all.into_iter().filter(|(used, _)| *used).map(|(_, name)| name).collect()
    }
}

impl From<BufferUsage> for wgpu::BufferUsages {
    fn from(usage: BufferUsage) -> Self {
        let BufferUsage { storage, uniform, indirect, copy_src, copy_dst } = usage;
        let mut usages = Self::empty();
        usages.set(Self::STORAGE, storage);
        usages.set(Self::UNIFORM, uniform);
        usages.set(Self::INDIRECT, indirect);
        usages.set(Self::COPY_SRC, copy_src);
        usages.set(Self::COPY_DST, copy_dst);
        usages
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Resource {
    Own(BufferId),
    Spheres,
    Column(usize),
    Columns,
    Count,
    Species,
    SearchParams(u32),
    RadixPass(u32),
    SpeciesParams,
    /// [`SpeciesParams`](Self::SpeciesParams), but on narrow sides for distances to the own side only.
    SpeciesParamsBySide,
    Table,
}

pub(super) const COLUMN_NAMES: [&str; 4] = ["x", "y", "z", "r"];

pub(crate) fn column_named(binding: &str) -> Option<usize> {
    COLUMN_NAMES.iter().position(|name| *name == binding)
}

pub(super) fn call_buffers(pairs: u32) -> [(BufferId, u64); 4] {
    [
        (BufferId::Bounds, size_of::<Bounds>() as u64),
        (BufferId::Grid, Grid::min_size().get()),
        (BufferId::Outcome, size_of::<Outcome>() as u64),
        (BufferId::Pairs, bytes_of(pairs, 8)),
    ]
}

pub(super) fn cell_buffers(plan: &Plan) -> [(BufferId, u64); 2] {
    [(BufferId::Cells, bytes_of(plan.spheres, 8)), (BufferId::Density, bytes_of(plan.occupancy_slots, 8))]
}

pub(super) fn entry_buffers(entries: u32) -> Vec<(BufferId, u64)> {
    let mut buffers = sort_buffers(entries).to_vec();
    buffers.extend([
        (BufferId::SortCounts, size_of::<SortCounts>() as u64),
        (BufferId::Crowded, bytes_of(entries.div_ceil(k::WORKGROUP_SIZE), 4)),
        (BufferId::DispatchArgs, 16),
    ]);
    buffers
}

pub(crate) fn sort_buffers(items: u32) -> [(BufferId, u64); 6] {
    [
        (BufferId::Keys(false), bytes_of(items, 4)),
        (BufferId::Keys(true), bytes_of(items, 4)),
        (BufferId::Objects(false), bytes_of(items, 4)),
        (BufferId::Objects(true), bytes_of(items, 4)),
        (BufferId::Counts, bytes_of(SortCounts::for_sort(items).counters, 4)),
        (BufferId::Totals, bytes_of(1 << k::DIGIT_BITS, 4)),
    ]
}

/// Returns at least 16 bytes, because an empty buffer cannot be bound.
pub(super) fn bytes_of(count: u32, size: u64) -> u64 {
    (u64::from(count) * size).max(16)
}
