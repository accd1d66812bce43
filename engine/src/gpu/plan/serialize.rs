use std::collections::BTreeMap;

use lazygrid_kernels::kernel::Binding;
use lazygrid_kernels::layout::Outcome;
use serde::{Serialize, Serializer};

use super::call_plan::{BufferSource, CallPlan, PlanBuffer, PlanDispatch, PlanKernel, Workgroups};

/// Format version. Readers refuse unknown versions.
const FORMAT: u32 = 1;

#[derive(Serialize)]
struct PlanForm<'a> {
    format: u32,
    algorithm: &'a str,
    spheres: u32,
    pairs: u32,
    subgroups: Option<u32>,
    buffers: Vec<BufferForm<'a>>,
    kernels: &'a [PlanKernel],
    dispatches: Vec<DispatchForm<'a>>,
    continuation: usize,
    part_starts: &'a [usize],
    outcome: OutcomeForm,
    requires: BTreeMap<&'static str, u64>,
    cost: CostForm,
}

#[derive(Serialize)]
struct BufferForm<'a> {
    name: &'a str,
    size: u64,
    usage: Vec<&'static str>,
    source: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    words: Option<Vec<u32>>,
}

#[derive(Serialize)]
struct KernelForm {
    entry_point: &'static str,
    workgroup_size: u32,
    bindings: Vec<BindingForm>,
    wgsl: String,
}

#[derive(Serialize)]
struct BindingForm {
    name: &'static str,
    access: &'static str,
}

#[derive(Serialize)]
struct DispatchForm<'a> {
    kernel: usize,
    phase: &'static str,
    buffers: &'a [usize],
    #[serde(skip_serializing_if = "Option::is_none")]
    workgroups: Option<[u32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    indirect: Option<IndirectForm>,
}

#[derive(Serialize)]
struct IndirectForm {
    buffer: usize,
    offset: u64,
}

#[derive(Serialize)]
struct OutcomeForm {
    buffer: usize,
    pairs: usize,
    bytes: usize,
    fields: BTreeMap<&'static str, usize>,
    overflow_bits: BTreeMap<&'static str, u32>,
}

#[derive(Serialize)]
struct CostForm {
    dispatches: u32,
    working_bytes: u64,
    pair_bytes: u64,
    traffic_bytes: Option<u64>,
}

impl Serialize for CallPlan {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let limits = &self.requirements;
        let form = PlanForm {
            format: FORMAT,
            algorithm: self.algorithm.name(),
            spheres: self.spheres,
            pairs: self.pair_capacity,
            subgroups: self.subgroups(),
            buffers: self.buffers.iter().map(buffer).collect(),
            kernels: &self.sequence.kernels,
            dispatches: self.sequence.dispatches.iter().map(dispatch).collect(),
            continuation: self.sequence.continuation,
            part_starts: &self.sequence.part_starts,
            outcome: OutcomeForm {
                buffer: self.outcome,
                pairs: self.pairs,
                bytes: size_of::<Outcome>(),
                fields: Self::OUTCOME_FIELDS.iter().copied().collect(),
                overflow_bits: Self::OVERFLOW_BITS.iter().copied().collect(),
            },
            requires: BTreeMap::from([
                ("storage_binding", limits.storage_binding),
                ("buffer", limits.buffer),
                ("storage_buffers", limits.storage_buffers.into()),
                ("workgroup_memory", limits.workgroup_memory.into()),
                ("workgroups_per_dimension", limits.groups_per_dimension.into()),
            ]),
            cost: CostForm {
                dispatches: self.cost.dispatches,
                working_bytes: self.cost.working_bytes,
                pair_bytes: self.cost.pair_bytes,
                traffic_bytes: self.cost.traffic_bytes,
            },
        };
        form.serialize(serializer)
    }
}

fn buffer(buffer: &PlanBuffer) -> BufferForm<'_> {
    let (source, words) = match &buffer.source {
        BufferSource::Input => ("input", None),
        BufferSource::Working => ("working", None),
        BufferSource::Constant(bytes) => {
            let word = |bytes: &[u8]| bytes.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte));
            ("constant", Some(bytes.chunks(4).map(word).collect()))
        }
    };
    BufferForm { name: &buffer.name, size: buffer.size, usage: buffer.usage.names(), source, words }
}

impl Serialize for PlanKernel {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let binding = |binding: Binding| BindingForm { name: binding.name, access: binding.access.name() };
        let form = KernelForm {
            entry_point: self.entry_point(),
            workgroup_size: self.workgroup_size(),
            bindings: self.bindings().map(binding).collect(),
            wgsl: self.wgsl(),
        };
        form.serialize(serializer)
    }
}

fn dispatch(dispatch: &PlanDispatch) -> DispatchForm<'_> {
    let (workgroups, indirect) = match dispatch.workgroups {
        Workgroups::Fixed([x, y]) => (Some([x, y, 1]), None),
        Workgroups::Indirect { buffer, offset } => (None, Some(IndirectForm { buffer, offset })),
    };
    let (kernel, phase) = (dispatch.kernel, dispatch.phase.name());
    DispatchForm { kernel, phase, buffers: &dispatch.buffers, workgroups, indirect }
}
