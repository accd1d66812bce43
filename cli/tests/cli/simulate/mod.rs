mod arrivals;
#[cfg(unix)]
mod interruptions;
mod replicas;
mod report;
mod sweep;
mod walls;

use lazygrid_tests::command::{Scratch, has_gpu};
use std::fs;

use crate::lazygrid;

const SCENARIO: &str = r#"
time-step = 0.001
steps = 40
seed = 5
contact = "separate"
[boundary]
kind = "periodic"
low = [-2, -2, -2]
high = [2, 2, 2]
[[species]]
name = "acid"
radius = 0.1
diffusion = 5
[[species]]
name = "base"
radius = 0.15
diffusion = 3
[[species]]
name = "salt"
radius = 0.2
diffusion = 1
[[reaction]]
equation = "acid + base -> salt"
binding-radius = 0.3
probability = 0.5
[[decay]]
equation = "salt -> acid"
rate = 20
[[transmitter]]
name = "tx"
times = [0, 0.015]
shape = { kind = "ball", radius = 1 }
release = [{ species = "acid", count = 200 }, { species = "base", count = 150 }]
[[receiver]]
name = "rx"
center = [1.8, 0, 0]
radius = 0.3
kind = "absorbing"
species = ["acid", "base"]
[output]
every = 3
frames-every = 10
frames = ["xyz", "npy"]
"#;

pub(crate) fn files(directory: &str) -> Vec<(String, Vec<u8>)> {
    let contents_of = |entry: std::io::Result<fs::DirEntry>| {
        let entry = entry.expect("an entry");
        let name = entry.file_name().into_string().expect("a plain name");
        match entry.path().to_str() {
            Some(path) if entry.path().is_dir() => {
                files(path).into_iter().map(|(below, content)| (format!("{name}/{below}"), content)).collect()
            }
            _ => vec![(name, fs::read(entry.path()).expect("a file"))],
        }
    };
    let mut files: Vec<_> = fs::read_dir(directory).expect("a directory").flat_map(contents_of).collect();
    files.sort();
    files
}

#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
fn rows(path: &str) -> Vec<std::collections::HashMap<String, String>> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let header = lines.next().unwrap();
    lines.map(|line| header.iter().cloned().zip(line).collect()).collect()
}

#[test]
fn a_run_writes_the_files_of_the_scenario() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("s.toml", SCENARIO), scratch.path("out"));
    let run = lazygrid(["simulate", &scenario, "--output", &out]).succeeds();
    assert!(run.out.starts_with("steps      40 (0.04 s)\nseed       5\nspecies    acid: "), "{}", run.out);
    assert!(run.out.contains("acid: ") && run.out.contains(" of 400 released\n"), "{}", run.out);
    // Particles this dense react fast.
    assert!(run.err.lines().all(|line| line.contains("'acid + base -> salt': ")), "{}", run.err);
    let names: Vec<_> = files(&out).into_iter().map(|(name, _)| name).collect();
    let frames = [0, 10, 20, 30, 40].map(|step| format!("frame-{step:09}.npy"));
    let expected: Vec<_> = [".lock".to_owned(), "checkpoint".to_owned()]
        .into_iter()
        .chain(frames)
        .chain(["frames.xyz".into(), "series.csv".into()])
        .collect();
    assert_eq!(names, expected);

    let series = fs::read_to_string(out.clone() + "/series.csv").unwrap();
    let mut lines = series.lines();
    let header = "step,time,acid,base,salt,acid + base -> salt,salt -> acid,rx:acid,rx:base,pairs,contacts";
    assert_eq!(lines.next(), Some(header));
    assert_eq!(lines.next(), Some("0,0,200,150,0,0,0,0,0,0,0"));
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect();
    assert_eq!(
        rows.iter().map(|row| row[0]).collect::<Vec<_>>(),
        (1..=13).map(|k| f64::from(3 * k)).collect::<Vec<_>>()
    );
    for row in &rows {
        let [step, acid, base, salt, bound, decayed] = [row[0], row[2], row[3], row[4], row[5], row[6]];
        let bursts = if step >= 15.0 { 2.0 } else { 1.0 };
        assert_eq!(acid + row[7] + bound - decayed, 200.0 * bursts, "at step {step}");
        assert_eq!(base + row[8] + bound, 150.0 * bursts, "at step {step}");
        assert_eq!(salt, bound - decayed, "at step {step}");
    }
    let last = rows.last().unwrap();
    assert!([5, 6, 7, 10].iter().all(|&k| last[k] > 0.0), "something never happened: {last:?}");
    // Pairs are counted per step, so the last row may have none.
    assert!(rows.iter().any(|row| row[9] > 0.0), "no pairs in {rows:?}");

    let xyz = fs::read_to_string(out.clone() + "/frames.xyz").unwrap();
    assert!(xyz.starts_with("350\n") && xyz.lines().nth(1).is_some_and(|line| line.ends_with(" Step=0")));
    let frame = xyz.split("Step=20\n").nth(1).unwrap();
    let out_dir = out.clone();
    let npy = fs::read(out + "/frame-000000020.npy").unwrap();
    let end = 10 + usize::from(u16::from_le_bytes([npy[8], npy[9]]));
    let fields = "('id', '<u4'), ('species', '<u4'), ('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('r', '<f4')";
    let header = std::str::from_utf8(&npy[10..end]).unwrap();
    assert!(header.starts_with(&format!("{{'descr': [{fields}], ")), "{header}");
    let rows = npy[end..].chunks_exact(24);
    assert!(header.contains(&format!("'shape': ({},)", rows.len())), "{header}");
    let lists = ["frames.xyz", "frame-000000020.npy"].map(|name| {
        let (file, list) = (out_dir.clone() + "/" + name, scratch.path("pairs.csv"));
        let frame = if name == "frames.xyz" { "2" } else { "0" };
        let args = ["detect", &file, "--frame", frame, "--periodic", "4,4,4", "--ids", "--output", &list];
        let run = lazygrid(args).succeeds();
        assert!(!name.ends_with("xyz") || run.out.contains("frame      2 (step 20)"), "{}", run.out);
        fs::read_to_string(list).unwrap()
    });
    assert!(lists[0] == lists[1] && lists[0].lines().count() > 1, "{}", lists[0]);
    for (line, row) in frame.lines().zip(rows) {
        let words: Vec<[u8; 4]> = row.chunks_exact(4).map(|word| word.try_into().unwrap()).collect();
        let name = ["acid", "base", "salt"][u32::from_le_bytes(words[1]) as usize];
        let [x, y, z, r] = [2, 3, 4, 5].map(|k| f32::from_le_bytes(words[k]));
        assert_eq!(line, format!("{} {name} {x} {y} {z} {r}", u32::from_le_bytes(words[0])));
    }
}

#[test]
fn a_resumed_run_is_the_same_to_the_last_bit() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let [whole, resumed] = ["whole", "parts"].map(|name| scratch.path(name));
    lazygrid(["simulate", &scenario, "--output", &whole]).succeeds();
    lazygrid(["simulate", &scenario, "--output", &resumed, "--steps", "17"]).succeeds();
    let series = resumed.clone() + "/series.csv";
    fs::write(&series, fs::read_to_string(&series).unwrap() + "18,half a li").unwrap();
    lazygrid(["simulate", &scenario, "--output", &resumed, "--steps", "31", "--resume"]).succeeds();
    lazygrid(["simulate", &scenario, "--output", &resumed, "--resume"]).succeeds();
    assert_eq!(files(&whole), files(&resumed));
}

#[test]
fn neither_threads_nor_the_algorithm_change_a_byte() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let run = |name: &str, more: [&str; 2]| {
        let out = scratch.path(name);
        lazygrid(["simulate", &scenario, "--output", &out].into_iter().chain(more)).succeeds();
        files(&out)
    };
    let reference = run("reference", ["--threads", "1"]);
    for threads in ["2", "7"] {
        assert_eq!(run(threads, ["--threads", threads]), reference, "{threads} threads");
    }
    for algorithm in ["naive", "hash-grid", "array-grid", "recursive-grid", "cell-list"] {
        assert_eq!(run(algorithm, ["--algorithm", algorithm]), reference, "{algorithm}");
    }
    assert_ne!(run("seed", ["--seed", "6"]), reference);
}

#[test]
fn mistakes_are_named_by_line_and_key() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", &SCENARIO.replace("acid + base", "acid + bas"));
    let out = scratch.path("out");
    let run = lazygrid(["simulate", &scenario, "--output", &out]).fails();
    let message = "s.toml, line 23, `equation`: there is no species 'bas'; there are acid, base, salt\n";
    assert!(run.err.ends_with(message), "{}", run.err);
    assert_eq!(scratch.names(), ["s.toml"]);
    lazygrid(["simulate", &scratch.path("none.toml")]).fails();
    let scenario = scratch.write("long.toml", &SCENARIO.replace("time-step = 0.001", "time-step = 0.01"));
    let run = lazygrid(["simulate", &scenario, "--output", &out]).succeeds();
    let message = "long.toml, line 5, `contact`: salt collides about";
    assert!(run.err.contains(message) && run.err.contains("times in a step"), "{}", run.err);
}

#[test]
fn run_is_replaced_only_on_request() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("s.toml", SCENARIO), scratch.path("out"));
    let simulate = |more: &[&str]| {
        lazygrid(["simulate", &scenario, "--output", &out, "--steps", "5"].iter().chain(more))
    };
    assert!(simulate(&["--resume"]).fails().err.contains("checkpoint: cannot read"));
    simulate(&[]).succeeds();
    let before = files(&out);
    assert!(simulate(&[]).fails().err.contains("holds a run already"));
    assert!(simulate(&["--resume", "--seed", "8"]).fails().err.contains("give --seed 5"));
    assert!(simulate(&["--resume", "--series-every", "2"]).fails().err.contains("--series-every 3"));
    let run = lazygrid(["simulate", &scenario, "--output", &out, "--resume", "--steps", "4"]).fails();
    assert!(
        run.err.contains("5 steps are done and the run is to have 4 in all; give --steps 5"),
        "{}",
        run.err
    );
    let other = scratch.write("other.toml", &SCENARIO.replace("0.15", "0.16"));
    let run = lazygrid(["simulate", &other, "--output", &out, "--resume"]).fails();
    assert!(run.err.contains("another scenario"), "{}", run.err);
    assert_eq!(files(&out), before);
    simulate(&["--overwrite", "--seed", "8"]).succeeds();
    assert_ne!(files(&out), before);
    let run = lazygrid(["simulate", &scenario, "--output", &other]).fails();
    assert!(run.err.contains("it is a file; choose a directory"), "{}", run.err);
}

#[test]
fn damaged_file_is_refused_with_its_name_and_a_remedy() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("s.toml", SCENARIO), scratch.path("out"));
    lazygrid(["simulate", &scenario, "--output", &out, "--steps", "5"]).succeeds();
    let refused = |name: &str, bytes: &[u8]| {
        let path = format!("{out}/{name}");
        let whole = fs::read(&path).unwrap();
        fs::write(&path, bytes).unwrap();
        let run = lazygrid(["simulate", &scenario, "--output", &out, "--resume"]).fails();
        fs::write(&path, whole).unwrap();
        assert!(
            run.err.contains(&format!("{path}: ")) && run.err.contains("with --overwrite"),
            "{}",
            run.err
        );
        run.err
    };
    let whole = fs::read(out.clone() + "/checkpoint").unwrap();
    let mut flipped = whole.clone();
    flipped[whole.len() - 100] ^= 1;
    for damaged in [&whole[..whole.len() / 2], &whole[..10], &[], &[&whole[..], b"more"].concat(), &flipped] {
        assert!(refused("checkpoint", damaged).contains("the file is damaged: it"));
    }
    let older = refused("checkpoint", b"lazygrid checkpoint 6\n\x07");
    assert!(older.contains("the checkpoint has version 6 and this build reads version 7"), "{older}");
    let series = fs::read_to_string(out.clone() + "/series.csv").unwrap();
    refused("series.csv", series.replacen("200", "201", 1).as_bytes());
    lazygrid(["simulate", &scenario, "--output", &out, "--resume"]).succeeds();
}

#[test]
fn unwritable_outputs_fail_before_the_run() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let file = scratch.write("file", "");
    let long =
        |out: &str| lazygrid(["simulate", &scenario, "--steps", "4000000000", "--output", out]).fails();
    assert!(long(&file).err.contains("cannot write"));
    assert!(long(&(file + "/below")).err.contains("cannot write"));
}

#[test]
fn a_run_that_will_not_fit_the_disk_is_refused() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let out = scratch.path("out");
    let args = ["simulate", &scenario, "--steps", "4000000000", "--frames-every", "1", "--output", &out];
    let run = lazygrid(args).fails();
    assert!(
        run.err.contains("the run is going to write about") && run.err.contains("--no-space-check"),
        "{}",
        run.err
    );
}

#[test]
fn run_resumes_on_another_backend_with_a_warning() {
    if !has_gpu() {
        return;
    }
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", &SCENARIO.replace("separate", "ignore"));
    let out = scratch.path("out");
    let simulate = |steps: &str, more: &[&str]| {
        let args = ["simulate", &scenario, "--output", &out, "--steps", steps];
        lazygrid(args.iter().chain(more)).succeeds().err
    };
    simulate("5", &[]);
    assert!(!simulate("10", &["--resume"]).contains("steps were done on"));
    let said = simulate("15", &["--resume", "--backend", "gpu"]);
    assert!(said.contains("the first 10 steps were done on the cpu, those to come are on the gpu"), "{said}");
    let said = simulate("20", &["--resume"]);
    assert!(said.contains("the first 15 steps were done on the gpu, those to come are on the cpu"), "{said}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_shows_before_the_run() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("s.toml", SCENARIO), scratch.path("out"));
    fs::create_dir(&out).unwrap();
    std::os::unix::fs::symlink("/dev/full", out.clone() + "/series.csv").unwrap();
    let rare = "100000000";
    let args = [
        "simulate",
        &scenario,
        "--steps",
        rare,
        "--series-every",
        rare,
        "--frames-every",
        rare,
        "--output",
        &out,
    ];
    let run = lazygrid(args).fails();
    assert!(run.err.contains("series.csv: cannot write: No space left on device"), "{}", run.err);
}

#[test]
fn options_without_effect_are_warned_of() {
    let scratch = Scratch::new();
    let text = SCENARIO.replace("frames-every = 10\nframes = [\"xyz\", \"npy\"]\n", "");
    let [bare, full] =
        [("bare.toml", &text[..]), ("full.toml", SCENARIO)].map(|(name, text)| scratch.write(name, text));
    let warns = |scenario: &str, more: &[&str], message: &str| {
        let args = ["simulate", scenario, "--steps", "3", "--output", &scratch.path("out"), "--overwrite"];
        let run = lazygrid(args.iter().chain(more)).succeeds();
        run.err.lines().filter(|line| line.contains(message)).count()
    };
    let frames = "--frames-every has no effect";
    assert_eq!(warns(&bare, &["--frames-every", "2"], frames), 1);
    assert_eq!(warns(&bare, &["--frames-every", "2", "--sweep", "species.acid.diffusion=1,5"], frames), 1);
    assert_eq!(warns(&full, &["--frames-every", "2"], frames), 0);
    let run = lazygrid(["simulate", &full, "--backend", "gpu", "--algorithm", "naive"]);
    assert_eq!(run.code, Some(2), "{}", run.err);
    assert!(
        run.err.contains("naive searches on the CPU and has no effect with the gpu backend"),
        "{}",
        run.err
    );
}
