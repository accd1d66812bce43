//! What the compilers in Vulkan drivers make of the GPU kernels: registers, values kept in memory for want of them, code.
//! Nothing is run, so that a driver needs no GPU where it can do without one.

mod spirv;
mod table;
mod vulkan;

use std::fmt;

use lazygrid::gpu::AdapterSummary;
use lazygrid_kernels::kernel::{KERNELS, Kernel, Variant};
use serde::Serialize;

use vulkan::Compiler;

/// A number that a driver says of a program.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Number {
    /// Without a sign; of two values that are true or false, 1 or 0.
    Whole(u64),
    /// With a sign.
    Signed(i64),
    /// With a fraction.
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

/// What a driver says of a program, in its own words.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistic {
    /// What it is.
    pub name: String,
    /// How much of it.
    pub value: Number,
}

/// A form of a program, such as its assembly.
#[derive(Clone, Debug, PartialEq)]
pub struct Text {
    /// What it is, in the driver's words.
    pub name: String,
    /// The text.
    pub text: String,
}

/// One program that a driver made of a kernel. Some make several, for subgroups of different sizes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Program {
    /// What the driver calls it.
    pub name: String,
    /// Threads per subgroup.
    pub subgroup: u32,
    /// What the driver says of it.
    pub statistics: Vec<Statistic>,
    /// Its forms, where they were asked for.
    #[serde(skip)]
    pub texts: Vec<Text>,
}

/// What became of one text of a kernel.
#[derive(Clone, Debug, Serialize)]
pub struct Compiled {
    /// The kernel.
    pub kernel: &'static str,
    /// Which of its texts.
    pub variant: String,
    /// Bytes of its variables in workgroup memory.
    pub workgroup_memory: u32,
    /// What the driver made of it: none where it does not say.
    pub programs: Vec<Program>,
    /// Why it made nothing of it.
    pub error: Option<String>,
}

/// What one adapter made of all kernels.
#[derive(Clone, Debug, Serialize)]
pub struct Kernels {
    /// The adapter.
    pub adapter: String,
    /// Its driver.
    pub driver: String,
    /// Whether the driver says anything of its programs (`VK_KHR_pipeline_executable_properties`).
    pub has_statistics: bool,
    /// Text by text.
    pub compiled: Vec<Compiled>,
}

impl Kernels {
    /// The texts of which the driver made nothing.
    pub fn refused(&self) -> impl Iterator<Item = &Compiled> {
        self.compiled.iter().filter(|compiled| compiled.error.is_some())
    }
}

/// What is compiled.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// Only kernels of these names; all where there are none.
    pub only: Vec<String>,
    /// Also the texts of devices without subgroup operations, and of those with little workgroup memory.
    pub other_devices: bool,
    /// Also the forms of each program.
    pub texts: bool,
}

/// Compiles the kernels for an adapter, as the engine has them.
///
/// # Errors
/// Where Vulkan does not open the adapter. That a kernel was refused is said with the kernel.
pub fn compile(adapter: &AdapterSummary, wanted: &Wanted) -> Result<Kernels, String> {
    let compiler = Compiler::open(&adapter.name, adapter.has_subgroups)?;
    let smallest = adapter.has_subgroups.then_some(adapter.subgroup_sizes[0]);
    let own = Variant::for_device(smallest, adapter.workgroup_memory);
    let mut compiled = Vec::new();
    let is_wanted =
        |kernel: &&&Kernel| wanted.only.is_empty() || wanted.only.iter().any(|name| name == kernel.name);
    for kernel in KERNELS.iter().filter(is_wanted) {
        for variant in variants(kernel, own, wanted.other_devices) {
            // Said before, since a driver may take the whole program with it.
            log::info!("{}: {}, {}", adapter.name, kernel.name, label(variant, kernel.reduced(own)));
            compiled.push(compile_one(&compiler, kernel, (variant, own), wanted.texts));
        }
    }
    let (name, driver) = (adapter.name.clone(), adapter.driver.clone());
    Ok(Kernels { adapter: name, driver, has_statistics: compiler.has_statistics(), compiled })
}

/// The texts of a kernel that differ, those of calls of every kind on a device that is given `own`.
fn variants(kernel: &Kernel, own: Variant, other_devices: bool) -> Vec<Variant> {
    let mut bases = vec![own];
    if other_devices {
        bases.extend([Variant { subgroups: None, ..own }, Variant { wide: false, ..own }]);
    }
    let mut found = Vec::new();
    for base in bases {
        for (periodic, species) in [(false, false), (true, false), (false, true), (true, true)] {
            let variant = kernel.reduced(Variant { periodic, species, ..base });
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
    (variant, own): (Variant, Variant),
    with_texts: bool,
) -> Compiled {
    let mut workgroup_memory = 0;
    let made = spirv::translate(kernel.name, &kernel.wgsl(variant), compiler.target).and_then(|translated| {
        workgroup_memory = translated.workgroup_memory;
        let bindings = kernel.bindings(variant).map(|binding| binding.access);
        compiler.compile(kernel.name, &translated.words, bindings, with_texts)
    });
    let (programs, error) = match made {
        Ok(programs) => (programs, None),
        Err(reason) => (Vec::new(), Some(reason)),
    };
    let variant = label(variant, kernel.reduced(own));
    Compiled { kernel: kernel.name, variant, workgroup_memory, programs, error }
}

/// What distinguishes a text from the one for calls without anything special.
fn label(variant: Variant, own: Variant) -> String {
    let said = [
        (variant.periodic, "periodic"),
        (variant.species, "species"),
        (variant.subgroups != own.subgroups, "no subgroups"),
        (variant.wide != own.wide, "narrow tiles"),
    ];
    let words: Vec<_> = said.into_iter().filter_map(|(is_so, word)| is_so.then_some(word)).collect();
    if words.is_empty() { "plain".to_owned() } else { words.join(", ") }
}
