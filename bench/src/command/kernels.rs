use std::fs;
use std::path::Path;

use lazygrid::gpu::{AdapterSummary, adapters};
use lazygrid_bench::kernels::{self, CompiledKernel, KernelSelection};

use crate::command::args::Kernels;
use crate::command::failure::Failure;
use crate::print;

pub(crate) fn run(args: &Kernels) -> Result<(), Failure> {
    let selection = KernelSelection {
        only: args.only.clone(),
        all_variants: args.all_variants,
        disassembly: args.disassembly.is_some(),
    };
    let (mut found, mut rejected, mut printed) = (Vec::new(), 0, Ok(()));
    for adapter in chosen(args)? {
        let kernels = kernels::compile(&adapter, &selection).map_err(Failure::Kernels)?;
        rejected += kernels.rejected().count();
        if let Some(folder) = &args.disassembly {
            kernels
                .compiled
                .iter()
                .try_for_each(|compiled| write_texts(compiled, &folder.join(&adapter.name)))?;
        }
        if !args.json {
            printed = printed.and_then(|()| print(format!("{kernels}\n")));
        }
        found.push(kernels);
    }
    if args.json {
        let text = serde_json::to_string_pretty(&found).map_err(|e| Failure::Kernels(e.to_string()))?;
        printed = print(text + "\n");
    }
    // The exit code must show the verdict even if standard output is closed.
    if rejected > 0 { Err(Failure::Rejected { variants: rejected }) } else { printed }
}

fn chosen(args: &Kernels) -> Result<Vec<AdapterSummary>, Failure> {
    let mut found = adapters();
    if let Some(id) = &args.adapter {
        let index = id.index_in(&found).map_err(|e| Failure::Kernels(e.to_string()))?;
        found = vec![found.swap_remove(index)];
    }
    let names: Vec<_> = found.iter().map(|adapter| format!("{} ({})", adapter.name, adapter.api)).collect();
    found.retain(|adapter| adapter.api == "vulkan");
    match found.is_empty() {
        true if names.is_empty() => Err(Failure::Kernels("no Vulkan driver found".to_owned())),
        true => Err(Failure::Kernels(format!("not available through Vulkan: {}", names.join(", ")))),
        false => Ok(found),
    }
}

fn write_texts(compiled: &CompiledKernel, folder: &Path) -> Result<(), Failure> {
    let failed =
        |path: &Path, e: std::io::Error| Failure::Kernels(format!("{}: cannot write: {e}", path.display()));
    fs::create_dir_all(folder).map_err(|e| failed(folder, e))?;
    for program in &compiled.programs {
        for text in &program.texts {
            let variant = compiled.variant.replace(", ", "-").replace(' ', "-");
            let name = format!("{}.{variant}.{}.{}.txt", compiled.kernel, program.name, text.name);
            let path = folder.join(name.replace('/', "-"));
            fs::write(&path, &text.text).map_err(|e| failed(&path, e))?;
        }
    }
    Ok(())
}
