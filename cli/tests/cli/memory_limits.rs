//! A command under a memory limit never ends by a signal. `LAZYGRID_TEST_FULL=1` tries more limits.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::os::unix::process::ExitStatusExt;
use std::process::Command;

use lazygrid_tests::command::{Scratch, npy_bytes};
use lazygrid_tests::skip;

use crate::LAZYGRID;

const BURST: &str = "steps = 3
time-step = 1e-3
[[species]]
name = \"A\"
diffusion = 1.0
[[species]]
name = \"B\"
diffusion = 1.0
[[reaction]]
equation = \"A + B -> A\"
binding-radius = 0.001
[[transmitter]]
name = \"tx\"
center = [0.0, 0.0, 0.0]
shape = { kind = \"gaussian\", width = 40.0 }
release = [{ species = \"A\", count = COUNT }, { species = \"B\", count = COUNT }]
";

/// Less than each refused request needs, on a machine with any amount of memory.
const MANY_MEBIBYTES: u64 = 16 << 10;

fn limited(mebibytes: u64, args: &[&str]) -> (i32, String) {
    limited_with(mebibytes, &[], args)
}

fn limited_with(mebibytes: u64, variables: &[(&str, &str)], args: &[&str]) -> (i32, String) {
    let script = format!("ulimit -v {} && exec \"$0\" \"$@\"", mebibytes << 10);
    let mut command = Command::new("sh");
    let command = command.args(["-c", &script, env!("CARGO_BIN_EXE_lazygrid")]).args(args);
    // Arenas of threads would take address space at random.
    let command = command.env("MALLOC_ARENA_MAX", "1").env("RUST_BACKTRACE", "0");
    let output = command.envs(variables.iter().copied()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let code = output.status.code();
    let code = code
        .unwrap_or_else(|| panic!("{mebibytes} MiB, {args:?}: signal {:?}: {said}", output.status.signal()));
    assert!(code == 0 || code == 1, "{mebibytes} MiB, {args:?}: code {code}: {said}");
    assert!(!said.contains("panicked"), "{mebibytes} MiB, {args:?}: {said}");
    (code, said)
}

fn limits(most: f64) -> Vec<u64> {
    const MIN_MEBIBYTES: f64 = 56.0;
    let count = if std::env::var_os("LAZYGRID_TEST_FULL").is_some() { 35 } else { 4 };
    (0..=count)
        .map(|k| (MIN_MEBIBYTES * (most / MIN_MEBIBYTES).powf(f64::from(k) / f64::from(count))) as u64)
        .collect()
}

#[test]
fn commands_under_any_memory_limit_end_without_a_signal() {
    let scratch = Scratch::new();
    let spheres = scratch.path("spheres.npy");
    LAZYGRID.run(["generate", "five-sizes", "-n", "500000", "-o", &spheres]).succeeds();
    let text = scratch.path("spheres.csv");
    LAZYGRID.run(["generate", "five-sizes", "-n", "500000", "-o", &text]).succeeds();
    let pairs = scratch.path("pairs.csv");
    let named = |k: u32| format!("{k},species-{k},{k},0,0,0.1\n");
    let named: String = (0..250_000).rev().map(named).collect();
    let named = scratch.write("named.csv", &format!("id,species,x,y,z,r\n{named}"));
    let bonds: String = (0..400_000).map(|k| format!("{k},{}\n", k + 1)).collect();
    let bonds = scratch.write("bonds.csv", &bonds);
    let burst = scratch.write("burst.toml", &BURST.replace("COUNT", "150000"));
    let run = scratch.path("run");
    let replicas = scratch.path("replicas");
    let [shown, swept, resumed] = ["shown", "swept", "resumed"].map(|name| scratch.path(name));
    LAZYGRID.run(["simulate", &burst, "--steps", "1", "--output", &resumed]).succeeds();
    let commands: [&[&str]; 13] = [
        &["check", "--quick", "--backend", "cpu"],
        &["detect", &spheres, "--backend", "cpu", "--threads", "2"],
        &["detect", &text, "--backend", "cpu", "--threads", "2", "-o", &pairs],
        &["detect", &spheres, "--backend", "cpu", "--threads", "2", "--neighbors"],
        &["detect", &spheres, "--backend", "cpu", "--threads", "2", "--precision", "f64"],
        &["detect", &named, "--backend", "cpu", "--threads", "2", "--ids", "--exclude", &bonds, "-o", &pairs],
        &["generate", "equal", "-n", "4000000", "-o", &scratch.path("made.npy")],
        &["page", "-o", &scratch.path("page.html")],
        &["simulate", &burst, "--threads", "2", "--overwrite", "--output", &run],
        &["simulate", &burst, "--threads", "2", "--overwrite", "--output", &replicas, "--replicas", "2"],
        &["simulate", &burst, "--threads", "2", "--overwrite", "--output", &shown, "--animate", "--report"],
        &[
            "simulate",
            &burst,
            "--threads",
            "2",
            "--overwrite",
            "--output",
            &swept,
            "--sweep",
            "time-step=1e-3,2e-3",
        ],
        &["simulate", &burst, "--threads", "2", "--output", &resumed, "--resume"],
    ];
    for command in commands {
        let codes: Vec<i32> = limits(1000.0).into_iter().map(|limit| limited(limit, command).0).collect();
        assert!(codes.contains(&1), "{command:?}: no limit was too low: {codes:?}");
        assert_eq!(codes.last(), Some(&0), "{command:?}: {codes:?}");
    }
}

/// The checkpoint has 20 MB. The means of 1.2 million counts take 58 MB.
#[test]
fn checkpoints_and_series_that_do_not_fit_are_refused() {
    let scratch = Scratch::new();
    let many_spheres = scratch.write("crowd.toml", &BURST.replace("COUNT", "500000"));
    let species: String = (0..4000).map(|k| format!("[[species]]\nname = \"S{k}\"\n")).collect();
    let wide = scratch.write("wide.toml", &format!("time-step = 1e-3\nsteps = 300\n{species}"));
    let [crowded, means] = ["crowded", "means"].map(|name| scratch.path(name));
    let resume_many = ["simulate", &many_spheres, "--output", &crowded, "--threads", "1", "--steps", "0"];
    let replicas = ["simulate", &wide, "--output", &means, "--threads", "1", "--replicas", "2"];
    for (command, refused) in [(&resume_many, "contents of the checkpoint"), (&replicas, "counts need")] {
        LAZYGRID.run(command).succeeds();
        let command = [&command[..], &["--resume"]].concat();
        let all: Vec<_> = (60..200).step_by(12).map(|limit| limited(limit, &command)).collect();
        assert!(all.iter().any(|(_, said)| said.contains(refused)), "{command:?}: {all:?}");
        assert_eq!(all.last().unwrap().0, 0, "{command:?}");
    }
}

#[test]
fn announced_memory_counts_the_copy_of_f64_spheres() {
    const SPHERES: u64 = 500_000;
    let scratch = Scratch::new();
    let [narrow, wide] = ["narrow.npy", "wide.npy"].map(|name| scratch.path(name));
    LAZYGRID.run(["generate", "equal", "-n", &SPHERES.to_string(), "-o", &narrow]).succeeds();
    let numbers = 0.5_f64.to_le_bytes().repeat(4 * SPHERES as usize);
    std::fs::write(&wide, npy_bytes("'<f8'", &format!("({SPHERES}, 4)"), &numbers)).unwrap();
    let needed = |file: &str, options: &[&str]| {
        let (_, said) =
            limited(62, &[&["detect", file, "--backend", "cpu", "--threads", "1"], options].concat());
        let (_, rest) = said.split_once("spheres need about ").unwrap_or_else(|| panic!("{said}"));
        assert_eq!(rest.contains("--precision f32"), file == wide, "{said}");
        rest.split(' ').next().unwrap().parse::<u64>().unwrap()
    };
    assert_eq!(needed(&wide, &[]), needed(&narrow, &[]) + 18 * SPHERES);
    let periodic = ["--periodic", "99,99,99"];
    assert_eq!(needed(&wide, &periodic), needed(&narrow, &periodic));
}

/// A software driver ends the process if memory is refused.
#[test]
fn commands_on_a_gpu_under_any_memory_limit_end_without_a_signal() {
    let adapters = lazygrid::gpu::adapters();
    if adapters.is_empty() || adapters.iter().any(|adapter| adapter.is_hardware) {
        let why = format!("memory limits with a software driver alone, as the adapters are {adapters:?}");
        return skip(None, &why);
    }
    let scratch = Scratch::new();
    let cache = scratch.path("cache");
    let is_full = std::env::var_os("LAZYGRID_TEST_FULL").is_some();
    let check: &[&str] = if is_full { &["--quick"] } else { &["--seed", "7"] };
    let check = [&["check", "--backend", "gpu"], check].concat();
    let spheres = scratch.path("spheres.npy");
    LAZYGRID.run(["generate", "five-sizes", "-n", "20000", "-o", &spheres]).succeeds();
    let burst = scratch.write("burst.toml", &BURST.replace("COUNT", "1000"));
    let run = scratch.path("run");
    let commands = [
        &["calibrate"][..],
        &check,
        &["detect", &spheres, "--backend", "gpu"],
        &["simulate", &burst, "--backend", "gpu", "--overwrite", "--output", &run],
    ];
    for command in commands {
        // llvmpipe faults between these, in searches between 370 and 385.
        let below = (350..=700).step_by(if is_full { 5 } else { 25 });
        let all = limits(300.0).into_iter().chain(below).chain([2000]);
        let variables = [("XDG_CACHE_HOME", &*cache)];
        let codes: Vec<i32> = all.map(|limit| limited_with(limit, &variables, command).0).collect();
        assert!(codes.contains(&1), "{command:?}: no limit was too low: {codes:?}");
        assert_eq!(codes.last(), Some(&0), "{command:?}: {codes:?}");
    }
}

#[test]
fn run_that_cannot_fit_is_refused_before_it_begins() {
    let scratch = Scratch::new();
    let burst = scratch.write("burst.toml", &BURST.replace("COUNT", "2100000000"));
    for replicas in [&[][..], &["--replicas", "2"]] {
        let run = scratch.path("run");
        let args = ["simulate", &burst, "--output", &run].into_iter().chain(replicas.iter().copied());
        let (code, said) = limited(MANY_MEBIBYTES, &args.collect::<Vec<_>>());
        let is_refused = said.contains("bytes of memory or more") && said.contains("available");
        assert!(code == 1 && is_refused, "{code}: {said}");
    }
    let made = scratch.path("made.npy");
    let (code, said) = limited(MANY_MEBIBYTES, &["generate", "equal", "-n", "4294967294", "-o", &made]);
    assert!(code == 1 && said.contains("4294967294 spheres need 68786585568 bytes"), "{code}: {said}");
    assert!(!std::fs::exists(made).unwrap());
}

#[test]
fn sweep_that_cannot_fit_is_refused_before_it_begins() {
    let scratch = Scratch::new();
    let [scenario, out] = [scratch.write("s.toml", &BURST.replace("COUNT", "10")), scratch.path("out")];
    let sweep = "transmitter.tx.release.0.count=10,4000000000";
    let (code, said) = limited(MANY_MEBIBYTES, &["simulate", &scenario, "--output", &out, "--sweep", sweep]);
    let is_refused = said.contains("count = 4000000000: ") && said.contains("bytes of memory or more");
    assert!(code == 1 && is_refused, "{code}: {said}");
    assert!(!std::fs::exists(out + "/points.csv").unwrap());
}

#[test]
fn many_species_are_read_in_linear_time_or_refused() {
    use std::fmt::Write as _;
    let scratch = Scratch::new();
    let mut text = "steps = 1\ntime-step = 1e-3\ncontact = \"ignore\"\n".to_owned();
    for k in 0..100_000 {
        write!(text, "[[species]]\nname = \"S{k}\"\ndiffusion = 1.0\n").unwrap();
    }
    text += "[[transmitter]]\nname = \"tx\"\ncenter = [0.0, 0.0, 0.0]\nrelease = [{ species = \"S0\", count = 10 }]\n";
    let scenario = scratch.write("species.toml", &text);
    let run = scratch.path("run");
    let simulate = ["simulate", &scenario, "--threads", "2", "--output", &run];
    let (code, said) = limited(195, &simulate);
    assert!(code == 1 && said.contains("bytes of scenario need"), "{code}: {said}");
    let (code, said) = limited(2048, &simulate);
    assert_eq!(code, 0, "{said}");
}

#[test]
fn more_receivers_than_fit_are_refused() {
    let scratch = Scratch::new();
    let lattice = "[[receiver]]\nname = \"rx\"\nkind = \"transparent\"\ncenter = [0.0, 0.0, 0.0]\nradius = 0.1\n\
                   lattice = { size = [1.0, 1.0, 1.0], places = [1000, 1000, 1000] }\n";
    let scenario = scratch.write("lattice.toml", &(BURST.replace("COUNT", "10") + lattice));
    let (code, said) = limited(1024, &["simulate", &scenario, "--output", &scratch.path("run")]);
    assert!(code == 1 && said.contains("1000000000 receivers need"), "{code}: {said}");
}
