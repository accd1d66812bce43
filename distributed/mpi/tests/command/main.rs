//! `lazygrid-mpi detect` under `mpirun`, run by `test.sh`.

#![allow(clippy::unwrap_used, reason = "tests")]

#[path = "../common/mod.rs"]
mod common;
mod precision;

use std::path::Path;
use std::process::{Command, Output};

use common::run_two_ranks;
use lazygrid::{Backend, Detector, Space, Sphere, Spheres};

fn run(ranks: usize, directory: &Path, arguments: &[&str]) -> Output {
    Command::new("mpirun")
        .args(["--oversubscribe", "-n", &ranks.to_string(), env!("CARGO_BIN_EXE_lazygrid-mpi"), "detect"])
        .args(["--backend", "cpu", "--threads", "1"])
        .args(arguments)
        .current_dir(directory)
        .output()
        .unwrap()
}

fn stdout(ranks: usize, directory: &Path, arguments: &[&str]) -> String {
    let output = run(ranks, directory, arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?} on {ranks} ranks: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

fn error(ranks: usize, directory: &Path, arguments: &[&str], code: i32) -> String {
    let output = run(ranks, directory, arguments);
    assert_eq!(output.status.code(), Some(code), "{arguments:?} on {ranks} ranks");
    String::from_utf8(output.stderr).unwrap()
}

fn spheres(n: u32) -> Vec<Sphere> {
    let at = |k: u32, by: u32| (k.wrapping_mul(by) >> 8) % 4001;
    let sphere = |k| {
        let center = [2_654_435_761, 2_246_822_519, 3_266_489_917].map(|by| at(k + 1, by) as f32 * 0.003);
        Sphere::new(center, 0.1 * (1 + k % 7) as f32)
    };
    (0..n).map(sphere).collect()
}

fn pairs<'a>(spheres: impl Into<Spheres<'a>>, space: Space) -> Vec<[u32; 2]> {
    let mut detector = Detector::new(lazygrid::Config::default().backend(Backend::Cpu).space(space)).unwrap();
    detector.pairs(spheres.into()).unwrap().iter().map(|pair| [pair.i, pair.j]).collect()
}

fn array(header: &str, data: &[u8]) -> Vec<u8> {
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), data].concat()
}

fn npy(spheres: &[Sphere]) -> Vec<u8> {
    let text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, 4), }}", spheres.len());
    let rows = spheres.iter().flat_map(|s| [s.center.x, s.center.y, s.center.z, s.radius]);
    array(&format!("{text:<117}\n"), &rows.flat_map(f32::to_le_bytes).collect::<Vec<u8>>())
}

fn rows(spheres: &[Sphere]) -> impl Iterator<Item = String> {
    spheres.iter().map(|s| format!("{},{},{},{}\n", s.center.x, s.center.y, s.center.z, s.radius))
}

fn csv(pairs: &[[u32; 2]]) -> String {
    std::iter::once("i,j\n".to_owned()).chain(pairs.iter().map(|[i, j]| format!("{i},{j}\n"))).collect()
}

#[test]
fn every_way_to_read_gives_the_pairs_of_one_process() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let spheres = spheres(1500);
    std::fs::write(at("all.npy"), npy(&spheres)).unwrap();
    let table: String = rows(&spheres).collect();
    std::fs::write(at("all.csv"), format!("# a comment\nx,y,z,r\n{table}")).unwrap();
    let xyz: String = spheres
        .iter()
        .map(|s| format!("A {} {} {} {}\n", s.center.x, s.center.y, s.center.z, s.radius))
        .collect();
    let header = "1500\nProperties=species:S:1:pos:R:3:radius:R:1\n";
    std::fs::write(at("all.xyz"), format!("{header}{xyz}")).unwrap();
    for (rank, rows) in spheres.chunks(500).enumerate() {
        std::fs::write(at(&format!("part-{rank}.npy")), npy(rows)).unwrap();
    }
    let expected = csv(&pairs(&spheres, Space::UNBOUNDED));
    assert!(expected.lines().count() > 500);
    for (ranks, file) in
        [(1, "all.npy"), (3, "all.npy"), (3, "all.csv"), (2, "all.xyz"), (3, "part-{rank}.npy")]
    {
        for no_rebalance in [&["--no-rebalance"][..], &[]] {
            let arguments = [&[file, "-o", "pairs.csv", "--gather"], no_rebalance].concat();
            let said = stdout(ranks, directory.path(), &arguments);
            assert!(said.contains("spheres    1500 "), "{said}");
            let found = std::fs::read_to_string(at("pairs.csv")).unwrap();
            assert!(found == expected, "{file} on {ranks} ranks");
        }
    }
}

#[test]
fn a_file_per_rank_and_a_manifest() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let spheres = spheres(900);
    let space = Space::periodic([Some(12.0), None, Some(12.0)]).unwrap();
    std::fs::write(at("all.npy"), npy(&spheres)).unwrap();
    let arguments = ["all.npy", "--periodic", "12,-,12", "-o", "pairs.npy", "--json"];
    let said: serde_json::Value = serde_json::from_str(&stdout(3, directory.path(), &arguments)).unwrap();
    let manifest = std::fs::read(at("pairs.manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_slice(&manifest).unwrap();
    let expected = pairs(&spheres, space);
    for reported in [&said["pairs"], &manifest["pairs"]] {
        assert_eq!(reported.as_u64(), Some(expected.len() as u64));
    }
    assert_eq!((manifest["type"].as_str(), manifest["spheres"].as_u64()), (Some("u32"), Some(900)));
    let mut found = Vec::new();
    for file in manifest["files"].as_array().unwrap() {
        let bytes = std::fs::read(at(file["file"].as_str().unwrap())).unwrap();
        let data = &bytes[10 + usize::from(bytes[8]) + 256 * usize::from(bytes[9])..];
        let of_rank: Vec<[u32; 2]> = data
            .chunks_exact(8)
            .map(|row| [0, 4].map(|k| u32::from_le_bytes(row[k..k + 4].try_into().unwrap())))
            .collect();
        assert!(of_rank.is_sorted() && file["pairs"].as_u64() == Some(of_rank.len() as u64));
        found.extend(of_rank);
    }
    found.sort_unstable();
    assert_eq!(found, expected);
}

#[test]
fn input_error_is_printed_once_with_its_location() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let mut spheres = spheres(300);
    spheres[250].radius = -1.0;
    std::fs::write(at("bad.npy"), npy(&spheres)).unwrap();
    let table: String = rows(&spheres).collect();
    std::fs::write(at("bad.csv"), format!("x,y,z,r\n{table}")).unwrap();
    for (file, location) in [("bad.npy", "bad.npy, row 250: "), ("bad.csv", "bad.csv, line 252: ")] {
        let said = error(3, directory.path(), &[file, "-o", "pairs.npy"], 1);
        let lines: Vec<_> = said.lines().filter(|line| line.starts_with("error: ")).collect();
        assert_eq!(lines.len(), 1, "{said}");
        assert!(lines[0].starts_with(&format!("error: rank 2: {location}")), "{}", lines[0]);
    }
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 2);
    let said = error(2, directory.path(), &["missing.npy"], 1);
    assert!(said.contains("error: rank 0: missing.npy: cannot read: "), "{said}");
    let said = error(2, directory.path(), &["bad.npy", "-o", "pairs.txt"], 2);
    assert!(said.contains("error: rank 0: pairs.txt: unknown output format"), "{said}");
    let said = error(2, directory.path(), &["bad.npy", "--gather"], 2);
    assert!(said.contains("--output <FILE>"), "{said}");
}

#[test]
fn arguments_that_differ_between_ranks_are_refused_by_name() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let spheres = spheres(300);
    for name in ["all.npy", "other.npy"] {
        std::fs::write(at(name), npy(&spheres)).unwrap();
    }
    let table: String = rows(&spheres).collect();
    std::fs::write(at("all.csv"), format!("x,y,z,r\n{table}")).unwrap();
    let base = ["detect", "all.npy", "--backend", "cpu"];
    let with = |more: &[&'static str]| [&base[..], more].concat();
    let refused = |name: &str, other: &[&str]| {
        let said = run_two_ranks(directory.path(), [&base, other], 2);
        let expected = format!("error: the setting `{name}` is ");
        assert_eq!(said.matches(&expected).count(), 1, "{said}");
        assert!(said.contains(" on rank 0 and ") && said.contains(" on rank 1; "), "{said}");
    };
    refused("FILE", &["detect", "other.npy"]);
    refused("FILE", &["detect", "all.csv"]);
    refused("--format", &with(&["--format", "npy"]));
    refused("--frame", &with(&["--frame", "0"]));
    refused("--radius", &with(&["--radius", "A=2"]));
    refused("--precision", &with(&["--precision", "f64"]));
    refused("--periodic", &with(&["--periodic", "12,12,12"]));
    refused("--periodic", &with(&["--periodic", "none"]));
    refused("--no-rebalance", &with(&["--no-rebalance"]));
    refused("--output", &with(&["-o", "pairs.npy"]));
    refused("command", &["bench-scaling", "--per-rank", "100"]);
    let output = with(&["-o", "pairs.npy"]);
    let gather = with(&["-o", "pairs.npy", "--gather"]);
    let said = run_two_ranks(directory.path(), [&output, &gather], 2);
    assert!(said.contains("error: the setting `--gather` is false on rank 0 and true on rank 1; "), "{said}");
    let bench_scaling = ["bench-scaling", "--per-rank", "100"];
    let said = run_two_ranks(
        directory.path(),
        [&bench_scaling, &[&bench_scaling[..], &["--steps", "3"]].concat()],
        2,
    );
    assert!(said.contains("error: the setting `--steps` is 5 on rank 0 and 3 on rank 1; "), "{said}");
    let with_options = with(&["--threads", "2", "--max-pairs", "100000", "--json"]);
    run_two_ranks(directory.path(), [&base, &with_options], 0);
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 3);
}

#[test]
fn arguments_of_one_rank_that_are_no_command_end_all_ranks() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("all.npy"), npy(&spheres(30))).unwrap();
    let base: &[&str] = &["detect", "all.npy", "--backend", "cpu"];
    for odd in [&["detect"][..], &["detect", "all.npy", "--perodic", "1,1,1"], &["--help"], &[]] {
        for (arguments, rank) in [([base, odd], 1), ([odd, base], 0)] {
            let said = run_two_ranks(directory.path(), arguments, 2);
            let expected = format!("error: rank {rank} has other arguments than rank {}; ", 1 - rank);
            assert_eq!(said.matches(&expected).count(), 1, "{odd:?}: {said}");
        }
    }
}

fn codes_within(mebibytes: u32, directory: &Path, file: &str) -> (Vec<String>, String) {
    let script = format!("ulimit -v {}; \"$0\" \"$@\"; echo \"code $?\"", mebibytes << 10);
    let output = Command::new("mpirun")
        .args(["--oversubscribe", "--timeout", "300", "-n", "3", "sh", "-c", &script])
        .arg(env!("CARGO_BIN_EXE_lazygrid-mpi"))
        .args(["detect", file, "--backend", "cpu", "--threads", "1", "-o", "pairs.npy"])
        .env("MALLOC_ARENA_MAX", "1")
        .current_dir(directory)
        .output()
        .unwrap();
    let [out, said] = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    let codes = out.lines().filter_map(|line| line.strip_prefix("code ")).map(str::to_owned).collect();
    (codes, said)
}

#[test]
fn memory_limits_end_no_rank_by_a_signal() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("few.npy"), npy(&spheres(10))).unwrap();
    std::fs::write(directory.path().join("all.npy"), npy(&spheres(100_000))).unwrap();
    let mut ended = Vec::new();
    for mebibytes in (150..330).step_by(20).chain([1000]) {
        // MPI itself cannot start within some limits.
        if codes_within(mebibytes, directory.path(), "few.npy").0 != ["0"; 3] {
            continue;
        }
        let (codes, said) = codes_within(mebibytes, directory.path(), "all.npy");
        assert!(codes == ["0"; 3] || codes == ["1"; 3], "{mebibytes} MiB: {codes:?}: {said}");
        ended.push(codes[0] == "0");
    }
    assert!(ended.contains(&false) && ended.last() == Some(&true), "{ended:?}");
}

#[test]
fn output_in_place_of_an_input_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let input = npy(&spheres(60));
    let names = ["pairs.0.npy", "part.0.npy", "part.1.npy", "part-0.npy", "part-1.npy", "all.manifest.json"];
    names.iter().for_each(|name| std::fs::write(at(name), &input).unwrap());
    for (file, read, arguments) in [
        ("pairs.0.npy", "pairs.0.npy", &["-o", "pairs.npy"][..]),
        ("pairs.0.npy", "pairs.0.npy", &["-o", "./pairs.0.npy", "--gather"]),
        ("part.{rank}.npy", "part.0.npy", &["-o", "part.npy"]),
        ("part-{rank}.npy", "part-1.npy", &["-o", "part-1.npy", "--gather"]),
        ("all.manifest.json", "all.manifest.json", &["--format", "npy", "-o", "all.npy"]),
    ] {
        let said = error(2, directory.path(), &[&[file], arguments].concat(), 2);
        assert!(said.contains(&format!(": {read}: the output ")), "{file} {arguments:?}: {said}");
        assert!(names.iter().all(|name| std::fs::read(at(name)).unwrap() == input), "{file} {arguments:?}");
    }
    stdout(2, directory.path(), &["part.{rank}.npy", "-o", "part.npy", "--gather"]);
}

#[test]
fn smoldyn_listing_repeated_on_another_rank_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let listing: String = (1..=20).map(|serial| format!("A(solution) {serial} 0 0 {serial}\n")).collect();
    std::fs::write(directory.path().join("twice.smoldyn"), listing.repeat(2)).unwrap();
    std::fs::write(directory.path().join("once.smoldyn"), listing).unwrap();
    let said = error(2, directory.path(), &["twice.smoldyn", "--radius", "A=0.6"], 1);
    assert!(said.contains("twice.smoldyn, line 21: ") && said.contains("line 1"), "{said}");
    let said = stdout(2, directory.path(), &["once.smoldyn", "--radius", "A=0.6"]);
    assert!(said.contains("pairs      19 "), "{said}");
}

#[test]
fn repeated_radius_is_refused_and_unused_one_is_warned_of() {
    let directory = tempfile::tempdir().unwrap();
    let table: String = (0..60).map(|k| format!("{k},0,0,{}\n", if k < 30 { 'A' } else { 'B' })).collect();
    std::fs::write(directory.path().join("all.csv"), format!("x,y,z,species\n{table}")).unwrap();
    std::fs::write(directory.path().join("all.lst"), "A(up) 0 0 0 1\nB(up) 9 0 0 2\n").unwrap();
    for file in ["all.csv", "all.lst"] {
        let twice = [file, "--radius", "A=1", "--radius", "A=2"];
        let said = error(3, directory.path(), &twice, 2);
        assert_eq!(said.matches("--radius A is given twice, as 1 and 2; give one").count(), 1, "{said}");
        let misspelled = [file, "--radius", "A=0.5", "--radius", "B=0.5", "--radius", "b=0.5"];
        let run = run(3, directory.path(), &misspelled);
        let said = String::from_utf8(run.stderr).unwrap();
        assert!(run.status.success(), "{said}");
        let warning = format!("{file}: no sphere is of species 'b', for which a radius was given");
        assert_eq!((said.matches("no sphere").count(), said.matches(&warning).count()), (1, 1), "{said}");
    }
}

#[test]
fn frame_after_the_only_one_is_refused_in_every_format() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let spheres = spheres(30);
    let table: String = rows(&spheres).collect();
    std::fs::write(at("all.npy"), npy(&spheres)).unwrap();
    std::fs::write(at("all.csv"), format!("x,y,z,r\n{table}")).unwrap();
    std::fs::write(at("all.smoldyn"), "A(solution) 1 2 3 1\nA(solution) 4 5 6 2\n").unwrap();
    for file in ["all.npy", "all.csv", "all.smoldyn"] {
        let arguments = [file, "--radius", "A=1", "--frame"];
        let said = error(2, directory.path(), &[&arguments[..], &["1"]].concat(), 1);
        assert!(said.contains(&format!("{file}: there is no frame 1; ")), "{said}");
        stdout(2, directory.path(), &[&arguments[..], &["0"]].concat());
    }
}

#[test]
fn wrong_usage_has_the_exit_code_of_the_single_process() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("all.npy"), npy(&spheres(30))).unwrap();
    for (arguments, message) in [
        (&["all.npy", "-o", "all.npy", "--gather"][..], "choose another --output"),
        (&["all.npy", "-o", "pairs.txt"], "unknown output format"),
        (&["all.npy", "--threads=0"], "expected a whole number above zero"),
    ] {
        // Each option may be given once, and `run` gives --threads.
        let output = Command::new("mpirun")
            .args(["--oversubscribe", "-n", "2", env!("CARGO_BIN_EXE_lazygrid-mpi"), "detect"])
            .args(arguments)
            .current_dir(directory.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && said.contains(message), "{arguments:?}: {said}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn full_disk_of_one_file_leaves_all_files_of_the_last_run() {
    for full in ["pairs.1.npy", "pairs.manifest.json"] {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        std::fs::write(at("all.npy"), npy(&spheres(60))).unwrap();
        let other_files =
            ["pairs.0.npy", "pairs.1.npy", "pairs.manifest.json"].into_iter().filter(|name| *name != full);
        other_files.clone().for_each(|name| std::fs::write(at(name), "of the last run").unwrap());
        std::os::unix::fs::symlink("/dev/full", at(full)).unwrap();
        let said = error(2, directory.path(), &["all.npy", "-o", "pairs.npy"], 1);
        assert!(said.contains(&format!("{full}: cannot write: No space left on device")), "{said}");
        for name in other_files {
            assert_eq!(std::fs::read(at(name)).unwrap(), b"of the last run", "{name} after {full}");
        }
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 4);
    }
}

#[test]
fn array_headers_of_any_spelling_are_read() {
    let directory = tempfile::tempdir().unwrap();
    let spheres = spheres(300);
    let columns = |column: usize| {
        spheres
            .iter()
            .map(move |s| [s.center.x, s.center.y, s.center.z, s.radius][column])
            .collect::<Vec<_>>()
    };
    let fortran: Vec<f32> = (0..4).flat_map(columns).collect();
    let c: Vec<f32> = spheres.iter().flat_map(|s| [s.center.x, s.center.y, s.center.z, s.radius]).collect();
    let expected = csv(&pairs(&spheres, Space::UNBOUNDED));
    for (text, numbers) in [
        ("{'descr':'<f4','fortran_order':True,'shape':(300,4),}\n", &fortran),
        ("{\"descr\": '<f4', \"fortran_order\" : True, 'shape': (300, 4)}\n", &fortran),
        ("{\"shape\" : ( 300 , 4 ), 'descr': '<f4', 'fortran_order':False}", &c),
    ] {
        let numbers: Vec<u8> = numbers.iter().copied().flat_map(f32::to_le_bytes).collect();
        std::fs::write(directory.path().join("all.npy"), array(text, &numbers)).unwrap();
        stdout(3, directory.path(), &["all.npy", "-o", "pairs.csv", "--gather"]);
        let found = std::fs::read_to_string(directory.path().join("pairs.csv")).unwrap();
        assert!(found == expected, "{text}");
    }
}
