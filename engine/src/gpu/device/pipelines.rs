use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::{Arc, Mutex, PoisonError};

use lazygrid_kernels::kernel::{Access, Kernel, Variant};

use super::error_scope::with_error_scope;
use super::subgroup_probe;
use crate::Error;

#[derive(Clone, Debug)]
pub(crate) struct Pipelines {
    device: wgpu::Device,
    variant: Variant,
    subgroup_refusal: Option<Arc<str>>,
    rewrite: Option<KernelRewrite>,
    compiled: Arc<Mutex<Compiled>>,
    by_text: Arc<Mutex<CompiledTexts>>,
}

pub(crate) type KernelRewrite = fn(&str) -> String;

type Compiled = HashMap<(&'static str, Variant), Pipeline>;
type CompiledTexts = HashMap<(&'static str, Vec<Access>, String), Pipeline>;

#[derive(Clone, Debug)]
pub(crate) struct Pipeline {
    pub(crate) pipeline: wgpu::ComputePipeline,
    pub(crate) layout: wgpu::BindGroupLayout,
}

impl Pipelines {
    /// Subgroup operations need the feature and a passed probe.
    pub(crate) fn new(device: &wgpu::Device) -> Self {
        Self::with_refusal(device, subgroup_probe::refusal(device))
    }

    pub(super) fn with_refusal(device: &wgpu::Device, refusal: Option<String>) -> Self {
        let offered = device.features().contains(wgpu::Features::SUBGROUP);
        let refusal = refusal.filter(|_| offered);
        let smallest = (offered && refusal.is_none()).then(|| device.adapter_info().subgroup_min_size);
        let memory = device.limits().max_compute_workgroup_storage_size;
        let variant = Variant::for_device(smallest, memory);
        Self {
            device: device.clone(),
            variant,
            subgroup_refusal: refusal.map(Arc::from),
            rewrite: None,
            compiled: Arc::default(),
            by_text: Arc::default(),
        }
    }

    pub(super) fn compiled(
        device: &wgpu::Device,
        kernel: &'static Kernel,
        variant: Variant,
    ) -> Result<Pipeline, Error> {
        with_error_scope(device, kernel.name, 0, || compile(device, kernel, variant, kernel.wgsl(variant)))
    }

    pub(crate) fn subgroup_refusal(&self) -> Option<&str> {
        self.subgroup_refusal.as_deref()
    }

    pub(crate) fn variant(&self) -> Variant {
        self.variant
    }

    pub(crate) fn without_subgroups(self) -> Self {
        Self { variant: Variant { subgroups: None, ..self.variant }, ..self }
    }

    pub(crate) fn rewritten(&self, rewrite: KernelRewrite) -> Self {
        Self { rewrite: Some(rewrite), compiled: Arc::default(), ..self.clone() }
    }

    pub(crate) fn get(&self, kernel: &'static Kernel, variant: Variant) -> Result<Pipeline, Error> {
        let mut compiled = self.compiled.lock().unwrap_or_else(PoisonError::into_inner);
        match compiled.entry((kernel.name, kernel.effective_variant(variant))) {
            Entry::Occupied(found) => Ok(found.get().clone()),
            Entry::Vacant(vacant) => {
                let text = kernel.wgsl(variant);
                let text = self.rewrite.map_or_else(|| text.clone(), |rewrite| rewrite(&text));
                let work = || compile(&self.device, kernel, variant, text);
                Ok(vacant.insert(with_error_scope(&self.device, kernel.name, 0, work)?).clone())
            }
        }
    }

    /// # Safety
    /// Each loop of `wgsl` must end.
    pub(super) unsafe fn by_text(
        &self,
        name: &'static str,
        bindings: Vec<Access>,
        wgsl: String,
    ) -> Result<Pipeline, Error> {
        let mut compiled = self.by_text.lock().unwrap_or_else(PoisonError::into_inner);
        match compiled.entry((name, bindings, wgsl)) {
            Entry::Occupied(found) => Ok(found.get().clone()),
            Entry::Vacant(vacant) => {
                let (_, bindings, wgsl) = vacant.key();
                let work = || {
                    // SAFETY: the caller promises that each loop ends.
                    let module = unsafe { shader_module(&self.device, name, wgsl.clone()) };
                    pipeline(&self.device, name, bindings.iter().copied(), &module, true)
                };
                let made = with_error_scope(&self.device, name, 0, work)?;
                Ok(vacant.insert(made).clone())
            }
        }
    }
}

fn compile(device: &wgpu::Device, kernel: &Kernel, variant: Variant, text: String) -> Pipeline {
    let accesses = kernel.bindings(variant).map(|bound| bound.access);
    // SAFETY: the text belongs to lazygrid-kernels. Its loop counters approach a constant limit by steps that cannot
    // pass it, or clear a bit at each iteration, as `kernels/tests/loops.rs` checks. Only tests rewrite, and keep the
    // loops.
    let module = unsafe { shader_module(device, kernel.name, text) };
    // Every kernel clears workgroup memory before it reads it.
    pipeline(device, kernel.name, accesses, &module, false)
}

pub(super) fn pipeline(
    device: &wgpu::Device,
    name: &'static str,
    bindings: impl IntoIterator<Item = Access>,
    module: &wgpu::ShaderModule,
    zero_initialize_workgroup_memory: bool,
) -> Pipeline {
    let entries: Vec<_> = (0..)
        .zip(bindings)
        .map(|(binding, access)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: match access {
                    Access::Uniform => wgpu::BufferBindingType::Uniform,
                    _ => wgpu::BufferBindingType::Storage { read_only: access == Access::Read },
                },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        })
        .collect();
    let label = Some(name);
    let layout =
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
    let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label,
        layout: Some(&pipeline_layout),
        module,
        entry_point: Some(name),
        compilation_options: wgpu::PipelineCompilationOptions {
            zero_initialize_workgroup_memory,
            ..Default::default()
        },
        cache: None,
    });
    Pipeline { pipeline, layout }
}

/// Compiles WGSL without the counters by which wgpu ends endless loops; they slow all pairs by a fifth.
///
/// # Safety
/// Each loop of the text must end.
pub(super) unsafe fn shader_module(
    device: &wgpu::Device,
    name: &'static str,
    text: String,
) -> wgpu::ShaderModule {
    let source = wgpu::ShaderSource::Wgsl(text.into());
    let descriptor = wgpu::ShaderModuleDescriptor { label: Some(name), source };
    let mut checks = wgpu::ShaderRuntimeChecks::checked();
    checks.force_loop_bounding = false;
    // SAFETY: all other checks stay enabled, and the caller promises that each loop ends.
    unsafe { device.create_shader_module_trusted(descriptor, checks) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::device::device_or_skip;

    #[test]
    fn text_of_a_caller_is_compiled_once() {
        let Some(gpu) = device_or_skip() else { return };
        let text = |value: u32| {
            format!(
                "@group(0) @binding(0) var<storage, read_write> out: array<u32>;
                 @compute @workgroup_size(1) fn put() {{ out[0] = {value}u; }}"
            )
        };
        // SAFETY: the text has no loop.
        let compiled = |gpu: &crate::gpu::GpuDevice, value| unsafe {
            gpu.compile("put", [Access::ReadWrite], text(value)).expect("valid").0
        };
        let first = compiled(&gpu, 1);
        assert_eq!(compiled(&gpu.clone(), 1), first);
        assert_ne!(compiled(&gpu, 2), first);
    }
}
