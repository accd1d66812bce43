//! Driver statistics of the compiled GPU kernels. Some drivers need no GPU, as no kernel is run.

mod spirv;
mod table;
mod vulkan;

use std::fmt;

use lazygrid::gpu::AdapterSummary;
use lazygrid_kernels::kernel::{KERNELS, Kernel, Variant};
use serde::Serialize;

use vulkan::Compiler;

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Number {
    /// An unsigned integer, or a boolean as 1 or 0.
    Whole(u64),
    Signed(i64),
    Real(f64),
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole(value) => value.fmt(f),
            Self::Signed(value) => value.fmt(f),
            Self::Real(value) => write!(f, "{value:.2}"),
        }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistic {
    pub name: String,
    pub value: Number,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Text {
    pub name: String,
    pub text: String,
}

/// Drivers may compile several programs per kernel, for different subgroup sizes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Program {
    pub name: String,
    pub subgroup: u32,
    pub statistics: Vec<Statistic>,
    #[serde(skip)]
    pub texts: Vec<Text>,
}

#[derive(Clone, Debug, Serialize)]
pub struct CompiledKernel {
    pub kernel: &'static str,
    pub variant: String,
    /// Bytes of workgroup memory.
    pub workgroup_memory: u32,
    pub programs: Vec<Program>,
    pub error: Option<String>,
}

#[derive(Clone, Debug, Serialize)]
pub struct Kernels {
    pub adapter: String,
    pub driver: String,
    /// `true` if the driver supports `VK_KHR_pipeline_executable_properties`.
    pub has_statistics: bool,
    pub compiled: Vec<CompiledKernel>,
}

impl Kernels {
    pub fn rejected(&self) -> impl Iterator<Item = &CompiledKernel> {
        self.compiled.iter().filter(|compiled| compiled.error.is_some())
    }
}

#[derive(Clone, Debug, Default)]
pub struct KernelSelection {
    pub only: Vec<String>,
    /// Includes variants without subgroup operations and for reused cells.
    pub all_variants: bool,
    pub disassembly: bool,
}

/// Compiles the kernels as the engine does.
///
/// # Errors
/// Fails if Vulkan cannot open the adapter. Rejected kernels are part of the result.
pub fn compile(adapter: &AdapterSummary, selection: &KernelSelection) -> Result<Kernels, String> {
    let compiler = Compiler::open(&adapter.name, adapter.has_subgroups)?;
    let smallest = adapter.has_subgroups.then_some(adapter.subgroup_sizes[0]);
    let device_variant = Variant::for_device(smallest, adapter.workgroup_memory);
    let mut compiled = Vec::new();
    let is_wanted = |kernel: &&&Kernel| {
        selection.only.is_empty() || selection.only.iter().any(|name| name == kernel.name)
    };
    for kernel in KERNELS.iter().filter(is_wanted) {
        for variant in variants(kernel, device_variant, selection.all_variants) {
            // The driver may crash the process.
            log::info!(
                "{}: {}, {}",
                adapter.name,
                kernel.name,
                label(variant, kernel.effective_variant(device_variant))
            );
            compiled.push(compile_one(&compiler, kernel, variant, device_variant, selection.disassembly));
        }
    }
    let (name, driver) = (adapter.name.clone(), adapter.driver.clone());
    Ok(Kernels { adapter: name, driver, has_statistics: compiler.has_statistics(), compiled })
}

fn variants(kernel: &Kernel, device_variant: Variant, all_variants: bool) -> Vec<Variant> {
    let mut bases = vec![device_variant];
    if all_variants {
        bases.extend([
            Variant { subgroups: None, ..device_variant },
            Variant { reuse: true, ..device_variant },
        ]);
    }
    let mut found = Vec::new();
    for base in bases {
        for (periodic, species) in [(false, false), (true, false), (false, true), (true, true)] {
            let variant = kernel.effective_variant(Variant { periodic, species, ..base });
            if !found.contains(&variant) {
                found.push(variant);
            }
        }
    }
    found
}

fn compile_one(
    compiler: &Compiler,
    kernel: &'static Kernel,
    variant: Variant,
    device_variant: Variant,
    with_texts: bool,
) -> CompiledKernel {
    let mut workgroup_memory = 0;
    let made = spirv::translate(kernel.name, &kernel.wgsl(variant), compiler.target).and_then(|module| {
        workgroup_memory = module.workgroup_memory;
        let bindings = kernel.bindings(variant).map(|binding| binding.access);
        compiler.compile(kernel.name, &module.words, bindings, with_texts)
    });
    let (programs, error) = match made {
        Ok(programs) => (programs, None),
        Err(reason) => (Vec::new(), Some(reason)),
    };
    let variant = label(variant, kernel.effective_variant(device_variant));
    CompiledKernel { kernel: kernel.name, variant, workgroup_memory, programs, error }
}

fn label(variant: Variant, device_variant: Variant) -> String {
    let labels = [
        (variant.periodic, "periodic"),
        (variant.species, "species"),
        (variant.subgroups != device_variant.subgroups, "no subgroups"),
        (variant.reuse, "reused cells"),
    ];
    let labels: Vec<_> = labels.into_iter().filter_map(|(applies, label)| applies.then_some(label)).collect();
    if labels.is_empty() { "plain".to_owned() } else { labels.join(", ") }
}
