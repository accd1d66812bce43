//! The GPU kernels: WGSL sources and their metadata.

use crate::layout::{SearchParams, SortCounts};
use crate::wgsl;

mod includes;
mod sizes;
mod subgroup_probe;

use includes::INCLUDES;
use sizes::{SCAN_ITEMS, SPHERES_PER_THREAD};

pub use sizes::{
    BOUNDS_TILE, CANDIDATES_PER_INVOCATION, DEPTHS, DIGIT_BITS, MAX_ENTRIES_PER_SPHERE, MAX_ENTRY_OBJECTS,
    MAX_LOOP_ITERATIONS, NAIVE_ITERATIONS_PER_TILE, NAIVE_TILES, NEAR, OCCUPANCY_TILE, RADIX_TILE,
    RUN_ITERATIONS_PER_TILE, RUN_TILES, SCAN_TILE, SCANNED_AT_ONCE, WORKGROUP_SIZE,
};
pub use subgroup_probe::SubgroupProbe;

/// The use of a binding, whose number is its position in [`Kernel::bindings`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Access {
    Uniform,
    Read,
    ReadWrite,
}

impl Access {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Read => "read",
            Self::ReadWrite => "read_write",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct Binding {
    pub name: &'static str,
    pub access: Access,
}

const fn uniform(name: &'static str) -> Binding {
    Binding { name, access: Access::Uniform }
}

const fn read(name: &'static str) -> Binding {
    Binding { name, access: Access::Read }
}

const fn write(name: &'static str) -> Binding {
    Binding { name, access: Access::ReadWrite }
}

/// The properties of a call and a device that select a kernel's text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Variant {
    /// Smallest subgroup size, if subgroup operations are used.
    pub subgroups: Option<u32>,
    /// `true` if an interaction table decides pairs.
    pub species: bool,
    pub periodic: bool,
    /// `true` if a cell list reuses cells of an earlier call.
    pub reuse: bool,
}

/// Bytes of workgroup memory for the statistics of all sides. Every device has at least this much.
const SPECIES_MEMORY: u32 = 16 << 10;

impl Variant {
    /// Smallest subgroup size for which the ranking tables of a radix pass fit into workgroup memory.
    pub const MIN_RANKING_SUBGROUP: u32 = 8;

    /// Returns the variant for a device, with subgroup operations if `workgroup_memory` (bytes) suffices.
    pub fn for_device(smallest_subgroup: Option<u32>, workgroup_memory: u32) -> Self {
        let fits = |variant: Self| variant.workgroup_memory() <= workgroup_memory;
        // Ranking tables of small subgroups exceed the workgroup memory of some devices.
        let serves = |&size: &u32| size >= 4 && fits(Self { subgroups: Some(size), ..Self::default() });
        Self { subgroups: smallest_subgroup.filter(serves), ..Self::default() }
    }

    /// Returns an upper bound in bytes.
    pub fn workgroup_memory(self) -> u32 {
        let sort = self.radix_scratch() * 4 + 4096;
        if self.species { sort.max(SPECIES_MEMORY) } else { sort }
    }

    pub fn ranks_by_subgroup(self) -> bool {
        self.subgroups.is_some_and(|size| size >= Self::MIN_RANKING_SUBGROUP)
    }

    fn radix_scratch(self) -> u32 {
        let tables = match self.subgroups {
            Some(size) if self.ranks_by_subgroup() => WORKGROUP_SIZE / size * 128,
            _ => 8 * WORKGROUP_SIZE,
        };
        tables.max(RADIX_TILE)
    }
}

impl SortCounts {
    pub fn for_sort(items: u32) -> Self {
        Self { items, counters: items.div_ceil(RADIX_TILE) << DIGIT_BITS }
    }
}

#[derive(Debug, PartialEq, Eq)]
pub struct Kernel {
    /// Entry point and file name.
    pub name: &'static str,
    pub workgroup_size: u32,
    source: &'static str,
    bindings: &'static [Binding],
    species_bindings: &'static [Binding],
    uses_subgroups: bool,
    knows_periods: bool,
}

impl Kernel {
    pub fn bindings(&self, variant: Variant) -> impl Iterator<Item = Binding> + use<> {
        let species = if variant.species { self.species_bindings } else { &[] };
        self.bindings.iter().chain(species).copied()
    }

    /// Returns the part of a variant that changes this kernel's text.
    pub fn effective_variant(&self, variant: Variant) -> Variant {
        Variant {
            subgroups: variant.subgroups.filter(|_| self.uses_subgroups),
            species: variant.species && !self.species_bindings.is_empty(),
            periodic: variant.periodic && self.knows_periods,
            reuse: variant.reuse && self.source.contains("#ifdef REUSE"),
        }
    }

    pub fn variants(&self) -> Vec<Variant> {
        let subgroups = [None, Some(4), Some(8), Some(16), Some(32), Some(64), Some(128)];
        let mut found = Vec::new();
        for (subgroups, flags) in
            subgroups.into_iter().flat_map(|size| (0..8).map(move |flags| (size, flags)))
        {
            let [species, periodic, reuse] = [1, 2, 4].map(|flag| flags & flag != 0);
            let variant = self.effective_variant(Variant { subgroups, species, periodic, reuse });
            if !found.contains(&variant) {
                found.push(variant);
            }
        }
        found
    }

    pub fn wgsl(&self, variant: Variant) -> String {
        Preprocessor { variant: self.effective_variant(variant), strict: false }.expand(self.source)
    }

    /// Returns the text for strict compilers, such as in browsers. It has `enable subgroups;`, which naga 30 rejects,
    /// and turns off diagnostics for subgroup operations whose uniformity no compiler can prove.
    pub fn strict_wgsl(&self, variant: Variant) -> String {
        let variant = self.effective_variant(variant);
        let text = Preprocessor { variant, strict: true }.expand(self.source);
        if variant.subgroups.is_some() { format!("enable subgroups;\n{text}") } else { text }
    }
}

macro_rules! kernels {
    ($($(#[$doc:meta])* $id:ident = $folder:literal / $name:literal, $size:expr, subgroups: $sub:literal,
       periodic: $per:literal, [$($binding:expr),* $(,)?], species: [$($species:expr),* $(,)?];)*) => {
        $($(#[$doc])* pub static $id: Kernel = Kernel {
            name: $name,
            workgroup_size: $size,
            source: include_str!(concat!("shader/", $folder, "/", $name, ".wgsl")),
            bindings: &[$($binding),*],
            species_bindings: &[$($species),*],
            uses_subgroups: $sub,
            knows_periods: $per,
        };)*
        pub static KERNELS: [&Kernel; [$($name),*].len()] = [$(&$id),*];
    };
}

kernels! {
    SUBGROUP_PROBE = "probe" / "subgroup_probe", WORKGROUP_SIZE, subgroups: true, periodic: false, [write("probe")],
        species: [];
    CALL_BEGIN = "grid" / "call_begin", 1, subgroups: false, periodic: false,
        [uniform("params"), read("count_source"), write("bounds"), write("grid"), write("outcome")], species: [];
    SPHERES_WRAP = "grid" / "spheres_wrap", WORKGROUP_SIZE, subgroups: false, periodic: false,
        [uniform("params"), read("grid"), read("given"), write("wrapped")], species: [];
    BOUNDS_REDUCE = "grid" / "bounds_reduce", WORKGROUP_SIZE, subgroups: true, periodic: false,
        [uniform("params"), read("grid"), read("spheres"), write("bounds"), write("outcome")],
        species: [read("species"), read("species_params")];
    GRID_CONFIGURE = "grid" / "grid_configure", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), read("spheres"), write("bounds"), write("grid")], species: [];
    OCCUPANCY_CLEAR = "grid" / "occupancy_clear", WORKGROUP_SIZE, subgroups: false, periodic: false,
        [uniform("params"), read("grid"), write("occupancy")], species: [];
    CELLS_FIND = "grid" / "cells_find", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), read("grid"), read("spheres"), write("bounds"), write("cells"), write("occupancy")],
        species: [read("species"), read("species_params")];
    LEVELS_COUNT = "grid" / "levels_count", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), read("grid"), write("bounds"), read("cells"), write("occupancy")], species: [];
    LEVELS_ASSIGN_KEYS = "grid" / "levels_assign_keys", DEPTHS, subgroups: false, periodic: true,
        [uniform("params"), write("bounds"), write("grid")], species: [];
    ENTRIES_EMIT = "grid" / "entries_emit", WORKGROUP_SIZE, subgroups: true, periodic: true,
        [uniform("params"), read("grid"), read("cells"), write("occupancy"), write("outcome"), write("keys"),
         write("objects")], species: [];
    ENTRIES_FINISH = "grid" / "entries_finish", 1, subgroups: false, periodic: false,
        [uniform("params"), write("outcome"), write("sort_counts")], species: [];
    SCAN_REDUCE = "sort" / "scan_reduce", WORKGROUP_SIZE, subgroups: false, periodic: false,
        [read("sort_counts"), read("values"), write("sums")], species: [];
    SCAN_SPINE = "sort" / "scan_spine", WORKGROUP_SIZE, subgroups: false, periodic: false,
        [read("sort_counts"), write("sums"), write("total")], species: [];
    SCAN_SPREAD = "sort" / "scan_spread", WORKGROUP_SIZE, subgroups: true, periodic: false,
        [read("sort_counts"), read("sums"), write("values")], species: [];
    SCAN_ONCE = "sort" / "scan_once", WORKGROUP_SIZE, subgroups: true, periodic: false, [read("sort_counts"), write("values")], species: [];
    RADIX_COUNT = "sort" / "radix_count", WORKGROUP_SIZE, subgroups: false, periodic: false,
        [uniform("digit_pass"), read("sort_counts"), read("keys"), write("counts")], species: [];
    RADIX_SCAN = "sort" / "radix_scan", WORKGROUP_SIZE, subgroups: true, periodic: false,
        [read("sort_counts"), write("counts"), write("totals")], species: [];
    RADIX_SCATTER = "sort" / "radix_scatter", WORKGROUP_SIZE, subgroups: true, periodic: false,
        [uniform("digit_pass"), read("sort_counts"), read("keys"), read("payload"), read("counts"), read("totals"),
         write("sorted_keys"), write("sorted_payload")], species: [];
    RUNS_SEARCH_NEAR = "grid" / "runs_search_near", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), read("grid"), read("sort_counts"), read("keys"), read("objects"), read("spheres"),
         write("outcome"), write("pairs"), write("deferred")],
        species: [read("species"), read("table")];
    RUNS_SEARCH_FAR_DISPATCH_ARGS = "grid" / "runs_search_far_dispatch_args", 1, subgroups: false, periodic: false,
        [uniform("params"), write("outcome"), write("dispatch")], species: [];
    RUNS_SEARCH_FAR = "grid" / "runs_search_far", WORKGROUP_SIZE, subgroups: true, periodic: true,
        [uniform("params"), read("grid"), read("sort_counts"), read("keys"), read("objects"), read("spheres"),
         write("outcome"), write("pairs"), read("deferred")],
        species: [read("species"), read("table")];
    NAIVE_SEARCH = "grid" / "naive_search", WORKGROUP_SIZE, subgroups: true, periodic: true,
        [uniform("params"), read("grid"), read("spheres"), write("outcome"), write("pairs")],
        species: [read("species"), read("species_params"), read("table")];
    STATS_REDUCE = "cell_list" / "stats_reduce", WORKGROUP_SIZE, subgroups: true, periodic: false,
        [uniform("params"), read("count_source"), read("spheres"), write("stats"), write("starts"), write("occupancy")],
        species: [read("species"), read("species_params")];
    CELL_LIST_CONFIGURE = "cell_list" / "cell_list_configure", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), read("count_source"), read("spheres"), write("stats"), write("cell_list"), write("outcome"),
         write("sort_counts")],
        species: [read("species"), read("species_params")];
    CELL_LIST_SETUP_SMALL = "cell_list" / "cell_list_setup_small", WORKGROUP_SIZE, subgroups: true, periodic: true,
        [uniform("params"), read("count_source"), read("spheres"), write("stats"), write("cell_list"), write("outcome"),
         write("sort_counts"), write("starts"), write("occupancy")],
        species: [read("species"), read("species_params")];
    OCCUPANCY_COUNT = "cell_list" / "occupancy_count", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), read("cell_list"), read("spheres"), write("occupancy")],
        species: [read("species"), read("species_params")];
    CELLS_COUNT = "cell_list" / "cells_count", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), read("cell_list"), read("count_source"), read("spheres"), write("occupancy"), write("outcome"),
         write("starts"), write("cell_ranks")],
        species: [read("species"), read("species_params")];
    CELLS_KEY = "cell_list" / "cells_key", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), uniform("digit_pass"), read("cell_list"), read("sort_counts"), read("count_source"), read("spheres"),
         write("occupancy"), write("outcome"), write("keys"), write("counts")],
        species: [read("species"), read("species_params")];
    CELL_STARTS_FIND = "cell_list" / "cell_starts_find", WORKGROUP_SIZE, subgroups: false, periodic: false,
        [read("cell_list"), read("cells"), write("starts")], species: [];
    SPHERES_GATHER = "cell_list" / "spheres_gather", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), read("cell_list"), read("spheres"), read("cells"), read("order"), write("sorted"), write("outcome")],
        species: [read("species"), write("sorted_species")];
    SPHERES_SCATTER = "cell_list" / "spheres_scatter", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), read("cell_list"), read("spheres"), read("starts"), read("cell_ranks"), write("sorted"),
         write("cells"), write("order"), write("outcome")],
        species: [read("species"), write("sorted_species")];
    CELL_LIST_SEARCH = "cell_list" / "cell_list_search", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), read("cell_list"), read("starts"), read("sorted"), read("cells"), read("order"),
         write("outcome"), write("pairs"), write("deferred")],
        species: [read("sorted_species"), read("table")];
    CELL_LIST_SEARCH_OVERFLOW_DISPATCH_ARGS = "cell_list" / "cell_list_search_overflow_dispatch_args", 1, subgroups: false, periodic: false,
        [uniform("params"), write("outcome"), write("dispatch")], species: [];
    CELL_LIST_SEARCH_OVERFLOW = "cell_list" / "cell_list_search_overflow", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), read("cell_list"), read("starts"), read("sorted"), read("cells"), read("order"),
         write("outcome"), write("pairs"), read("deferred")],
        species: [read("sorted_species"), read("table")];
    SKIN_DISPLACEMENT = "skin" / "skin_displacement", WORKGROUP_SIZE, subgroups: true, periodic: true,
        [uniform("params"), uniform("skin"), read("count_source"), read("spheres"), read("reference"), write("state")],
        species: [read("species"), read("reference_species"), read("species_params")];
    SKIN_CHECK = "skin" / "skin_check", 64, subgroups: false, periodic: false,
        [uniform("params"), uniform("skin"), read("count_source"), write("state"), read("full_counts"), write("dispatch_counts"),
         write("dispatch")], species: [];
    SKIN_STORE_REFERENCE = "skin" / "skin_store_reference", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), uniform("skin"), read("spheres"), write("state"), write("reference")],
        species: [read("species"), write("reference_species")];
    CANDIDATES_TEST_DISPATCH_ARGS = "skin" / "candidates_test_dispatch_args", 1, subgroups: false, periodic: false,
        [uniform("params"), uniform("skin"), read("count_source"), write("found"), write("state"), write("outcome"),
         write("dispatch")], species: [];
    CANDIDATES_TEST = "skin" / "candidates_test", WORKGROUP_SIZE, subgroups: false, periodic: true,
        [uniform("params"), read("candidates"), write("state"), read("spheres"), write("outcome"), write("pairs")],
        species: [read("species"), read("table")];
    SPHERES_INTERLEAVE = "shared" / "spheres_interleave", WORKGROUP_SIZE, subgroups: false, periodic: false,
        [uniform("params"), uniform("columns"), read("count_source"), read("x"), read("y"), read("z"), read("r"),
         write("rows")], species: [];
    OUTCOME_FINISH = "shared" / "outcome_finish", 1, subgroups: false, periodic: false,
        [uniform("params"), write("outcome")], species: [];
}

struct Preprocessor {
    variant: Variant,
    strict: bool,
}

impl Preprocessor {
    fn expand(&self, source: &str) -> String {
        let text = wgsl::expand(source, &INCLUDES, &|name| self.is_defined(name));
        wgsl::repeated(&wgsl::with_constants(&text, &self.constants()))
    }

    fn is_defined(&self, name: &str) -> bool {
        match name {
            "SUBGROUPS" => self.variant.subgroups.is_some(),
            "SUBGROUP_RANKING" => self.variant.ranks_by_subgroup(),
            "SPECIES" => self.variant.species,
            "PERIODIC" => self.variant.periodic,
            "REUSE" => self.variant.reuse,
            "STANDARD" => self.strict,
            _ => false,
        }
    }

    fn constants(&self) -> [(&'static str, u32); 8] {
        let subgroup = self.variant.subgroups.unwrap_or(WORKGROUP_SIZE).clamp(1, WORKGROUP_SIZE);
        [
            ("NEAR", NEAR),
            ("RUN_TILES", RUN_TILES),
            ("MAX_SUBGROUPS", WORKGROUP_SIZE / subgroup),
            ("RADIX_ITEMS", RADIX_TILE / WORKGROUP_SIZE),
            ("RADIX_SCRATCH", self.variant.radix_scratch()),
            ("SCAN_ITEMS", SCAN_ITEMS),
            ("SPHERES_PER_THREAD", SPHERES_PER_THREAD),
            ("UNLIMITED", SearchParams::UNLIMITED),
        ]
    }
}

#[cfg(test)]
mod tests;
