//! The command from outside: outputs and exit codes.

mod animation;
mod check;
mod exclusions;
#[cfg(target_os = "linux")]
mod foreign_files;
mod generate;
mod gpu;
#[cfg(target_os = "linux")]
mod memory_limits;
mod outputs;
mod page;
mod periodic;
mod precision;
#[cfg(target_os = "linux")]
mod refusals;
mod simulate;
mod streams;
mod usage;

use std::ffi::OsStr;
use std::fs;
use std::path::Path;

use lazygrid::{Pair, Sphere};
use lazygrid_io::read::{Frames, Options};
use lazygrid_tests::command::{Program, Run, Scratch, data, has_gpu, npy, table};
use serde_json::Value;

const LAZYGRID: Program = Program(env!("CARGO_BIN_EXE_lazygrid"));

const SPHERES: &str = "x,y,z,r\n0,0,0,1\n1,0,0,1\n";
const FRAME: &str = "2\nProperties=pos:R:3:radius:R:1\n0 0 0 1\n1 0 0 1\n";

fn lazygrid(args: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Run {
    LAZYGRID.run(args)
}

fn detect<const N: usize>(args: [&str; N]) -> Run {
    LAZYGRID.run(["detect", "--backend", "cpu"].into_iter().chain(args))
}

fn detect_file<const N: usize>(file: &str, args: [&str; N]) -> Run {
    LAZYGRID.run(["detect", "--backend", "cpu", file].into_iter().chain(args))
}

const SMOLDYN: [&str; 6] = ["--radius", "acid=0.1", "--radius", "base=0.15", "--radius", "salt=0.2"];

fn pairs_by(count: usize, touch: impl Fn(usize, usize) -> bool) -> Vec<[u32; 2]> {
    let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| [i, j]));
    pairs.filter(|&[i, j]| touch(i, j)).map(|pair| pair.map(|k| k as u32)).collect()
}

fn brute_force(spheres: &[Sphere], lengths: [Option<f64>; 3]) -> Vec<[u32; 2]> {
    pairs_by(spheres.len(), |i, j| {
        let (a, b) = (&spheres[i], &spheres[j]);
        let differences = [0, 1, 2].map(|axis| {
            let d = f64::from(a.center[axis]) - f64::from(b.center[axis]);
            lengths[axis].map_or(d, |length| d - length * (d / length).round())
        });
        let cutoff = f64::from(a.radius) + f64::from(b.radius);
        differences.into_iter().map(|d| d * d).sum::<f64>() <= cutoff * cutoff
    })
}

fn read(path: &Path) -> Vec<Sphere> {
    let mut frames = Frames::open(path, Options::default()).expect("a file of frames");
    frames.next().expect("a frame").expect("a valid frame").spheres
}

const TWO_FRAMES: &str = "2\nProperties=pos:R:3:radius:R:1\n0 0 0 1\n2 0 0 1\n\
                          3\nProperties=pos:R:3:radius:R:1\n0 0 0 1\n1 0 0 1\n0 1 0 1\n";

#[test]
fn the_lammps_file_has_its_pairs() {
    let run = lazygrid(["detect", &data("lammps-pour.dump")]).succeeds();
    for line in
        ["frame      0 (step 3000)", "spheres    15208 of 3 species", "pairs      3072", "backend    cpu"]
    {
        assert!(run.out.lines().any(|l| l == line), "no '{line}' in\n{}", run.out);
    }
    for phase in ["read", "search", "total"] {
        assert!(run.out.lines().any(|l| l.get(11..).is_some_and(|l| l.starts_with(phase))), "{}", run.out);
    }
    assert_eq!(run.err, "");
}

#[test]
fn the_smoldyn_file_has_its_pairs_with_every_algorithm() {
    for algorithm in ["auto", "naive", "hash-grid", "array-grid", "recursive-grid", "cell-list"] {
        let file = data("smoldyn-burst.lst");
        let args = ["detect", &file, "--json", "--algorithm", algorithm];
        let object = lazygrid(args.iter().chain(&SMOLDYN)).succeeds().json();
        assert_eq!((&object["spheres"], &object["pairs"]), (&10_623.into(), &35_236.into()), "{algorithm}");
        assert!(algorithm == "auto" || object["algorithm"] == algorithm);
    }
}

#[test]
fn json_has_the_documented_fields() {
    let object = lazygrid(["detect", &data("lammps-pour.dump"), "--json"]).succeeds().json();
    let Value::Object(map) = &object else { panic!("not an object: {object}") };
    let names: Vec<_> = map.keys().map(String::as_str).collect();
    let documented = "frame step periodic cell_vectors periodic_from precision spheres pairs backend adapter algorithm reason gpu candidates phases";
    assert_eq!(names.join(" "), documented);
    assert_eq!((&object["periodic"], &object["periodic_from"]), (&Value::Null, &Value::Null));
    assert_eq!(object["step"], 3000);
    assert_eq!(object["pairs"], 3072);
    assert_eq!(object["backend"], "cpu");
    assert_eq!((&object["adapter"], &object["gpu"]), (&Value::Null, &Value::Null));
    assert!(object["reason"].as_str().unwrap().contains("GPU"));
    let phases = object["phases"].as_object().unwrap();
    assert!(phases.contains_key("read") && !phases.contains_key("write"));
    assert!(phases.values().all(|seconds| seconds.as_f64().is_some_and(|s| (0.0..60.0).contains(&s))));
}

#[test]
fn pairs_are_the_same_in_every_file_and_for_every_thread_count() {
    let scratch = Scratch::new();
    let [file, npy_path, csv_path] = ["burst.npy", "pairs.npy", "pairs.csv"].map(|name| scratch.path(name));
    lazygrid(["generate", "burst", "-n", "3000", "-o", &file]).succeeds();
    let spheres = read(Path::new(&file));
    let expected: Vec<_> = lazygrid::detect(&spheres).unwrap().iter().map(|&Pair { i, j }| [i, j]).collect();
    assert!(expected.len() > 10_000);
    for extra in [&[][..], &["--threads", "1"], &["--threads", "7"], &["--max-pairs", "1000"]] {
        for path in [&npy_path, &csv_path] {
            let object =
                lazygrid(["detect", &file, "--json", "-o", path].iter().chain(extra)).succeeds().json();
            assert_eq!(object["pairs"], expected.len(), "{extra:?}");
            assert!(object["phases"]["write"].is_number());
        }
        assert_eq!(npy::<2>(&npy_path, "<u4").1, expected, "{extra:?}");
        assert_eq!(table(&csv_path), expected, "{extra:?}");
    }
    for extra in [&[][..], &["--max-pairs", "1000"]] {
        lazygrid(["detect", &file, "--unordered", "-o", &npy_path].iter().chain(extra)).succeeds();
        let mut unordered = npy::<2>(&npy_path, "<u4").1;
        unordered.sort_unstable();
        assert_eq!(unordered, expected);
    }
    let count = lazygrid(["detect", &file, "--count", "--max-pairs", "1000", "--json"]).succeeds().json();
    assert_eq!(count["pairs"], expected.len());
}

#[test]
fn neighbors_are_the_pairs_both_ways() {
    let scratch = Scratch::new();
    let [file, npy_path, csv_path] = ["burst.npy", "near.npy", "near.csv"].map(|name| scratch.path(name));
    lazygrid(["generate", "burst", "-n", "300", "-o", &file]).succeeds();
    let mut both: Vec<_> = brute_force(&read(Path::new(&file)), [None; 3])
        .into_iter()
        .flat_map(|[i, j]| [[i, j], [j, i]])
        .collect();
    both.sort_unstable();
    for path in [&npy_path, &csv_path] {
        let object = lazygrid(["detect", &file, "--neighbors", "--json", "-o", path]).succeeds().json();
        assert_eq!(object["pairs"], both.len() / 2);
    }
    assert_eq!(table(&csv_path), both);
    let (shape, offsets) = npy::<2>(&scratch.path("near.offsets.npy"), "<u8");
    let (_, indices) = npy::<1>(&scratch.path("near.indices.npy"), "<u4");
    assert_eq!(shape, "(301,)");
    assert!(!Path::new(&npy_path).exists());
    let offsets: Vec<_> = offsets.into_iter().map(|[low, high]| (low as usize, high).0).collect();
    let lists = offsets
        .windows(2)
        .enumerate()
        .flat_map(|(k, w)| indices[w[0]..w[1]].iter().map(move |&[j]| [k as u32, j]));
    assert_eq!(lists.collect::<Vec<_>>(), both);
    lazygrid(["detect", &file, "--neighbors"]).succeeds();
}

#[test]
fn several_frames_are_numbered() {
    let scratch = Scratch::new();
    let file = scratch.write("two.xyz", TWO_FRAMES);
    let objects: Vec<Value> = lazygrid(["detect", &file, "--json"]).succeeds().json_lines();
    let seen: Vec<_> =
        objects.iter().map(|o| [&o["frame"], &o["spheres"], &o["pairs"]].map(Value::to_string)).collect();
    assert_eq!(seen, [["0", "2", "1"], ["1", "3", "3"]]);

    let second = lazygrid(["detect", &file, "--json", "--frame", "1"]).succeeds().json();
    assert_eq!((&second["frame"], &second["pairs"]), (&1.into(), &3.into()));
    let absent = lazygrid(["detect", &file, "--frame", "2"]).fails();
    assert!(absent.err.contains("there is no frame 2; frames are counted from 0 and the file has 2"));

    let output = scratch.path("pairs-{frame}.csv");
    lazygrid(["detect", &file, "-o", &output]).succeeds();
    assert_eq!(table(&scratch.path("pairs-0.csv")), [[0, 1]]);
    assert_eq!(table(&scratch.path("pairs-1.csv")), [[0, 1], [0, 2], [1, 2]]);
    let output = scratch.path("second.csv");
    lazygrid(["detect", &file, "--frame", "1", "-o", &output]).succeeds();
    assert_eq!(table(&output).len(), 3);

    let before = scratch.names();
    let run = lazygrid(["detect", &file, "-o", &scratch.path("all.csv")]).fails();
    assert!(run.err.contains("several frames") && run.err.contains("--frame"), "{}", run.err);
    assert_eq!(scratch.names(), before);
}

#[test]
fn bad_input_is_named_and_leaves_no_output() {
    let scratch = Scratch::new();
    let pour = fs::read_to_string(data("lammps-pour.dump")).unwrap();
    let lines: Vec<_> = pour.lines().collect();
    let cut = lines[..5000].join("\n");
    let nan = pour.replacen("-9.9391", "nan", 1);
    let mut burst = fs::read_to_string(data("smoldyn-burst.lst")).unwrap();
    burst += burst.lines().next().map(str::to_owned).unwrap().as_str();
    let second = TWO_FRAMES.replacen("0 1 0 1", "0 1 0 -1", 1);
    for (name, content, message) in [
        ("a.csv", "x,y,z,r\n1,2,3,4\n5,6,seven,8\n", "a.csv, line 3: z 'seven' is not a number"),
        ("b.csv", "x,y,z,r\n1,2,3,4\n5,6,7,1e400\n", "b.csv, line 3: r is 1e400; values must be finite"),
        ("a.dump", cut.as_str(), "a.dump, line 5000: the file ends after 4991 of 15208 atoms"),
        ("b.dump", nan.as_str(), "b.dump, line 11: y is nan; values must be finite"),
        (
            "a.lst",
            burst.as_str(),
            "a.lst, line 10624: molecule 18661 is listed a second time, first on line 1",
        ),
        ("a.npy", "\u{93}NUMPY", "a.npy: expected a NumPy array, found other content"),
        ("a.xyz", second.as_str(), "a.xyz, line 9: radius is -1; radii must not be negative"),
        ("b.xyz", "", "b.xyz: the file has no frame"),
        ("a.txt", "hello", "a.txt: neither the name nor the content tells the format"),
    ] {
        let file = scratch.write(name, content);
        let before = scratch.names();
        let run = lazygrid(["detect", &file, "-o", &scratch.path("out.npy")].iter().chain(&SMOLDYN)).fails();
        assert!(run.err.lines().last().unwrap().contains(message), "{message}\nis not in\n{}", run.err);
        assert_eq!(scratch.names(), before);
    }
    assert!(lazygrid(["detect", &scratch.path("absent.csv")]).fails().err.contains("No such file"));
}

#[test]
fn the_seeds_of_the_fuzz_targets_are_valid_files() {
    let seeds = fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../fuzz/seeds")).unwrap();
    let files: Vec<_> = seeds.map(|entry| entry.unwrap().path()).collect();
    assert_eq!(files.len(), 8);
    for file in files {
        lazygrid([Path::new("detect"), &file, Path::new("--radius=A=1"), Path::new("--radius=1=2")])
            .succeeds();
    }
}

#[test]
fn failures_name_their_remedy() {
    let scratch = Scratch::new();
    let pour = data("lammps-pour.dump");
    let many = lazygrid(["detect", &pour, "--max-pairs", "100"]).fails();
    assert!(many.err.contains("3072 pairs exceed the limit of 100") && many.err.contains("--count"));
    let nowhere = scratch.path("absent/pairs.npy");
    let run = lazygrid(["detect", &pour, "-o", &nowhere]).fails();
    assert!(run.err.contains("cannot write") && run.err.contains(&nowhere), "{}", run.err);
    let misspelt = lazygrid(["detect", &pour, "--radius", "4=1"]).succeeds();
    assert!(misspelt.err.contains("no sphere is of species '4'"), "{}", misspelt.err);
}

#[test]
fn a_radius_by_type_wins_over_the_column() {
    let object =
        lazygrid(["detect", &data("lammps-pour.dump"), "--json", "--radius", "1=0"]).succeeds().json();
    assert!(object["pairs"].as_u64().unwrap() < 3072);
}

#[test]
fn periodic_box_has_pairs_across_its_boundary() {
    let scratch = Scratch::new();
    let file = scratch.write("periodic.csv", "x,y,z,r\n0.2,5,0,0.5\n9.6,5,0,0.5\n-9.8,15,5,0.5\n");
    let pairs = |lengths: &str| {
        let run = lazygrid(["detect", &file, "--backend", "cpu", "--json", "--periodic", lengths]);
        run.succeeds().json()["pairs"].as_u64()
    };
    assert_eq!(pairs("-,-,-"), Some(0));
    assert_eq!(pairs("10,-,-"), Some(1));
    assert_eq!(pairs("10,10,5"), Some(3));
    assert_eq!(pairs("none"), Some(0));
    for (lengths, message) in [
        ("10", "expected three lengths"),
        ("10,10", "expected three lengths"),
        ("1,1,1,1", "expected three lengths"),
        ("10,x,10", "'x' is neither a length nor -"),
        ("10,10,0", "the length 0 is not a finite number above zero; write - for an axis"),
        ("0,1,1", "the length 0 is not a finite number above zero; write - for an axis"),
        ("10,10,-1", "the length -1 is not a finite number above zero"),
        ("inf,1,1", "the length inf is not a finite number above zero"),
    ] {
        let run = lazygrid(["detect", &file, "--periodic", lengths]);
        assert_eq!(run.code, Some(2), "{lengths}: {}", run.err);
        assert!(run.err.contains(message), "{lengths}: {}", run.err);
    }
}
