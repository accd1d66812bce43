//! What the tree promises about itself.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use lazygrid::{Algorithm, Backend};

#[test]
fn names_are_read_back() {
    let mut names = BTreeSet::new();
    for algorithm in Algorithm::ALL {
        assert_eq!(algorithm.to_string().parse(), Ok(algorithm));
        assert!(names.insert(algorithm.name()), "two algorithms are called {algorithm}");
    }
    for backend in Backend::ALL {
        assert_eq!(backend.to_string().parse(), Ok(backend));
    }
    let unknown = "octree".parse::<Algorithm>().expect_err("no such algorithm").to_string();
    assert!(Algorithm::ALL.iter().all(|algorithm| unknown.contains(algorithm.name())), "{unknown}");
    assert!(Algorithm::CPU.iter().all(|algorithm| Algorithm::ALL.contains(algorithm)));
}

/// Crate by crate, the crates of this workspace that it may depend on outside its own tests.
const LAYERS: [(&str, &[&str]); 12] = [
    ("lazygrid-kernels", &[]),
    ("lazygrid-host", &["lazygrid-kernels"]),
    ("lazygrid", &["lazygrid-kernels", "lazygrid-host"]),
    ("lazygrid-capi", &["lazygrid"]),
    ("lazygrid-ranks", &["lazygrid"]),
    ("lazygrid-io", &["lazygrid"]),
    ("lazygrid-sim", &["lazygrid", "lazygrid-io"]),
    ("lazygrid-check", &["lazygrid-kernels", "lazygrid", "lazygrid-io"]),
    ("lazygrid-report", &[]),
    ("lazygrid-cli", &["lazygrid", "lazygrid-io", "lazygrid-sim", "lazygrid-check", "lazygrid-report"]),
    (
        "lazygrid-bench",
        &["lazygrid-kernels", "lazygrid", "lazygrid-io", "lazygrid-sim", "lazygrid-check", "lazygrid-report"],
    ),
    ("lazygrid-tests", &["lazygrid", "lazygrid-io", "lazygrid-check"]),
];

#[test]
fn dependencies_point_one_way() {
    let metadata = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--offline", "--format-version", "1"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo runs");
    let metadata: serde_json::Value = serde_json::from_slice(&metadata.stdout).expect("metadata is JSON");
    let layers = BTreeMap::from(LAYERS);
    let packages = metadata["packages"].as_array().expect("packages");
    assert!(packages.len() >= layers.len());
    for package in packages {
        let name = package["name"].as_str().expect("a name");
        let allowed = layers.get(name).unwrap_or_else(|| panic!("{name} has no place in LAYERS"));
        for dependency in package["dependencies"].as_array().expect("dependencies") {
            let (on, kind) = (dependency["name"].as_str().expect("a name"), &dependency["kind"]);
            let ours = layers.contains_key(on);
            assert!(!ours || !kind.is_null() || allowed.contains(&on), "{name} depends on {on}");
            let gpu = on.starts_with("wgpu") && ["lazygrid-kernels", "lazygrid-host"].contains(&name);
            assert!(!gpu, "{name} makes no device call and has no use for {on}");
        }
    }
}
