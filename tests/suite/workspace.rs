use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use lazygrid::{Algorithm, Backend};

#[test]
fn names_can_be_parsed() {
    let mut names = BTreeSet::new();
    for &algorithm in Algorithm::ALL {
        assert_eq!(algorithm.to_string().parse(), Ok(algorithm));
        assert!(names.insert(algorithm.name()), "two algorithms are called {algorithm}");
    }
    for &backend in Backend::ALL {
        assert_eq!(backend.to_string().parse(), Ok(backend));
    }
    let unknown = "octree".parse::<Algorithm>().expect_err("no such algorithm").to_string();
    assert!(Algorithm::ALL.iter().all(|algorithm| unknown.contains(algorithm.name())), "{unknown}");
    assert!(Algorithm::CPU.iter().all(|algorithm| Algorithm::ALL.contains(algorithm)));
}

const LAYERS: [(&str, &[&str]); 17] = [
    ("lazygrid-kernels", &[]),
    ("lazygrid-host", &["lazygrid-kernels"]),
    ("lazygrid", &["lazygrid-kernels", "lazygrid-host"]),
    ("lazygrid-capi", &["lazygrid"]),
    ("lazygrid-ranks", &["lazygrid"]),
    ("lazygrid-io", &["lazygrid"]),
    ("lazygrid-scenario", &[]),
    ("lazygrid-sim", &["lazygrid", "lazygrid-io", "lazygrid-ranks", "lazygrid-scenario"]),
    ("lazygrid-check", &["lazygrid-kernels", "lazygrid", "lazygrid-io"]),
    ("lazygrid-report", &[]),
    ("lazygrid-results", &["lazygrid-io", "lazygrid-sim"]),
    (
        "lazygrid-cli",
        &["lazygrid", "lazygrid-io", "lazygrid-sim", "lazygrid-check", "lazygrid-report", "lazygrid-results"],
    ),
    (
        "lazygrid-bench",
        &["lazygrid-kernels", "lazygrid", "lazygrid-io", "lazygrid-sim", "lazygrid-check", "lazygrid-report"],
    ),
    ("lazygrid-tests", &["lazygrid", "lazygrid-io", "lazygrid-check"]),
    ("lazygrid-features", &[]),
    ("lazygrid-mpi", &["lazygrid", "lazygrid-io", "lazygrid-ranks", "lazygrid-results", "lazygrid-sim"]),
    ("lazygrid-python", &["lazygrid", "lazygrid-cli", "lazygrid-io", "lazygrid-sim", "lazygrid-features"]),
];

fn metadata() -> serde_json::Value {
    let metadata = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--offline", "--format-version", "1"])
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .output()
        .expect("cargo runs");
    serde_json::from_slice(&metadata.stdout).expect("metadata is JSON")
}

/// Places of the version outside this workspace's packages: a file, and the text before and after the version. The
/// tests of `capi` check the C header.
const VERSIONED: [(&str, &str, &str); 11] = [
    ("fuzz/Cargo.toml", "\nversion = \"", "\""),
    ("Cargo.toml", "path = \"engine\", version = \"", "\""),
    ("capi/Cargo.toml", "path = \"../engine\", version = \"", "\""),
    ("io/Cargo.toml", "path = \"../engine\", version = \"", "\""),
    ("simulator/results/Cargo.toml", "path = \"..\", version = \"", "\""),
    ("distributed/ranks/Cargo.toml", "path = \"../../engine\", version = \"", "\""),
    ("java/pom.xml", "<artifactId>lazygrid</artifactId>\n    <version>", "</version>"),
    ("java/pom.xml", "target/java/lazygrid-", ".jar"),
    ("java/README.md", "io.github.lazygrid:lazygrid:", "`"),
    ("java/README.md", "target/java/lazygrid-", ".jar"),
    ("CITATION.cff", "\nversion: ", "\n"),
];

#[test]
fn all_packages_have_one_version() {
    let version = env!("CARGO_PKG_VERSION");
    for package in metadata()["packages"].as_array().expect("packages") {
        assert_eq!(package["version"], version, "{}", package["name"]);
    }
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    for (file, before, after) in VERSIONED {
        let text = std::fs::read_to_string(format!("{root}/{file}")).expect("a file of the tree");
        let rests = text.split(before).skip(1);
        let found: Vec<_> = rests.filter_map(|rest| Some(rest.split_once(after)?.0)).collect();
        assert!(!found.is_empty() && found.iter().all(|v| *v == version), "{file}: {found:?}, not {version}");
    }
    let minor = version.rsplit_once('.').expect("three numbers").0;
    for file in ["capi/README.md", "capi/examples/CMakeLists.txt"] {
        let text = std::fs::read_to_string(format!("{root}/{file}")).expect("a file of the tree");
        assert!(
            text.contains(&format!("find_package(lazygrid {minor} REQUIRED)")),
            "{file} asks for another version"
        );
    }
}

/// Cargo tests default members only.
#[test]
fn all_members_but_those_of_mpi_and_python_are_default_members() {
    let metadata = metadata();
    let members = |list: &str| -> BTreeSet<String> {
        let ids = metadata[list].as_array().expect("a list").iter();
        ids.map(|id| id.as_str().expect("an id").to_owned()).collect()
    };
    let names = metadata["packages"].as_array().expect("packages").iter();
    let name_of: BTreeMap<_, _> = names.map(|package| (package["id"].as_str(), &package["name"])).collect();
    let (all, default) = (members("workspace_members"), members("workspace_default_members"));
    let others: BTreeSet<_> =
        all.difference(&default).map(|id| name_of[&Some(id.as_str())].as_str()).collect();
    assert_eq!(others, BTreeSet::from([Some("lazygrid-mpi"), Some("lazygrid-python")]));
}

#[test]
fn dependencies_respect_the_layers() {
    let metadata = metadata();
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
            assert!(!gpu, "{name} makes no device calls and must not depend on {on}");
        }
    }
}

fn dependencies(manifest: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    let mut is_dependencies = false;
    for line in manifest.lines() {
        if let Some(table) = line.strip_prefix('[') {
            is_dependencies = table.trim_end_matches(']').ends_with("dependencies");
        } else if is_dependencies && let Some((name, _)) = line.split_once(['.', ' ', '=']) {
            names.insert(name.to_owned());
        }
    }
    names.retain(|name| name.chars().next().is_some_and(char::is_alphabetic));
    names
}

#[test]
fn each_dependency_is_listed_in_the_architecture() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    let architecture =
        std::fs::read_to_string(format!("{root}/ARCHITECTURE.md")).expect("a file of the tree");
    let (_, table) = architecture.split_once("## Dependencies").expect("a table of dependencies");
    let listed: BTreeSet<&str> = table.split(|c: char| !(c.is_alphanumeric() || "-_".contains(c))).collect();
    let outside = ["Cargo.toml", "fuzz/Cargo.toml"];
    let metadata = metadata();
    let packages = metadata["packages"].as_array().expect("packages");
    let inside = packages.iter().map(|package| package["manifest_path"].as_str().expect("a path").to_owned());
    for path in inside.chain(outside.map(|path| format!("{root}/{path}"))) {
        let manifest = std::fs::read_to_string(&path).expect("a file of the tree");
        for name in dependencies(&manifest) {
            let is_own = name.starts_with("lazygrid") || name == "engine";
            assert!(
                is_own || listed.contains(name.as_str()),
                "{path}: {name} has no line in ARCHITECTURE.md"
            );
        }
    }
}

/// `test.sh` runs tests by name, in two groups.
#[test]
fn every_test_is_in_a_group_of_the_script() {
    let script =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../test.sh")).expect("a script");
    let group = |name: &str| {
        let names = script.split(&format!("\n{name}=(")).nth(1).and_then(|rest| rest.split(')').next());
        names.expect("a list").split_whitespace().map(str::to_owned).collect::<Vec<_>>()
    };
    let mut named = [group("long_tests"), group("other_tests")].concat();
    let metadata = metadata();
    let packages = metadata["packages"].as_array().expect("packages").iter();
    // Its tests need an MPI, and have a script of their own.
    let packages = packages.filter(|package| package["name"] != "lazygrid-mpi");
    let targets = packages.flat_map(|package| package["targets"].as_array().expect("targets"));
    let is_test = |target: &&serde_json::Value| target["kind"][0] == "test";
    let mut all: Vec<String> =
        targets.filter(is_test).map(|target| target["name"].as_str().expect("a name").to_owned()).collect();
    named.sort();
    all.sort();
    assert_eq!(named, all);
}
