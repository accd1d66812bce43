//! The GPU kernels: WGSL sources and what a host must know to run them. Nothing here calls a device.

use crate::layout::{Call, Lengths};
use crate::wgsl;

mod pieces;
mod sizes;

use pieces::PIECES;
use sizes::{SCAN_ITEMS, SPHERES_PER_THREAD};

pub use sizes::{
    BOUNDS_TILE, CROWDED_TILES, CROWDED_TURNS, DENSITY_TILE, DEPTHS, DIGIT_BITS, GROUP,
    MAX_ENTRIES_PER_SPHERE, MAX_ENTRY_OBJECTS, MAX_TURNS, NAIVE_TILES, NAIVE_TURNS, NARROW_TILE, SCAN_TILE,
    SCANNED_AT_ONCE, SHARE, WIDE_TILE,
};

/// The use of a binding by a kernel; the position in [`Kernel::bindings`] is the binding number of group 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Access {
    /// A uniform buffer.
    Uniform,
    /// A storage buffer that is only read.
    Read,
    /// A storage buffer that is read and written.
    ReadWrite,
}

/// One buffer that a kernel binds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Binding {
    /// The variable's name in the shader.
    pub name: &'static str,
    /// Its use.
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

/// The differences between the texts of one kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Variant {
    /// The device's smallest subgroup size where subgroup operations are to be used; `None` works everywhere.
    pub subgroups: Option<u32>,
    /// `true` if an interaction table decides what is a pair.
    pub species: bool,
    /// `true` if some axis is periodic.
    pub periodic: bool,
    /// `true` if a radix pass sorts tiles of [`WIDE_TILE`] keys instead of [`NARROW_TILE`], which takes 20 KiB of
    /// workgroup memory instead of 12 or more.
    pub wide: bool,
}

impl Variant {
    /// The smallest subgroup for which radix ranking by subgroups has room for its tables.
    pub const MIN_RANKING_SUBGROUP: u32 = 8;

    /// What a device is given of each kernel: subgroup operations where it offers them, with its smallest subgroup, and
    /// wide tiles where its workgroup memory, in bytes, has room for them. What else differs is up to the call.
    pub fn for_device(smallest_subgroup: Option<u32>, workgroup_memory: u32) -> Self {
        let fits = |variant: Self| variant.workgroup_memory() <= workgroup_memory;
        // Ranking tables of small subgroups need more workgroup memory than some devices have.
        let serves = |&size: &u32| size >= 4 && fits(Self { subgroups: Some(size), ..Self::default() });
        Self {
            subgroups: smallest_subgroup.filter(serves),
            wide: fits(Self { wide: true, ..Self::default() }),
            ..Self::default()
        }
    }

    /// Workgroup memory, in bytes, that no kernel of this variant exceeds.
    pub fn workgroup_memory(self) -> u32 {
        self.radix_scratch() * 4 + 4096
    }

    /// Returns `true` if subgroups rank the keys of a radix pass.
    pub fn ranks_by_subgroup(self) -> bool {
        self.subgroups.is_some_and(|size| size >= Self::MIN_RANKING_SUBGROUP)
    }

    fn radix_scratch(self) -> u32 {
        let tables = match self.subgroups {
            Some(size) if self.ranks_by_subgroup() => GROUP / size * 128,
            _ => 8 * GROUP,
        };
        tables.max(self.radix_tile())
    }

    /// Keys that one workgroup sorts in a radix pass.
    pub fn radix_tile(self) -> u32 {
        if self.wide { WIDE_TILE } else { NARROW_TILE }
    }
}

impl Lengths {
    /// The lengths for a sort of `items` keys in tiles of so many: a counter per digit and tile.
    pub fn for_sort(items: u32, tile: u32) -> Self {
        Self { items, counters: items.div_ceil(tile) << DIGIT_BITS }
    }
}

/// One compute stage.
#[derive(Debug, PartialEq, Eq)]
pub struct Kernel {
    /// Entry point, and the name of the file.
    pub name: &'static str,
    /// Threads per workgroup.
    pub group_size: u32,
    source: &'static str,
    bindings: &'static [Binding],
    species_bindings: &'static [Binding],
    uses_subgroups: bool,
    knows_periods: bool,
}

impl Kernel {
    /// The buffers that the kernel binds in group 0, by binding number.
    pub fn bindings(&self, variant: Variant) -> impl Iterator<Item = Binding> + use<> {
        let species = if variant.species { self.species_bindings } else { &[] };
        self.bindings.iter().chain(species).copied()
    }

    /// The part of a variant that changes this kernel's text.
    pub fn reduced(&self, variant: Variant) -> Variant {
        Variant {
            subgroups: variant.subgroups.filter(|_| self.uses_subgroups),
            species: variant.species && !self.species_bindings.is_empty(),
            periodic: variant.periodic && self.knows_periods,
            wide: variant.wide && self.source.contains("#{RADIX_ITEMS}"),
        }
    }

    /// Every variant in which the kernel's text differs, over all sizes that subgroups have.
    pub fn variants(&self) -> Vec<Variant> {
        let subgroups = [None, Some(4), Some(8), Some(16), Some(32), Some(64), Some(128)];
        let mut found = Vec::new();
        for (subgroups, flags) in
            subgroups.into_iter().flat_map(|size| (0..8).map(move |flags| (size, flags)))
        {
            let [species, periodic, wide] = [1, 2, 4].map(|flag| flags & flag != 0);
            let variant = self.reduced(Variant { subgroups, species, periodic, wide });
            if !found.contains(&variant) {
                found.push(variant);
            }
        }
        found
    }

    /// The kernel's complete WGSL text, as naga takes it.
    pub fn wgsl(&self, variant: Variant) -> String {
        Expansion { variant: self.reduced(variant), is_standard: false }.expand(self.source)
    }

    /// The same for compilers that go by the standard, such as those of browsers. They ask for subgroups to be
    /// enabled, which naga 30 refuses, and for leave to use them where only this library knows that a whole subgroup
    /// arrives, which makes naga warn.
    pub fn standard_wgsl(&self, variant: Variant) -> String {
        let variant = self.reduced(variant);
        let text = Expansion { variant, is_standard: true }.expand(self.source);
        if variant.subgroups.is_some() { format!("enable subgroups;\n{text}") } else { text }
    }
}

macro_rules! kernels {
    ($($(#[$doc:meta])* $id:ident = $name:literal, $size:expr, subgroups: $sub:literal,
       periodic: $per:literal, [$($binding:expr),* $(,)?], species: [$($species:expr),* $(,)?];)*) => {
        $($(#[$doc])* pub static $id: Kernel = Kernel {
            name: $name,
            group_size: $size,
            source: include_str!(concat!("shader/", $name, ".wgsl")),
            bindings: &[$($binding),*],
            species_bindings: &[$($species),*],
            uses_subgroups: $sub,
            knows_periods: $per,
        };)*
        /// Every kernel.
        pub static KERNELS: [&Kernel; [$($name),*].len()] = [$(&$id),*];
    };
}

kernels! {
    /// Clears what a call accumulates.
    CALL_BEGIN = "call_begin", 1, subgroups: false, periodic: false,
        [uniform("call"), read("count_source"), write("bounds"), write("grid"), write("outcome")], species: [];
    /// Moves each sphere to its image nearest to the origin.
    SPHERES_WRAP = "spheres_wrap", GROUP, subgroups: false, periodic: false,
        [uniform("call"), read("grid"), read("given"), write("wrapped")], species: [];
    /// Bounds of the valid spheres, number of the others.
    BOUNDS_REDUCE = "bounds_reduce", GROUP, subgroups: true, periodic: false,
        [uniform("call"), read("grid"), read("spheres"), write("bounds"), write("outcome")],
        species: [read("species"), read("reach")];
    /// Chooses the grid.
    GRID_CONFIGURE = "grid_configure", GROUP, subgroups: false, periodic: true,
        [uniform("call"), read("spheres"), write("bounds"), write("grid")], species: [];
    /// Clears the density table.
    DENSITY_CLEAR = "density_clear", GROUP, subgroups: false, periodic: false,
        [uniform("call"), read("grid"), write("density")], species: [];
    /// Finds each sphere's depth and cells.
    CELLS_FIND = "cells_find", GROUP, subgroups: false, periodic: true,
        [uniform("call"), read("grid"), read("spheres"), write("bounds"), write("cells"), write("density")],
        species: [read("species"), read("reach")];
    /// Counts the smaller spheres in cells of deeper levels.
    LEVELS_REFINE = "levels_refine", GROUP, subgroups: false, periodic: true,
        [uniform("call"), read("grid"), write("bounds"), read("cells"), write("density")], species: [];
    /// Shares the keys out among the levels.
    LEVELS_SETTLE = "levels_settle", DEPTHS, subgroups: false, periodic: true,
        [uniform("call"), write("bounds"), write("grid")], species: [];
    /// Writes one entry per overlapped cell and level.
    ENTRIES_EMIT = "entries_emit", GROUP, subgroups: true, periodic: true,
        [uniform("call"), read("grid"), read("cells"), write("density"), write("outcome"), write("keys"),
         write("objects")], species: [];
    /// Settles how many entries there are.
    ENTRIES_CLOSE = "entries_close", 1, subgroups: false, periodic: false,
        [uniform("call"), write("outcome"), write("lengths")], species: [];
    /// Sums of the tiles of a scan.
    SCAN_REDUCE = "scan_reduce", GROUP, subgroups: false, periodic: false,
        [read("lengths"), read("values"), write("sums")], species: [];
    /// Prefixes of those sums, and the total.
    SCAN_SPINE = "scan_spine", GROUP, subgroups: false, periodic: false,
        [read("lengths"), write("sums"), write("total")], species: [];
    /// Prefixes of all values, in place.
    SCAN_SPREAD = "scan_spread", GROUP, subgroups: true, periodic: false,
        [read("lengths"), read("sums"), write("values")], species: [];
    /// Prefixes of few values, in place and at once.
    SCAN_ONCE = "scan_once", GROUP, subgroups: true, periodic: false, [read("lengths"), write("values")], species: [];
    /// Digit counts of a radix pass.
    RADIX_COUNT = "radix_count", GROUP, subgroups: false, periodic: false,
        [uniform("digit_pass"), read("lengths"), read("keys"), write("counts")], species: [];
    /// Prefixes of the counts of each digit.
    RADIX_SCAN = "radix_scan", GROUP, subgroups: true, periodic: false,
        [read("lengths"), write("counts"), write("totals")], species: [];
    /// Moves keys and payload to their places.
    RADIX_SCATTER = "radix_scatter", GROUP, subgroups: true, periodic: false,
        [uniform("digit_pass"), read("lengths"), read("keys"), read("payload"), read("counts"), read("totals"),
         write("sorted_keys"), write("sorted_payload")], species: [];
    /// Pairs of entries close together in a run.
    RUNS_SEARCH = "runs_search", GROUP, subgroups: false, periodic: true,
        [uniform("call"), read("grid"), read("lengths"), read("keys"), read("objects"), read("spheres"),
         write("outcome"), write("pairs"), write("crowded")],
        species: [read("species"), read("table")];
    /// Sizes the crowded search.
    CROWDED_OPEN = "crowded_open", 1, subgroups: false, periodic: false,
        [uniform("call"), write("outcome"), write("dispatch")], species: [];
    /// Pairs of entries far apart in a crowded run.
    CROWDED_SEARCH = "crowded_search", GROUP, subgroups: true, periodic: true,
        [uniform("call"), read("grid"), read("lengths"), read("keys"), read("objects"), read("spheres"),
         write("outcome"), write("pairs"), read("crowded")],
        species: [read("species"), read("table")];
    /// All pairs.
    NAIVE_SEARCH = "naive_search", GROUP, subgroups: true, periodic: true,
        [uniform("call"), read("grid"), read("spheres"), write("outcome"), write("pairs")],
        species: [read("species"), read("reach"), read("table")];
    /// Bounds and sizes of the spheres of a cell list.
    SPHERES_SURVEY = "spheres_survey", GROUP, subgroups: true, periodic: false,
        [uniform("call"), read("count_source"), read("spheres"), write("survey"), write("starts"), write("density")],
        species: [read("species"), read("reach")];
    /// Chooses the cells of a cell list.
    LIST_CONFIGURE = "list_configure", GROUP, subgroups: false, periodic: true,
        [uniform("call"), read("count_source"), read("spheres"), write("survey"), write("list"), write("outcome"),
         write("lengths")],
        species: [read("species"), read("reach")];
    /// Both of few spheres.
    LIST_BEGIN = "list_begin", GROUP, subgroups: true, periodic: true,
        [uniform("call"), read("count_source"), read("spheres"), write("survey"), write("list"), write("outcome"),
         write("lengths"), write("starts"), write("density")],
        species: [read("species"), read("reach")];
    /// Counts the spheres in each cell of the first level.
    DENSITY_COUNT = "density_count", GROUP, subgroups: false, periodic: true,
        [uniform("call"), read("list"), read("spheres"), write("density")],
        species: [read("species"), read("reach")];
    /// Finds each sphere's cell and counts those of each cell.
    HOMES_COUNT = "homes_count", GROUP, subgroups: false, periodic: true,
        [uniform("call"), read("list"), read("spheres"), write("density"), write("outcome"), write("starts"),
         write("homes")],
        species: [read("species"), read("reach")];
    /// Finds each sphere's cell as a key to sort by.
    HOMES_KEY = "homes_key", GROUP, subgroups: false, periodic: true,
        [uniform("call"), uniform("digit_pass"), read("list"), read("lengths"), read("spheres"), write("density"),
         write("outcome"), write("keys"), write("counts")],
        species: [read("species"), read("reach")];
    /// The start of each cell's spheres.
    CELLS_INDEX = "cells_index", GROUP, subgroups: false, periodic: false,
        [read("list"), read("cells"), write("starts")], species: [];
    /// Brings the spheres into the order of their cells.
    SPHERES_GATHER = "spheres_gather", GROUP, subgroups: false, periodic: true,
        [uniform("call"), read("list"), read("spheres"), read("order"), write("sorted")],
        species: [read("species"), write("sorted_species")];
    /// Puts the spheres in the order of their cells.
    SPHERES_PLACE = "spheres_place", GROUP, subgroups: false, periodic: true,
        [uniform("call"), read("list"), read("spheres"), read("starts"), read("homes"), write("sorted"),
         write("cells"), write("order")],
        species: [read("species"), write("sorted_species")];
    /// Pairs of each sphere with the first share of its candidates.
    LIST_SEARCH = "list_search", GROUP, subgroups: false, periodic: true,
        [uniform("call"), read("list"), read("starts"), read("sorted"), read("cells"), read("order"),
         write("outcome"), write("pairs"), write("crowded")],
        species: [read("sorted_species"), read("table")];
    /// Sizes the search of further shares.
    SHARES_OPEN = "shares_open", 1, subgroups: false, periodic: false,
        [uniform("call"), write("outcome"), write("dispatch")], species: [];
    /// Pairs of each sphere of a crowded block with a further share of its candidates.
    SHARES_SEARCH = "shares_search", GROUP, subgroups: false, periodic: true,
        [uniform("call"), read("list"), read("starts"), read("sorted"), read("cells"), read("order"),
         write("outcome"), write("pairs"), read("crowded")],
        species: [read("sorted_species"), read("table")];
    /// The displacements of spheres since the candidates were found.
    SKIN_MEASURE = "skin_measure", GROUP, subgroups: true, periodic: true,
        [uniform("call"), uniform("skin"), read("count_source"), read("spheres"), read("kept"), write("state")],
        species: [read("species"), read("kept_species")];
    /// Decides whether candidates are found anew.
    SKIN_DECIDE = "skin_decide", 64, subgroups: false, periodic: false,
        [uniform("call"), uniform("skin"), read("count_source"), write("state"), read("full"), write("gate"),
         write("dispatch")], species: [];
    /// Keeps the spheres, widened, where candidates are found anew.
    SKIN_KEEP = "skin_keep", GROUP, subgroups: false, periodic: true,
        [uniform("call"), uniform("skin"), read("spheres"), write("state"), write("kept")],
        species: [read("species"), write("kept_species")];
    /// Sizes the test of the candidates.
    CANDIDATES_OPEN = "candidates_open", 1, subgroups: false, periodic: false,
        [uniform("call"), uniform("skin"), read("count_source"), write("found"), write("state"), write("outcome"),
         write("dispatch")], species: [];
    /// Pairs among the candidates.
    CANDIDATES_TEST = "candidates_test", GROUP, subgroups: false, periodic: true,
        [uniform("call"), read("candidates"), write("state"), read("spheres"), write("outcome"), write("pairs")],
        species: [read("species"), read("table")];
    /// Overflow flag and indirect-dispatch arguments.
    OUTCOME_FINISH = "outcome_finish", 1, subgroups: false, periodic: false,
        [uniform("call"), write("outcome")], species: [];
}

/// A text with its pieces in place, and `#{NAME}` as what it stands for. What is behind `#standard` is only in the text
/// for compilers that go by the standard.
struct Expansion {
    variant: Variant,
    is_standard: bool,
}

impl Expansion {
    fn expand(&self, source: &str) -> String {
        let mut text = wgsl::expand(source, &PIECES, &|name| self.is_defined(name));
        for (name, value) in self.constants() {
            text = text.replace(&format!("#{{{name}}}"), &value.to_string());
        }
        wgsl::repeated(&text)
    }

    fn is_defined(&self, name: &str) -> bool {
        match name {
            "SUBGROUPS" => self.variant.subgroups.is_some(),
            "SUBGROUP_RANKING" => self.variant.ranks_by_subgroup(),
            "SPECIES" => self.variant.species,
            "PERIODIC" => self.variant.periodic,
            "STANDARD" => self.is_standard,
            _ => false,
        }
    }

    fn constants(&self) -> [(&'static str, u32); 7] {
        [
            ("CROWDED_TILES", CROWDED_TILES),
            ("MAX_SUBGROUPS", GROUP / self.variant.subgroups.unwrap_or(GROUP).clamp(1, GROUP)),
            ("RADIX_ITEMS", self.variant.radix_tile() / GROUP),
            ("RADIX_SCRATCH", self.variant.radix_scratch()),
            ("SCAN_ITEMS", SCAN_ITEMS),
            ("SPHERES_PER_THREAD", SPHERES_PER_THREAD),
            ("UNPARTED", Call::UNPARTED),
        ]
    }
}

#[cfg(test)]
mod tests;
