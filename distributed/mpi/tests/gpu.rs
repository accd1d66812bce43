//! `lazygrid-mpi --backend gpu` against the CPU, run by `test.sh`.

#![allow(clippy::unwrap_used, reason = "tests")]

#[path = "../../../tests/src/skip.rs"]
mod skip;

use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;

use lazygrid::Backend;
use lazygrid_sim::run::Run;
use lazygrid_sim::scenario::Scenario;
use skip::skip;

fn has_gpu() -> bool {
    let found = !lazygrid::gpu::adapters().is_empty();
    if !found {
        skip(Some("LAZYGRID_REQUIRE_GPU"), "no GPU adapter was found for ranks with GPUs");
    }
    found
}

fn on_two_ranks(arguments: &[&str]) -> String {
    let output = Command::new("mpirun")
        .args(["--oversubscribe", "-n", "2", env!("CARGO_BIN_EXE_lazygrid-mpi")])
        .args(arguments)
        .output()
        .unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn ranks_find_the_pairs_of_the_cpu_on_gpus() {
    if !has_gpu() {
        return;
    }
    let pour = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/lammps-pour.dump");
    let said =
        |backend| on_two_ranks(&["detect", pour.to_str().unwrap(), "--backend", backend, "--threads", "1"]);
    let [cpu, gpu] = ["cpu", "gpu"].map(said);
    assert!(cpu.contains("pairs      3072") && gpu.contains("pairs      3072"), "{cpu}{gpu}");
    assert!(!cpu.contains("GPU") && gpu.contains("GPU"), "{cpu}{gpu}");
    let lists = tempfile::tempdir().unwrap();
    let list = |backend: &str, precision: &str| {
        let path = lists.path().join(backend).with_extension("csv");
        let output = ["-o", path.to_str().unwrap(), "--gather", "--precision", precision];
        on_two_ranks(&[&["detect", pour.to_str().unwrap(), "--backend", backend][..], &output].concat());
        std::fs::read(path).unwrap()
    };
    for precision in ["f32", "f64"] {
        assert!(list("gpu", precision) == list("cpu", precision), "{precision}");
    }
}

#[test]
fn simulations_over_ranks_with_gpus_are_those_of_the_cpu() {
    if !has_gpu() {
        return;
    }
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../simulator/scenarios/burst.toml");
    let directory = tempfile::tempdir().unwrap();
    let series = |backend: &str| {
        let run = directory.path().join(backend);
        let paths = [scenario.to_str().unwrap(), "-o", run.to_str().unwrap(), "--steps", "10"];
        on_two_ranks(&[&["simulate"][..], &paths, &["--threads", "1", "--backend", backend]].concat());
        std::fs::read_to_string(run.join("series.csv")).unwrap()
    };
    let [cpu, gpu] = ["cpu", "gpu"].map(series);
    let pairs = cpu.lines().last().unwrap().rsplit(',').nth(1).unwrap();
    assert!(cpu == gpu && pairs.parse::<u32>().unwrap() > 1000, "{cpu}{gpu}");
}

#[test]
fn particles_on_the_gpus_of_ranks_equal_one_process_on_a_gpu() {
    if !has_gpu() {
        return;
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../simulator/scenarios/vessel.toml");
    let directory = tempfile::tempdir().unwrap();
    let [one, ranks] = ["one", "ranks"].map(|name| directory.path().join(name));
    let mut scenario = Scenario::read(&path).unwrap();
    scenario.steps = 2000;
    let run = Run { backend: Backend::Gpu, ..Run::new(scenario, &path, &one) };
    let (_, simulation) = run.run(|_| ControlFlow::Continue(())).unwrap();
    let summary = Run { directory: ranks.clone(), ..run.clone() }.summary(&simulation);
    let paths = [path.to_str().unwrap(), "-o", ranks.to_str().unwrap(), "--steps", "2000"];
    let said = on_two_ranks(&[&["simulate", "--backend", "gpu", "--threads", "1"], &paths[..]].concat());
    assert_eq!(said, summary);
    for name in ["series.csv", "arrivals.csv"] {
        let [expected, found] =
            [&one, &ranks].map(|directory| std::fs::read_to_string(directory.join(name)).unwrap());
        assert!(expected.len() > 200 && found == expected, "{name}");
    }
    let checkpoint = lazygrid_sim::run::checkpoint::Checkpoint::read(&ranks.join("checkpoint")).unwrap();
    assert_eq!(checkpoint.backend, Backend::Gpu.name());
}
