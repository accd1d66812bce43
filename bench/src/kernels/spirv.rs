use naga::AddressSpace;
use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy, Layouter};
use naga::valid::{Capabilities, ValidationFlags, Validator};

#[derive(Clone, Copy, Debug)]
pub(super) struct Target {
    pub(super) vulkan: (u32, u32),
    /// `true` if the device checks bounds (`robustBufferAccess2`), so shaders need not.
    pub(super) checks_buffers: bool,
}

#[derive(Clone, Debug)]
pub(super) struct SpirvModule {
    pub(super) words: Vec<u32>,
    pub(super) workgroup_memory: u32,
}

pub(super) fn translate(name: &str, wgsl: &str, target: Target) -> Result<SpirvModule, String> {
    let module = naga::front::wgsl::parse_str(wgsl).map_err(|error| error.emit_to_string(wgsl))?;
    let capabilities = Capabilities::SUBGROUP | Capabilities::SUBGROUP_BARRIER;
    let info = Validator::new(ValidationFlags::all(), capabilities)
        .validate(&module)
        .map_err(|error| error.emit_to_string(wgsl))?;
    let stage = naga::ShaderStage::Compute;
    let entry = spv::PipelineOptions { shader_stage: stage, entry_point: name.to_owned() };
    let words = spv::write_vec(&module, &info, &options(target), Some(&entry)).map_err(|e| e.to_string())?;
    let mut layouter = Layouter::default();
    layouter.update(module.to_ctx()).map_err(|e| e.to_string())?;
    let shared = |(_, variable): (_, &naga::GlobalVariable)| {
        (variable.space == AddressSpace::WorkGroup).then(|| layouter[variable.ty].size)
    };
    Ok(SpirvModule { words, workgroup_memory: module.global_variables.iter().filter_map(shared).sum() })
}

/// Returns the options of `wgpu_hal::vulkan` for lazygrid's pipelines, which neither bound loops nor clear
/// workgroup memory.
fn options(target: Target) -> spv::Options<'static> {
    spv::Options {
        lang_version: match target.vulkan {
            (1, 0) => (1, 0),
            (1, 1) => (1, 3),
            (1, 2) => (1, 5),
            _ => (1, 6),
        },
        // wgpu writes variable names only in debug builds.
        flags: spv::WriterFlags::LABEL_VARYINGS,
        bounds_check_policies: BoundsCheckPolicies {
            index: BoundsCheckPolicy::Restrict,
            buffer: match target.checks_buffers {
                true => BoundsCheckPolicy::Unchecked,
                false => BoundsCheckPolicy::Restrict,
            },
            ..BoundsCheckPolicies::default()
        },
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        force_loop_bounding: false,
        emit_int_div_checks: true,
        ..spv::Options::default()
    }
}
