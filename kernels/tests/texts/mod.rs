//! All WGSL texts: of this crate in every variant, and of the simulator.

use std::fs;
use std::path::{Path, PathBuf};

use lazygrid_kernels::kernel::{KERNELS, Kernel, Variant};
use lazygrid_kernels::wgsl;

pub(crate) struct Text {
    pub(crate) name: String,
    pub(crate) wgsl: String,
}

pub(crate) fn all(write: fn(&Kernel, Variant) -> String) -> Vec<Text> {
    let own = KERNELS.into_iter().flat_map(|kernel| {
        let text = move |variant| Text { name: name_of(kernel, variant), wgsl: write(kernel, variant) };
        kernel.variants().into_iter().map(text)
    });
    own.chain(simulator()).collect()
}

fn name_of(kernel: &Kernel, variant: Variant) -> String {
    let mut name = kernel.name.to_owned();
    if let Some(size) = variant.subgroups {
        name += &format!("-subgroups-{size}");
    }
    let suffixes =
        [(variant.species, "-species"), (variant.periodic, "-periodic"), (variant.reuse, "-reuse")];
    for (is_so, what) in suffixes {
        name += if is_so { what } else { "" };
    }
    name
}

fn simulator() -> Vec<Text> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../simulator/src/gpu/shader");
    let (sources, includes) = (sources(&folder), sources(&folder.join("shared")));
    let includes: Vec<_> = includes.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
    let text = |(name, source): &(String, String)| {
        let wgsl = wgsl::expand(source, &includes, &|name| name == "STANDARD");
        Text { name: format!("simulator-{name}"), wgsl }
    };
    sources.iter().map(text).collect()
}

fn sources(folder: &Path) -> Vec<(String, String)> {
    let entries = fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry of a folder").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "wgsl"));
    paths.sort();
    let read = |path: &PathBuf| {
        let name = path.file_stem().expect("the name of a file").to_string_lossy().into_owned();
        (name, fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
    };
    paths.iter().map(read).collect()
}
