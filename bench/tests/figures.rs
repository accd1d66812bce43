//! Each engine gives the right answer at the smallest scale.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::ffi::OsStr;
use std::fs;
use std::path::Path;

use lazygrid_tests::command::{Program, Run};
use serde_json::Value;

const BENCH: Program = Program(env!("CARGO_BIN_EXE_lazygrid-bench"));

fn bench(args: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Run {
    BENCH.run(args)
}

/// Returns arguments for the smallest sizes, and for a time within which a busy machine measures every point.
fn smallest<'a>(folder: &'a Path, more: &[&'a str]) -> Vec<&'a str> {
    [&["figures", "--smoke", "--budget-minutes", "600", "--out", path(folder)][..], more].concat()
}

fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn results(folder: &Path) -> Value {
    serde_json::from_str(&read(folder, "results.json")).unwrap()
}

fn path(folder: &Path) -> &str {
    folder.to_str().unwrap()
}

#[test]
fn smallest_figures_are_right() {
    let folder = tempfile::tempdir().unwrap();
    let run = bench(smallest(folder.path(), &[])).succeeds();
    assert!(run.out.contains("0 with a wrong answer"), "{}", run.out);

    let results = results(folder.path());
    let rows = results["rows"].as_array().unwrap();
    for figure in [
        "3a",
        "3b",
        "4",
        "step-length",
        "5a",
        "5b",
        "transceivers",
        "size-ratio",
        "tau",
        "ratio",
        "threads",
        "memory",
        "point",
        "species",
    ] {
        let of_figure = || rows.iter().filter(|row| row["figure"] == figure);
        assert!(of_figure().any(|row| row["status"] == "ok"), "nothing was measured for {figure}");
        assert!(of_figure().all(|row| row["status"] != "error"), "{figure}");
    }
    let measured = |row: &&Value| row["status"] == "ok";
    for row in rows.iter().filter(measured) {
        assert!(!row["wall"].as_array().unwrap().is_empty(), "{row}");
    }
    for (a, b) in rows.iter().filter(measured).zip(rows.iter().filter(measured).skip(1)) {
        let same = ["figure", "scene", "n"].iter().all(|key| a[key] == b[key]);
        if same && (a["at"] == b["at"] || a["figure"] == "tau") {
            assert_eq!(a["pairs"], b["pairs"], "{a} {b}");
        }
    }
    for engine in ["plain cell list", "parry3d refit", "octree (BiNS2)", "sort-and-sweep (N3Sim)"] {
        assert!(rows.iter().filter(measured).any(|row| row["engine"] == engine), "{engine}");
    }
    assert_eq!(read(folder.path(), "results.csv").lines().count(), rows.len() + 1);
    let page = read(folder.path(), "report.html");
    assert!(
        page.contains("<svg") && page.contains("Figure 4") && !page.contains("src="),
        "not self-contained"
    );
    let text = read(folder.path(), "results.md");
    assert!(text.contains("| engine |"));
    assert!(text.contains(&format!("{}\n```", smallest(folder.path(), &[]).join(" "))), "{text}");
    assert!(!page.contains('`'), "Markdown in HTML");
    for plot in [
        "figure-3a",
        "figure-3a-per-sphere",
        "figure-4-equal-per-sphere",
        "figure-size-ratio-2-transceivers-200",
        "figure-point-per-pair",
    ] {
        assert!(read(&folder.path().join("plots"), &format!("{plot}.svg")).starts_with("<svg"), "{plot}");
    }
}

#[test]
fn interrupted_run_resumes() {
    let folder = tempfile::tempdir().unwrap();
    let run = |only: &str| {
        bench(smallest(folder.path(), &["--only", only])).succeeds();
        results(folder.path())["rows"].as_array().unwrap().clone()
    };
    let first = run("point,tau");
    let again = run("tau");
    assert!(!again.is_empty());
    assert!(again.iter().all(|row| first.contains(row)), "measured again");
    let points = folder.path().join("points");
    let point = fs::read_dir(&points).unwrap().next().unwrap().unwrap().path();
    fs::write(&point, "cut off").unwrap();
    assert_eq!(run("point,tau").len(), first.len());
}

#[test]
fn lammps_named_after_a_run_takes_part_in_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let args = smallest(folder.path(), &["--only", "tau,step-length"]);
    let rows = |is_lammps: bool| {
        let mut rows = results(folder.path())["rows"].as_array().unwrap().clone();
        rows.retain(|row| match is_lammps {
            true => row["engine"] == "LAMMPS",
            false => row["figure"] == "tau",
        });
        rows
    };
    bench(&args).succeeds();
    let (first, others) = (rows(true), rows(false));
    assert!(!first.is_empty() && first.iter().all(|row| row["status"] == "not-available"), "{first:?}");
    for library in ["/nowhere/liblammps.so", "/elsewhere/liblammps.so"] {
        BENCH.run_with("LAZYGRID_LAMMPS_LIB", library, &args).fails();
        for row in rows(true) {
            assert_eq!(row["status"], "error");
            assert!(row["reason"].as_str().unwrap().contains(library), "{row}");
        }
        assert_eq!(rows(false), others, "measured again");
    }
}

#[test]
fn documents_of_the_last_run_are_replaced_not_rewritten() {
    let folder = tempfile::tempdir().unwrap();
    let run = |only: &str| {
        bench(smallest(folder.path(), &["--only", only])).succeeds();
    };
    run("tau");
    fs::write(folder.path().join("gpu.md"), "old").unwrap();
    let names = ["results.json", "results.csv", "report.html", "results.md", "gpu.md"];
    let old = names.map(|name| {
        fs::hard_link(folder.path().join(name), folder.path().join(format!("old-{name}"))).unwrap();
        read(folder.path(), name)
    });
    run("point");
    bench(["gpu-results", "--output", path(&folder.path().join("gpu.md"))]).succeeds();
    for (name, old) in names.into_iter().zip(old) {
        assert!(read(folder.path(), name) != old, "{name}");
        assert!(read(folder.path(), &format!("old-{name}")) == old, "{name} was rewritten in place");
    }
}

#[test]
fn compare_reports_slower_measurements() {
    let folder = tempfile::tempdir().unwrap();
    let [old, new] = ["old", "new"].map(|name| folder.path().join(name));
    bench(smallest(&old, &["--only", "tau", "--runs", "5"])).succeeds();
    let same = bench(["compare", path(&old), path(&old)]).succeeds();
    assert!(same.out.contains("0 broken, 0 lost, 0 slower, 0 faster"), "{}", same.out);

    let mut slow = results(&old);
    for time in slow["rows"][0]["wall"].as_array_mut().unwrap() {
        // More than runs of a busy machine differ.
        *time = (time.as_f64().unwrap() * 1e6).into();
    }
    slow["rows"][1]["status"] = "error".into();
    slow["rows"].as_array_mut().unwrap().remove(2);
    fs::create_dir(&new).unwrap();
    fs::write(new.join("results.json"), slow.to_string()).unwrap();
    let changed = bench(["compare", path(&old), path(&new)]);
    assert_eq!(changed.code, Some(1));
    assert!(changed.out.contains("1 broken, 1 lost, 1 slower"), "{}", changed.out);
    assert!(changed.out.starts_with("broken   tau"), "{}", changed.out);
    assert!(changed.out.contains("lost     tau equal 200"), "{}", changed.out);
    assert_eq!(BENCH.run_with_closed_output(["compare", path(&old), path(&new)]).code, Some(1));
    assert_eq!(BENCH.run_with_closed_output(["compare", path(&old), path(&old)]).code, Some(0));
}

#[test]
fn wrong_answer_is_an_error_with_closed_output() {
    let folder = tempfile::tempdir().unwrap();
    let args = smallest(folder.path(), &["--only", "point"]);
    bench(&args).succeeds();
    let point = fs::read_dir(folder.path().join("points")).unwrap().next().unwrap().unwrap().path();
    let mut cached_point: Value = serde_json::from_str(&fs::read_to_string(&point).unwrap()).unwrap();
    cached_point["rows"][0]["status"] = "error".into();
    fs::write(&point, cached_point.to_string()).unwrap();
    assert_eq!(BENCH.run_with_closed_output(&args).code, Some(1));
    assert!(bench(args).fails().out.contains("1 with a wrong answer"));
}

#[test]
fn wrong_usage_is_refused() {
    for (args, code, message) in [
        (&["figures", "--only", "6"][..], 2, "invalid value '6' for '--only"),
        (&["figures", "--quick", "--smoke"], 2, "'--quick' cannot be used with '--smoke'"),
        (&["compare", "/nowhere", "/nowhere"], 1, "/nowhere/results.json: cannot read"),
    ] {
        let run = bench(args);
        assert!(run.code == Some(code) && run.err.contains(message), "{args:?}: {}", run.err);
    }
}
