use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use lazygrid_sim::State;
use lazygrid_sim::run::checkpoint::Checkpoint;
use lazygrid_tests::command::{Scratch, has_gpu};
use lazygrid_tests::running::Running;

use super::{SCENARIO, files, lazygrid};
use crate::LAZYGRID;

/// Options of 32 runs that take seconds on any number of cores, so a signal comes in time on a busy machine.
pub(crate) const LONG: [&str; 8] =
    ["--threads", "2", "--steps", "200", "--series-every", "100", "--frames-every", "200"];

fn endless(scenario: &str, out: &str) -> Running {
    let rare = ["--steps", "100000000", "--series-every", "1000000", "--frames-every", "100000000"];
    begun(&[&["simulate", scenario, "--output", out][..], &rare].concat(), &(out.to_owned() + "/checkpoint"))
}

/// Starts a command, and waits until it has made `file`.
pub(crate) fn begun(args: &[&str], file: &str) -> Running {
    begun_with(Stdio::null(), args, file)
}

fn begun_with(output: Stdio, args: &[&str], file: &str) -> Running {
    LAZYGRID.start(args, Stdio::null(), output).wait_until(|| Path::new(file).exists())
}

#[test]
fn an_interrupted_run_resumes() {
    for (signal, code) in [("-INT", 130), ("-TERM", 143)] {
        let scratch = Scratch::new();
        let scenario = scratch.write("s.toml", SCENARIO);
        let [out, whole] = ["out", "whole"].map(|name| scratch.path(name));
        let ended = endless(&scenario, &out).end(signal);
        let message = String::from_utf8(ended.stderr).unwrap();
        assert_eq!(ended.status.code(), Some(code), "{signal}: {message}");
        let steps: u32 = message.split_whitespace().nth(3).unwrap().parse().unwrap();
        assert!(message.starts_with("error: stopped after ") && message.contains("--resume"), "{message}");
        let steps = (steps + 5).to_string();
        for (out, resume) in [(&out, Some("--resume")), (&whole, None)] {
            let args =
                ["simulate", &scenario, "--output", out, "--steps", &steps, "--series-every", "1000000"];
            lazygrid(args.into_iter().chain(["--frames-every", "100000000"]).chain(resume)).succeeds();
        }
        assert_eq!(files(&out), files(&whole), "{signal}");
    }
}

#[test]
fn stopped_before_the_seeds_are_written_leaves_no_table() {
    for more in [&[][..], &["--sweep", "species.acid.diffusion=1,5,9"]] {
        let scratch = Scratch::new();
        let (scenario, out) = (scratch.write("s.toml", SCENARIO), scratch.path("out"));
        let args = ["simulate", &scenario, "--output", &out, "--no-space-check"];
        let many = [&args[..], &["--replicas", "4000000000"], more].concat();
        let lock = out.clone() + if more.is_empty() { "/.lock" } else { "/point-0000/.lock" };
        let ended = begun(&many, &lock).end("-INT");
        let message = String::from_utf8(ended.stderr).unwrap();
        assert_eq!(ended.status.code(), Some(130), "{more:?}: {message}");
        assert!(message.contains("--replicas 4000000000"), "{message}");
        assert_eq!(message.contains("--resume"), !more.is_empty(), "{message}");
        for table in ["mean.csv", "sweep.csv", "point-0000/mean.csv"] {
            assert!(!fs::exists(format!("{out}/{table}")).unwrap(), "{more:?}: {table}");
        }
        let resume = if more.is_empty() { &[][..] } else { &["--resume"] };
        lazygrid([&args[..], &["--replicas", "2"], more, resume].concat()).succeeds();
    }
}

#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
fn typed(command: &str) -> Output {
    let binary = env!("CARGO_BIN_EXE_lazygrid");
    let command = command.trim().replacen("lazygrid ", &format!("'{binary}' "), 1);
    Command::new("sh").args(["-c", &command]).env("RUST_LOG", "error").output().unwrap()
}

#[test]
fn printed_command_resumes_the_run_with_its_options() {
    let scratch = Scratch::new();
    let scenario = scratch.write("my scenario.toml", SCENARIO);
    let [out, whole] = ["it's out", "whole"].map(|name| scratch.path(name));
    let options = ["--seed", "7", "--series-every", "1000000", "--frames-every", "100000000"];
    let options = [&options[..], &["--animate", "--animate-every", "1000000"]].concat();
    let args =
        |out, steps| [&["simulate", &scenario, "--output", out, "--steps", steps], &options[..]].concat();
    let ended = begun(&args(&out, "100000000"), &(out.clone() + "/checkpoint")).end("-INT");
    let message = String::from_utf8(ended.stderr).unwrap();
    let steps: u32 = message.split_whitespace().nth(3).unwrap().parse().unwrap();
    let steps = (steps + 5).to_string();
    let (_, command) = message.split_once("resume with: ").unwrap();
    assert!(command.contains("--steps 100000000 "), "{command}");
    let resumed = typed(&command.replace("--steps 100000000", &format!("--steps {steps}")));
    assert!(resumed.status.success(), "{command}: {}", String::from_utf8_lossy(&resumed.stderr));
    lazygrid(args(&whole, &steps)).succeeds();
    assert_eq!(files(&out), files(&whole));
}

#[test]
fn printed_command_resumes_replicas_and_sweeps_with_their_options() {
    for more in [&["--replicas", "3"][..], &["--sweep", "species.acid.diffusion=1,5"]] {
        let scratch = Scratch::new();
        let (scenario, out) = (scratch.write("s.toml", SCENARIO), scratch.path("my out"));
        let args = ["simulate", &scenario, "--output", &out, "--seed", "7", "--steps", "100000000"];
        let rare = ["--series-every", "1000000", "--frames-every", "100000000", "--no-space-check"];
        let ended = begun(&[&args[..], &rare, more].concat(), &out).end("-INT");
        let message = String::from_utf8(ended.stderr).unwrap();
        let (_, command) = message.split_once("resume with: ").unwrap();
        let options = ["--seed 7 ", "--steps 100000000 ", "--series-every 1000000 ", "my out' "];
        assert!(options.iter().all(|option| command.contains(option)), "{command}");
        assert!(command.contains(&more.join(" ")), "{command}");
    }
}

#[test]
fn closed_standard_output_does_not_hide_the_signal() {
    for more in [&[][..], &["--replicas", "2"], &["--sweep", "species.acid.diffusion=1,5"]] {
        let scratch = Scratch::new();
        let (scenario, out) = (scratch.write("s.toml", SCENARIO), scratch.path("out"));
        let args =
            ["simulate", &scenario, "--output", &out, "--steps", "100000000", "--series-every", "1000000"];
        let args = [&args[..], &["--frames-every", "100000000", "--no-space-check"], more].concat();
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let ended = begun_with(writer.into(), &args, &out).end("-TERM");
        let message = String::from_utf8(ended.stderr).unwrap();
        assert_eq!(ended.status.code(), Some(143), "{more:?}: {message}");
        assert!(message.starts_with("error: stopped "), "{more:?}: {message}");
    }
}

#[test]
fn two_runs_do_not_write_to_one_directory() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let out = scratch.path("out");
    let running = endless(&scenario, &out);
    for more in [&["--overwrite"][..], &["--resume"], &[]] {
        let run = lazygrid(["simulate", &scenario, "--output", &out].iter().chain(more)).fails();
        assert!(run.err.contains("another run is writing to it"), "{more:?}: {}", run.err);
    }
    // The system's lock ends with the process.
    running.end("-KILL");
    lazygrid(["simulate", &scenario, "--output", &out, "--steps", "5", "--overwrite"]).succeeds();
}

/// Until the burst, particles rest or arrive where a GPU does not round: all files are those of the CPU. Then particles
/// have 17 mirrors in reach, of which a GPU allows 16.
const MANY_MIRRORS: &str = r#"
time-step = 0.0078125
steps = 50
[[species]]
name = "still"
[[species]]
name = "product"
[[species]]
name = "walker"
diffusion = 2
[[decay]]
equation = "still -> product"
rate = 4
[[transmitter]]
name = "tx"
release = [{ species = "still", count = 300 }]
[[transmitter]]
name = "late"
center = [5, 0.53, 0]
times = [BURST]
release = [{ species = "walker", count = 40 }]
[[receiver]]
name = "sink"
radius = 1
center = [0, 0, 0]
kind = "endpoint"
species = ["product"]
[[receiver]]
name = "mirror"
radius = 0.5
center = [5, 0, 0]
lattice = { size = [0.17, 1, 1], places = [17, 1, 1] }
kind = "reflecting"
species = ["walker"]
[output]
every = 14
frames = ["xyz"]
arrivals = true
"#;

#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
fn state(directory: &str) -> State {
    let path = Path::new(directory).join("checkpoint");
    let mut state = Checkpoint::read(&path).unwrap().into_state(&path).unwrap();
    state.particles = state.particles.permuted(&state.particles.by_id());
    state
}

/// Step 28 has a row of the series and a frame, step 30 has none.
#[test]
fn run_that_exceeds_a_limit_of_the_gpu_resumes_on_the_cpu() {
    if !has_gpu() {
        return;
    }
    for step in [28, 30] {
        let scratch = Scratch::new();
        let time = (f64::from(step) * 0.0078125).to_string();
        let scenario = scratch.write("s.toml", &MANY_MIRRORS.replace("BURST", &time));
        let [whole, resumed] = ["whole", "parts"].map(|name| scratch.path(name));
        let simulate =
            |out: &str, more: &[&str]| lazygrid(["simulate", &scenario, "--output", out].iter().chain(more));
        let failed = simulate(&resumed, &["--backend", "gpu"]).fails().err;
        assert!(failed.contains(&format!("step {step}: the number of surfaces within reach")), "{failed}");
        let remedy = format!("; --resume --backend cpu continues from the checkpoint of step {step}\n");
        assert!(failed.ends_with(&remedy), "{failed}");
        assert_eq!(state(&resumed).step, step);
        simulate(&resumed, &["--resume", "--backend", "cpu"]).succeeds();
        simulate(&whole, &[]).succeeds();
        for name in ["series.csv", "arrivals.csv", "releases.csv", "frames.xyz"] {
            let [found, expected] =
                [&resumed, &whole].map(|out| fs::read_to_string(format!("{out}/{name}")).unwrap());
            assert!(found == expected, "{name} after step {step}:\n{found}\nand not\n{expected}");
        }
        assert_eq!(state(&resumed), state(&whole));
        assert!(state(&resumed).totals.arrived[0][1] > 100);
    }
}
