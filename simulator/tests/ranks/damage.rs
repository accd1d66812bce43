use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;

use lazygrid::Backend;
use lazygrid_sim::run::replicas::Replicas;
use lazygrid_sim::run::{Run, RunEnd};
use lazygrid_sim::scenario::Scenario;

use crate::{files, on_cpu, threads};

/// Few particles, so that each byte can be flipped, and every kind of file.
const SCENARIO: &str = r#"
time-step = 0.01
steps = 30
seed = 7
[boundary]
kind = "periodic"
low = [0, 0, 0]
high = [4, 4, 4]
[[species]]
name = "a"
radius = 0.1
diffusion = 4
[[decay]]
equation = "a -> a + a"
rate = 0.5
[[transmitter]]
name = "tx"
center = [2, 2, 2]
bits = "1101"
symbol-time = 0.05
release = [{ species = "a", count = 12 }]
[[receiver]]
name = "sink"
center = [3, 2, 2]
radius = 0.5
kind = "absorbing"
[[receiver]]
name = "cell"
center = [1, 2, 2]
radius = 0.7
kind = "receptors"
count = 20
binding-rate = 500
unbinding-rate = 2
[output]
every = 3
frames-every = 5
frames = ["xyz"]
arrivals = true
"#;

const STEP: u32 = 15;

fn run(directory: &Path, seed: u64, steps: u32, resume: bool) -> Run {
    let mut run = files::run(directory, steps, resume);
    let animation = run.scenario.output.animation;
    run.scenario = Scenario::parse(&run.path, SCENARIO.to_owned()).unwrap();
    run.scenario.output.animation = animation;
    (run.scenario.seed, run.scenario.steps) = (seed, steps);
    run.backend = Backend::Cpu;
    run
}

fn begun(seed: u64, steps: u32, ranks: u32) -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    files::go(&run(directory.path(), seed, steps, false), ranks);
    directory
}

fn resumed(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = files::every_file(directory);
    files.retain(|name, _| name != ".lock" && name != "animation.html");
    files
}

fn assert_refused(directory: &Path, ranks: u32, name: &str, damage: &str) {
    let before = fs::read(directory.join(name)).unwrap();
    let run = run(directory, 7, STEP + 5, true);
    let watch = |_| ControlFlow::Continue(());
    let messages: Vec<Option<String>> = match ranks {
        0 => vec![run.run(|_| ControlFlow::Continue(())).err().map(|error| error.to_string())],
        _ => threads::on(ranks, |thread| run.run_distributed(thread, on_cpu(), watch).err()),
    };
    for message in messages {
        let message = message.unwrap_or_else(|| panic!("{name}, {damage}: the run is not refused"));
        assert!(
            message.contains(&format!("{name}: ")) && message.contains("--overwrite"),
            "{name}, {damage}: {message}"
        );
    }
    assert_eq!(fs::read(directory.join(name)).unwrap(), before, "{name}, {damage}: the file was changed");
}

fn assert_refuses(directory: &Path, ranks: u32, name: &str, bytes: &[u8], damage: &str) {
    let path = directory.join(name);
    let whole = fs::read(&path).unwrap();
    overwrite(&path, bytes);
    assert_refused(directory, ranks, name, damage);
    overwrite(&path, &whole);
}

/// Some file systems wait for the disk after truncation.
fn overwrite(path: &Path, bytes: &[u8]) {
    let mut file = fs::File::options().write(true).open(path).unwrap();
    file.write_all(bytes).unwrap();
    file.set_len(bytes.len() as u64).unwrap();
}

fn assert_resumes(directory: &Path) {
    files::go(&run(directory, 7, 30, true), 0);
    let whole = begun(7, 30, 0);
    assert_eq!(files::files(directory), files::files(whole.path()));
    assert_eq!(files::state(directory), files::state(whole.path()));
}

#[test]
fn flipped_bit_in_any_file_is_refused_by_name() {
    for ranks in [0, 2] {
        let directory = begun(7, STEP, ranks);
        let files = resumed(directory.path());
        let names = ["checkpoint", "series.csv", "symbols.csv", "frames.xyz", "arrivals.csv", "releases.csv"];
        assert!(names.iter().all(|name| files.contains_key(*name)), "{:?}", files.keys());
        let mut flips = 0;
        for (name, whole) in &files {
            let sampled = |at: &usize| files::is_checkpoint(name) || *at < 40 || at.is_multiple_of(11);
            for at in (0..whole.len()).filter(sampled) {
                let mut bytes = whole.clone();
                bytes[at] ^= 1 << (at % 8);
                let readers = if ranks > 0 && at.is_multiple_of(16) { 3 } else { 0 };
                let damage = format!("bit {} of byte {at}", at % 8);
                assert_refuses(directory.path(), readers, name, &bytes, &damage);
                flips += 1;
            }
        }
        assert!(flips > 1000, "{flips} flips");
        assert_eq!(resumed(directory.path()), files);
        assert_resumes(directory.path());
    }
}

#[test]
fn file_of_another_length_is_refused_by_name() {
    for ranks in [0, 2] {
        let directory = begun(7, STEP, ranks);
        for (name, whole) in resumed(directory.path()) {
            let shorter = (0..whole.len()).step_by(whole.len() / 60 + 1).chain([whole.len() - 1]);
            for length in shorter {
                assert_refuses(
                    directory.path(),
                    ranks,
                    &name,
                    &whole[..length],
                    &format!("the first {length} bytes"),
                );
            }
            if files::is_checkpoint(&name) {
                for more in [&b"\0"[..], b"more", &whole] {
                    assert_refuses(directory.path(), ranks, &name, &[&whole[..], more].concat(), "longer");
                }
            } else {
                fs::write(directory.path().join(&name), [&whole[..], b"half a li"].concat()).unwrap();
            }
        }
        assert_resumes(directory.path());
    }
}

#[test]
fn file_of_another_checkpoint_is_refused_by_name() {
    let [original, later] = [STEP, STEP + 5].map(|steps| begun(7, steps, 2));
    let [seed, ranks] = [begun(8, STEP, 2), begun(7, STEP, 3)];
    let [original, later, seed, ranks] = [&original, &later, &seed, &ranks].map(|directory| directory.path());
    let part = |step: u32, rank: u32| format!("checkpoint.{step:09}.{rank}");
    for (from, name, to) in [
        (original, part(STEP, 1), part(STEP, 0)),
        (original, part(STEP, 0), part(STEP, 1)),
        (later, part(STEP + 5, 0), part(STEP, 0)),
        (seed, part(STEP, 1), part(STEP, 1)),
        (ranks, part(STEP, 0), part(STEP, 0)),
        (original, "checkpoint".to_owned(), part(STEP, 0)),
        (original, part(STEP, 0), "checkpoint".to_owned()),
        (seed, "series.csv".to_owned(), "series.csv".to_owned()),
        (seed, "frames.xyz".to_owned(), "frames.xyz".to_owned()),
        (original, "releases.csv".to_owned(), "arrivals.csv".to_owned()),
    ] {
        let bytes = fs::read(from.join(&name)).unwrap();
        for readers in [0, 3] {
            assert_refuses(original, readers, &to, &bytes, &format!("{name} of another checkpoint"));
        }
    }
    let whole = fs::read(original.join("checkpoint")).unwrap();
    fs::copy(later.join("checkpoint"), original.join("checkpoint")).unwrap();
    for rank in [0, 1] {
        fs::copy(original.join(part(STEP, rank)), original.join(part(STEP + 5, rank))).unwrap();
    }
    assert_refused(original, 0, &part(STEP + 5, 0), "an older part");
    for rank in [0, 1] {
        fs::copy(later.join(part(STEP + 5, rank)), original.join(part(STEP + 5, rank))).unwrap();
    }
    assert_refused(original, 0, "series.csv", "an older series");
    fs::write(original.join("checkpoint"), whole).unwrap();
    assert_resumes(original);
}

#[test]
fn part_of_another_checkpoint_with_equally_many_particles_is_refused() {
    let [original, other] = [7, 8].map(|seed| begun(seed, 0, 2));
    let [original, other] = [&original, &other].map(|directory| directory.path());
    let parts = ["checkpoint.000000000.0", "checkpoint.000000000.1"];
    for (from, name, to) in
        [(original, parts[0], parts[1]), (original, parts[1], parts[0]), (other, parts[0], parts[0])]
    {
        let bytes = fs::read(from.join(name)).unwrap();
        assert_refuses(original, 0, to, &bytes, &format!("{name} of another checkpoint"));
    }
    assert_resumes(original);
}

#[test]
fn damaged_series_of_a_replica_is_not_averaged_when_replicas_are_stopped() {
    let directory = tempfile::tempdir().unwrap();
    let replicas = |resume, flow| {
        let mut run = run(directory.path(), 7, STEP, resume);
        run.threads = Some(1);
        Replicas { run, count: 2.try_into().unwrap() }.run(|_, _| flow)
    };
    replicas(false, ControlFlow::Continue(())).unwrap();
    let stopped = replicas(true, ControlFlow::Break(())).unwrap();
    assert_eq!((stopped.end, stopped.finished), (RunEnd::Stopped, vec![0, 1]));
    let path = directory.path().join("replica-0001/series.csv");
    let mut bytes = fs::read(&path).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&path, bytes).unwrap();
    let error = replicas(true, ControlFlow::Break(())).unwrap_err().to_string();
    assert!(error.contains("replica-0001/series.csv: the file is damaged: its checksum is"), "{error}");
}
