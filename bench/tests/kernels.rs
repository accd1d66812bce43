//! Mesa's compiler for AMD, which needs no GPU, accepts all kernels.

use std::collections::HashSet;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

use lazygrid_kernels::kernel::KERNELS;
use lazygrid_tests::skip;
use serde_json::Value;

fn driver() -> Option<PathBuf> {
    let entries = fs::read_dir("/usr/share/vulkan/icd.d").ok()?;
    let mut paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    paths.find(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("radeon_icd") && !name.contains("i686")
    })
}

#[test]
fn amd_compiler_accepts_all_kernels() {
    let Some(driver) = driver() else {
        return skip(None, "Mesa's Vulkan driver for AMD is not installed (Debian: mesa-vulkan-drivers)");
    };
    let run = Command::new(env!("CARGO_BIN_EXE_lazygrid-bench"))
        .args(["kernels", "--all-variants", "--json"])
        .env("VK_DRIVER_FILES", &driver)
        .env("VK_ICD_FILENAMES", &driver)
        .env("RADV_FORCE_FAMILY", "navi21")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{said}");
    let found: Value = serde_json::from_slice(&run.stdout).unwrap();
    let [adapter] = &found.as_array().unwrap()[..] else { panic!("not one adapter: {found}") };
    assert_eq!(adapter["has_statistics"], true, "{adapter}");
    let compiled = adapter["compiled"].as_array().unwrap();
    let kernels: HashSet<_> = compiled.iter().map(|one| one["kernel"].as_str().unwrap()).collect();
    assert_eq!(kernels, KERNELS.iter().map(|kernel| kernel.name).collect());
    for one in compiled {
        assert_eq!(one["error"], Value::Null, "{one}");
        let [program] = &one["programs"].as_array().unwrap()[..] else { panic!("not one program: {one}") };
        let value_of = |name: &str| {
            let statistics = program["statistics"].as_array().unwrap();
            let named = statistics.iter().find(|statistic| statistic["name"] == name);
            named.unwrap_or_else(|| panic!("{name} of {one}"))["value"].as_u64().unwrap()
        };
        assert!(value_of("VGPRs") > 0 && value_of("Code size") > 0, "{one}");
        // Spilled registers and indexed private arrays are slow on all GPUs.
        assert_eq!(
            [value_of("Spilled VGPRs"), value_of("Spilled SGPRs"), value_of("Scratch size")],
            [0; 3],
            "{one}"
        );
    }
}
