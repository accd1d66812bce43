//! `lazygrid-mpi simulate` against one process, run by `test.sh`.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use common::run_two_ranks;
use lazygrid_sim::State;
use lazygrid_sim::run::Run;
use lazygrid_sim::run::checkpoint::Checkpoint;
use lazygrid_sim::scenario::{Overrides, Scenario};

fn scenario(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../simulator/scenarios").join(name).with_extension("toml")
}

fn mpirun(ranks: u32, arguments: &[&str]) -> Output {
    Command::new("mpirun")
        .args(["--oversubscribe", "-n", &ranks.to_string(), env!("CARGO_BIN_EXE_lazygrid-mpi"), "simulate"])
        .args(["--threads", "1"])
        .args(arguments)
        .output()
        .unwrap()
}

fn over(ranks: u32, scenario: &Path, directory: &Path, arguments: &[&str]) -> String {
    let paths = [scenario.to_str().unwrap(), "-o", directory.to_str().unwrap()];
    let output = mpirun(ranks, &[&paths[..], arguments].concat());
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{} on {ranks} ranks: {errors}", scenario.display());
    String::from_utf8(output.stdout).unwrap()
}

fn error(ranks: u32, arguments: &[&str]) -> String {
    let output = mpirun(ranks, arguments);
    assert_eq!(output.status.code(), Some(1), "{arguments:?} on {ranks} ranks");
    let said = String::from_utf8(output.stderr).unwrap();
    let errors: Vec<_> = said.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{said}");
    errors[0].to_owned()
}

fn alone(path: &Path, directory: &Path, changes: &Overrides, resume: bool) -> String {
    let mut scenario = Scenario::read(path).unwrap();
    scenario.change(changes);
    let run = Run { threads: Some(1), resume, ..Run::new(scenario, path, directory) };
    let (_, simulation) = run.run(|_| ControlFlow::Continue(())).unwrap();
    run.summary(&simulation)
}

fn files(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap());
    files
        .map(|entry| (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap()))
        .filter(|(name, _)| !name.starts_with("checkpoint"))
        .collect()
}

fn state(directory: &Path) -> State {
    let path = directory.join("checkpoint");
    let mut state = Checkpoint::read(&path).unwrap().into_state(&path).unwrap();
    state.particles = state.particles.permuted(&state.particles.by_id());
    state.bound.sort_unstable_by_key(|bound| bound.id);
    state
}

fn compare(name: &str, times: [u32; 2], numbers: &[u32]) -> State {
    compare_at(&scenario(name), times, numbers)
}

fn compare_at(path: &Path, [steps, frames_every]: [u32; 2], numbers: &[u32]) -> State {
    let directory = tempfile::tempdir().unwrap();
    let (name, one) = (path.display(), directory.path().join("run"));
    let changes =
        Overrides { steps: Some(steps), frames_every: frames_every.try_into().ok(), ..Overrides::default() };
    let summary = alone(path, &one, &changes, false);
    let (expected, final_state) = (files(&one), state(&one));
    assert!(expected["series.csv"].len() > 60 && !final_state.particles.is_empty(), "{name}");
    std::fs::remove_dir_all(&one).unwrap();
    let arguments = ["--steps", &steps.to_string(), "--frames-every", &frames_every.to_string()];
    for &ranks in numbers {
        assert_eq!(over(ranks, path, &one, &arguments), summary);
        let found = files(&one);
        assert!(expected.keys().eq(found.keys()), "{name}: {:?}", found.keys());
        for (file, expected) in &expected {
            assert!(found[file] == *expected, "{file} of {name} on {ranks} ranks");
        }
        assert!(state(&one) == final_state, "{name} on {ranks} ranks");
        std::fs::remove_dir_all(&one).unwrap();
    }
    final_state
}

#[test]
fn shipped_scenarios_are_those_of_one_process() {
    compare("acid-base", [150, 50], &[1, 2, 3, 8]);
    compare("conjugation", [40, 20], &[1, 2, 3, 8]);
    compare("receptors", [100, 100], &[1, 2, 3, 8]);
    compare("vessel", [900, 300], &[3]);
    compare("burst", [2, 1], &[2]);
}

#[test]
fn collisions_are_those_of_one_process() {
    let crowded = compare("crowded", [60, 20], &[1, 2, 3, 5]);
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("elastic.toml");
    let text = std::fs::read_to_string(scenario("crowded")).unwrap();
    let text = text
        .replacen("\"separate\"", "\"elastic\"", 1)
        .replace("diffusion =", "thermal-speed = 100\ndiffusion =");
    std::fs::write(&path, text.replacen("thermal-speed", "mass = 2\nthermal-speed", 1)).unwrap();
    let elastic = compare_at(&path, [60, 20], &[2, 5]);
    let contacts = [crowded, elastic].map(|state| state.totals.contacts);
    assert!(contacts.iter().all(|&contacts| contacts > 100), "{contacts:?}");
}

#[test]
fn checkpoint_resumes_on_another_number_of_ranks_and_in_one_process() {
    let directory = tempfile::tempdir().unwrap();
    let [one, many] = ["one", "many"].map(|name| directory.path().join(name));
    let path = scenario("acid-base");
    let changes =
        |steps| Overrides { steps: Some(steps), frames_every: 30.try_into().ok(), ..Overrides::default() };
    alone(&path, &one, &changes(120), false);
    let go_on = |ranks, steps: &str, resume: &[&str]| {
        over(ranks, &path, &many, &[&["--steps", steps, "--frames-every", "30"][..], resume].concat())
    };
    go_on(3, "35", &[]);
    go_on(2, "70", &["--resume"]);
    alone(&path, &many, &changes(95), true);
    go_on(3, "120", &["--resume"]);
    assert!(files(&many) == files(&one) && state(&many) == state(&one));
}

#[test]
fn an_error_is_printed_once() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(at("bad.toml"), "time-step = 1\nsteps = 1\nseeds = 3\n").unwrap();
    let said = error(3, &[&at("bad.toml"), "-o", &at("out")]);
    assert!(said.starts_with("error: rank 0: ") && said.contains("bad.toml, line 3, `seeds`"), "{said}");
    let burst = scenario("burst");
    let said = error(2, &[burst.to_str().unwrap(), "-o", &at("out"), "--resume"]);
    assert!(said.contains("checkpoint: cannot read"), "{said}");
    assert!(!Path::new(&at("out")).exists());
}

fn simulate_on_two(arguments: [&[&str]; 2], code: i32) -> String {
    let [one, other] = arguments.map(|arguments| [&["simulate"], arguments].concat());
    run_two_ranks(Path::new("."), [&one, &other], code)
}

fn error_of_two(arguments: [&[&str]; 2]) -> String {
    let said = simulate_on_two(arguments, 2);
    let errors: Vec<_> = said.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{said}");
    errors[0].to_owned()
}

#[test]
fn threads_may_be_given_to_some_ranks_only() {
    let directory = tempfile::tempdir().unwrap();
    let (burst, output) = (scenario("burst"), directory.path().join("out"));
    let base = [burst.to_str().unwrap(), "-o", output.to_str().unwrap(), "--steps", "1"];
    let with_threads = [&base[..], &["--threads", "1"]].concat();
    simulate_on_two([&base, &with_threads], 0);
}

#[test]
#[cfg(target_os = "linux")]
fn signal_ends_a_run_with_a_checkpoint_and_its_exit_code() {
    let directory = tempfile::tempdir().unwrap();
    let (burst, output) = (scenario("burst"), directory.path().join("out"));
    let rank = "\"$0\" \"$@\" & rank=$!; until [ -e \"$CHECKPOINT\" ]; do sleep 0.1; done; \
                kill -TERM $rank; wait $rank; echo \"code $?\"";
    let ended = Command::new("mpirun")
        .args(["--oversubscribe", "--timeout", "300", "-n", "2", "sh", "-c", rank])
        .args([env!("CARGO_BIN_EXE_lazygrid-mpi"), "simulate", "--steps", "100000000", "-o"])
        .args([&output, &burst])
        .env("CHECKPOINT", output.join("checkpoint"))
        .output()
        .unwrap();
    let [out, said] = [ended.stdout, ended.stderr].map(|text| String::from_utf8(text).unwrap());
    assert_eq!(out.matches("code 143\n").count(), 2, "{out}{said}");
    assert!(said.contains("error: stopped after ") && output.join("checkpoint").exists(), "{said}");
}

#[test]
fn options_that_differ_between_ranks_are_refused_by_name() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let text = std::fs::read_to_string(scenario("burst")).unwrap();
    let other = text.replacen("diffusion = ", "diffusion = 1", 1);
    assert_ne!(text, other);
    std::fs::write(at("one.toml"), &text).unwrap();
    std::fs::write(at("other.toml"), &other).unwrap();
    let (one, other, output) = (at("one.toml"), at("other.toml"), at("out"));
    let base = [one.as_str(), "-o", &output, "--steps", "2"];
    for (name, odd) in [
        ("model", &[&other, "-o", &output, "--steps", "2"][..]),
        ("steps", &[&one, "-o", &output, "--steps", "1"]),
        ("directory", &[&one, "-o", &at("elsewhere"), "--steps", "2"]),
        ("seed", &[&base[..], &["--seed", "99"]].concat()),
        ("output", &[&base[..], &["--series-every", "2"]].concat()),
        ("resume", &[&base[..], &["--resume"]].concat()),
    ] {
        let said = error_of_two([&base, odd]);
        assert!(said.starts_with(&format!("error: the setting `{name}` is ")), "{said}");
    }
}
