use std::sync::Arc;

use lazygrid_kernels::Algorithm;
use lazygrid_kernels::kernel::{
    Access, Binding, CELL_LIST_SEARCH_OVERFLOW_DISPATCH_ARGS, Kernel, RUNS_SEARCH_FAR_DISPATCH_ARGS, Variant,
};
use lazygrid_kernels::layout::{Outcome, SearchParams};

use super::buffers::{BufferUsage, COLUMN_NAMES};
use super::limits::DeviceLimits;
use super::tables::TableBytes;
use super::{BufferId, CallCost, Dispatch, GpuPhase, Plan, Resource, cell_list, flattened};

/// A call, planned without a device.
///
/// The feature `serde` serializes plans. `docs/page.md` describes the format, and how to run a call.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct CallPlan {
    /// Algorithm, never `Auto`.
    pub algorithm: Algorithm,
    /// Number of spheres, the largest if a buffer holds it.
    pub spheres: u32,
    /// Capacity of the pair buffer.
    pub pair_capacity: u32,
    /// Buffers, to which dispatches refer by position.
    pub buffers: Vec<PlanBuffer>,
    /// Kernels and dispatches.
    pub sequence: DispatchSequence,
    /// Position of the [`Outcome`] buffer.
    pub outcome: usize,
    /// Position of the pair buffer, two `u32` indices per pair.
    pub pairs: usize,
    /// Cost of the call.
    pub cost: CallCost,
    /// Device limits that the call requires.
    pub requirements: DeviceLimits,
}

/// A buffer of a plan.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PlanBuffer {
    /// A name, unique in the plan.
    pub name: String,
    /// Minimum size in bytes.
    pub size: u64,
    /// Minimum usage.
    pub usage: BufferUsage,
    /// Origin of the contents.
    pub source: BufferSource,
    pub(crate) resource: Resource,
}

impl PlanBuffer {
    /// Bytes of a constant; empty for other buffers.
    pub fn constant(&self) -> &[u8] {
        match &self.source {
            BufferSource::Constant(bytes) => bytes,
            BufferSource::Input | BufferSource::Working => &[],
        }
    }
}

/// The origin of a buffer's contents.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BufferSource {
    /// Written by the host: `spheres` (`x, y, z, r` as `f32` rows) or the columns `x`, `y`, `z` and `r`, `species` (a
    /// `u32` per sphere), `count` (a `u32`).
    Input,
    /// These bytes, written before the call and never changed.
    Constant(Arc<[u8]>),
    /// Written by kernels; filled with zeros before the first call.
    Working,
}

/// Kernels and the dispatches that run them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct DispatchSequence {
    /// Distinct kernels.
    pub kernels: Vec<PlanKernel>,
    /// The dispatches in order, each after its predecessors' writes.
    pub dispatches: Vec<PlanDispatch>,
    /// First dispatch of a continuation; the number of dispatches if calls have one part.
    pub continuation: usize,
    /// First dispatch of each part after the first. Parts of about 200 ms may be submitted separately.
    pub part_starts: Vec<usize>,
}

/// A kernel variant of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlanKernel {
    pub(crate) kernel: &'static Kernel,
    pub(crate) variant: Variant,
}

impl PlanKernel {
    /// Entry point.
    pub fn entry_point(&self) -> &'static str {
        self.kernel.name
    }

    /// Threads per workgroup.
    pub fn workgroup_size(&self) -> u32 {
        self.kernel.workgroup_size
    }

    /// Bindings of group 0, numbered from 0.
    pub fn bindings(&self) -> impl Iterator<Item = Binding> + use<> {
        self.kernel.bindings(self.variant)
    }

    /// Standard WGSL text.
    pub fn wgsl(&self) -> String {
        self.kernel.strict_wgsl(self.variant)
    }

    /// Returns the kernel for a smallest subgroup size; `None` runs on all devices.
    pub fn with_subgroups(&self, smallest: Option<u32>) -> Self {
        let variant = Variant { subgroups: smallest, ..self.variant };
        Self { variant: self.kernel.effective_variant(variant), ..*self }
    }
}

/// A dispatch of a plan.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PlanDispatch {
    /// Position in [`DispatchSequence::kernels`].
    pub kernel: usize,
    /// Positions in [`CallPlan::buffers`], by binding number.
    pub buffers: Vec<usize>,
    /// Number of workgroups.
    pub workgroups: Workgroups,
    /// Phase of the dispatch.
    pub phase: GpuPhase,
}

/// The number of workgroups of a dispatch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Workgroups {
    /// Workgroups along x and y; one along z.
    Fixed([u32; 2]),
    /// Three `u32` that an earlier dispatch writes.
    Indirect {
        /// Position of their buffer.
        buffer: usize,
        /// Offset in bytes.
        offset: u64,
    },
}

impl DispatchSequence {
    pub(crate) fn resolved<R: PartialEq>(
        dispatches: impl IntoIterator<Item = Dispatch>,
        variant: Variant,
        limits: &DeviceLimits,
        resolve: impl Fn(&Dispatch, &str) -> R,
    ) -> (Self, Vec<R>) {
        let (mut sequence, mut resources) = (Self::default(), Vec::new());
        let mut continuation = None;
        for dispatch in dispatches {
            let begins_deferred = dispatch.kernel == &RUNS_SEARCH_FAR_DISPATCH_ARGS
                || dispatch.kernel == &CELL_LIST_SEARCH_OVERFLOW_DISPATCH_ARGS;
            if dispatch.first_group > 0 || (begins_deferred && continuation.is_some()) {
                sequence.part_starts.push(sequence.dispatches.len());
            }
            if begins_deferred {
                continuation = Some(sequence.dispatches.len());
            }
            let variant = Variant { species: variant.species && !dispatch.ignores_species, ..variant };
            let kernel =
                PlanKernel { kernel: dispatch.kernel, variant: dispatch.kernel.effective_variant(variant) };
            let kernel = position(&mut sequence.kernels, kernel);
            let mut buffer = |name: &str| position(&mut resources, resolve(&dispatch, name));
            let buffers = dispatch.kernel.bindings(variant).map(|binding| buffer(binding.name)).collect();
            let workgroups = match dispatch.indirect {
                false => Workgroups::Fixed(flattened(dispatch.groups, limits)),
                true => {
                    let offset = 12 * u64::from(dispatch.args_index);
                    Workgroups::Indirect { buffer: buffer("dispatch"), offset }
                }
            };
            sequence.dispatches.push(PlanDispatch { kernel, buffers, workgroups, phase: dispatch.phase });
        }
        sequence.continuation = continuation.unwrap_or(sequence.dispatches.len());
        (sequence, resources)
    }

    fn accesses(&self, buffers: usize) -> Vec<Vec<Access>> {
        let mut accesses = vec![Vec::new(); buffers];
        for dispatch in &self.dispatches {
            for (&buffer, binding) in dispatch.buffers.iter().zip(self.kernels[dispatch.kernel].bindings()) {
                accesses[buffer].push(binding.access);
            }
        }
        accesses
    }

    fn storage_buffers(&self) -> usize {
        let storage = |kernel: &PlanKernel| kernel.bindings().filter(|b| b.access != Access::Uniform).count();
        self.kernels.iter().map(storage).max().unwrap_or(0)
    }

    fn workgroups_per_dimension(&self) -> u32 {
        let max_workgroups = |dispatch: &PlanDispatch| match dispatch.workgroups {
            Workgroups::Fixed([x, y]) => x.max(y),
            Workgroups::Indirect { .. } => DeviceLimits::INDIRECT_GROUPS,
        };
        self.dispatches.iter().map(max_workgroups).max().unwrap_or(0)
    }
}

fn position<T: PartialEq>(list: &mut Vec<T>, value: T) -> usize {
    list.iter().position(|known| *known == value).unwrap_or_else(|| {
        list.push(value);
        list.len() - 1
    })
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct CallConstants<'a> {
    pub(crate) call: SearchParams,
    pub(crate) count_in_buffer: bool,
    pub(crate) tables: Option<&'a TableBytes>,
}

impl Plan {
    pub(crate) fn call_plan(
        &self,
        constants: &CallConstants<'_>,
        variant: Variant,
        limits: &DeviceLimits,
    ) -> CallPlan {
        let has_species = constants.tables.is_some();
        let variant =
            Variant { species: has_species, periodic: self.periodic, reuse: self.reuses_layout, ..variant };
        let decides_contact = constants.tables.is_some_and(|tables| tables.sides.are_decided_by_contact());
        let dispatches = self.dispatches.iter().map(|dispatch| Dispatch {
            ignores_species: decides_contact && cell_list::is_search(dispatch.kernel),
            ..dispatch.clone()
        });
        let (sequence, resources) =
            DispatchSequence::resolved(dispatches, variant, limits, |dispatch, name| {
                match self.resource(dispatch, name) {
                    Resource::SpeciesParams if constants.call.narrow_sides != 0 => {
                        Resource::SpeciesParamsBySide
                    }
                    Resource::Count if !constants.count_in_buffer => Resource::SearchParams(0),
                    resource => resource,
                }
            });
        let accesses = sequence.accesses(resources.len());
        let mut buffers: Vec<PlanBuffer> =
            resources.iter().map(|&resource| self.buffer(resource, constants)).collect();
        for (buffer, accesses) in buffers.iter_mut().zip(accesses) {
            buffer.usage.uniform = accesses.contains(&Access::Uniform);
            buffer.usage.storage |= accesses.iter().any(|access| *access != Access::Uniform);
        }
        let at = |id| resources.iter().position(|resource| *resource == Resource::Own(id)).unwrap_or(0);
        let largest = |is_counted: &dyn Fn(&&PlanBuffer) -> bool| {
            buffers.iter().filter(is_counted).map(|buffer| buffer.size).max().unwrap_or(0)
        };
        let requirements = DeviceLimits {
            storage_binding: largest(&|buffer| buffer.usage.storage),
            buffer: largest(&|_| true),
            groups_per_dimension: sequence.workgroups_per_dimension(),
            storage_buffers: sequence.storage_buffers() as u32,
            workgroup_memory: variant.workgroup_memory(),
        };
        CallPlan {
            algorithm: self.algorithm,
            spheres: self.spheres,
            pair_capacity: self.pairs,
            outcome: at(BufferId::Outcome),
            pairs: at(BufferId::Pairs),
            cost: self.cost(),
            buffers,
            sequence,
            requirements,
        }
    }

    fn buffer(&self, resource: Resource, constants: &CallConstants<'_>) -> PlanBuffer {
        let input = |bytes: u64| (bytes.max(16), BufferSource::Input);
        let constant = |bytes: Arc<[u8]>| {
            ((bytes.len() as u64).max(16).next_multiple_of(16), BufferSource::Constant(bytes))
        };
        let table = |select: fn(&TableBytes) -> &Arc<[u8]>| {
            constants.tables.map_or_else(|| Arc::from([]), |tables| select(tables).clone())
        };
        let spheres = u64::from(self.spheres);
        let columns = self.columns.unwrap_or_default();
        let (name, (size, source)) = match resource {
            Resource::Own(id) => {
                let size = self.buffers.iter().find(|(other, _)| *other == id).map_or(16, |(_, size)| *size);
                (id.name(), (size, BufferSource::Working))
            }
            Resource::Spheres => ("spheres".to_owned(), input(spheres * 16)),
            Resource::Column(column) => {
                (COLUMN_NAMES[column].to_owned(), input(columns.bytes(self.spheres)[column]))
            }
            Resource::Columns => ("columns".to_owned(), constant(bytemuck::bytes_of(&columns).into())),
            Resource::Species => ("species".to_owned(), input(spheres * 4)),
            Resource::Count => ("count".to_owned(), input(4)),
            Resource::SearchParams(first_workgroup) => {
                let params = SearchParams { first_workgroup, ..constants.call };
                let name = match first_workgroup {
                    0 => "params".to_owned(),
                    first => format!("params_{first}"),
                };
                (name, constant(bytemuck::bytes_of(&params).into()))
            }
            Resource::RadixPass(pass) => {
                let digit = self.digits()[pass as usize];
                (format!("radix_pass_{pass}"), constant(bytemuck::bytes_of(&digit).into()))
            }
            Resource::SpeciesParams => {
                ("species_params".to_owned(), constant(table(|tables| &tables.species_params)))
            }
            Resource::SpeciesParamsBySide => {
                ("species_params".to_owned(), constant(table(|tables| &tables.species_params_by_side)))
            }
            Resource::Table => ("table".to_owned(), constant(table(|tables| &tables.table))),
        };
        let usage = match resource {
            Resource::Own(id) => id.usage(),
            _ => BufferUsage::default(),
        };
        PlanBuffer { name, size, usage, source, resource }
    }
}

impl CallPlan {
    /// Offset in bytes of each field of the [`Outcome`], all `u32`.
    pub const OUTCOME_FIELDS: &'static [(&'static str, usize)] = {
        use std::mem::offset_of;
        &[
            ("found_lo", offset_of!(Outcome, found_lo)),
            ("found_hi", offset_of!(Outcome, found_hi)),
            ("overflow", offset_of!(Outcome, overflow)),
            ("quarantined", offset_of!(Outcome, quarantined)),
            ("dispatch_x", offset_of!(Outcome, dispatch_x)),
            ("dispatch_y", offset_of!(Outcome, dispatch_y)),
            ("dispatch_z", offset_of!(Outcome, dispatch_z)),
            ("deferred_blocks", offset_of!(Outcome, deferred_blocks)),
            ("entries_lo", offset_of!(Outcome, entries_lo)),
            ("entries_hi", offset_of!(Outcome, entries_hi)),
            ("spheres", offset_of!(Outcome, spheres)),
            ("deferred_max_tiles", offset_of!(Outcome, deferred_max_tiles)),
            ("deferred_begin", offset_of!(Outcome, deferred_begin)),
            ("deferred_end", offset_of!(Outcome, deferred_end)),
            ("max_occupancy", offset_of!(Outcome, max_occupancy)),
            ("pairs_in_cell_order", offset_of!(Outcome, pairs_in_cell_order)),
        ]
    };

    /// Names of the `overflow` bits of the [`Outcome`].
    pub const OVERFLOW_BITS: &'static [(&'static str, u32)] = &[
        ("pairs", Outcome::OVERFLOW_PAIRS),
        ("entries", Outcome::OVERFLOW_ENTRIES),
        ("spheres", Outcome::OVERFLOW_SPHERES),
        ("candidates", Outcome::OVERFLOW_CANDIDATES),
        ("work", Outcome::OVERFLOW_WORK),
    ];

    /// Smallest subgroup size, if kernels use subgroups.
    pub fn subgroups(&self) -> Option<u32> {
        self.sequence.kernels.iter().find_map(|kernel| kernel.variant.subgroups)
    }
}
