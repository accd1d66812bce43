//! Every WGSL text there is: of this crate in every variant, and of the simulator, whose crate no test of this one can
//! use.

use std::fs;
use std::path::Path;

use lazygrid_kernels::kernel::{KERNELS, Kernel, Variant};

/// The whole text of one kernel in one variant.
pub(crate) struct Text {
    /// What tells it from all others; fit for the name of a file.
    pub(crate) name: String,
    /// As `write` gave it.
    pub(crate) wgsl: String,
}

/// The texts of this crate, as `write` gives them, then those of the simulator.
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
    for (is_so, what) in [(variant.species, "-species"), (variant.periodic, "-periodic")] {
        name += if is_so { what } else { "" };
    }
    name
}

/// The simulator's kernels, expanded as `simulator/src/gpu/kernel.rs` does it.
fn simulator() -> Vec<Text> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../simulator/src/gpu/shader");
    let read = |path: &Path| fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut paths: Vec<_> = fs::read_dir(&folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .map(|entry| entry.expect("an entry of a folder").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "wgsl"))
        .collect();
    paths.sort();
    let text = |path: &Path| {
        let line = |line: &str| match line.strip_prefix("#include ") {
            None => format!("{line}\n"),
            Some(piece) => read(&folder.join("shared").join(piece).with_extension("wgsl")),
        };
        let name = path.file_stem().expect("the name of a file").to_string_lossy();
        Text { name: format!("simulator-{name}"), wgsl: read(path).lines().map(line).collect() }
    };
    paths.iter().map(|path| text(path)).collect()
}
