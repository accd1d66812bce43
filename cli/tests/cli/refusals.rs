use std::fs;
use std::process::{Command, Stdio};
use std::time::Duration;

use lazygrid_tests::command::{Program, Run, Scratch};

use crate::{LAZYGRID, SPHERES};

pub(crate) fn scenario(transmitter: &str) -> String {
    format!(
        "steps = 2\ntime-step = 1e-3\n[[species]]\nname = \"A\"\ndiffusion = 1.0\n[[transmitter]]\nname = \"tx\"\n\
         center = [0.0, 0.0, 0.0]\nrelease = [{{ species = \"A\", count = 5 }}]\n{transmitter}\n"
    )
}

/// Runs a script, in which `$0` is the command.
fn in_shell(script: &str, args: &[&str]) -> Run {
    Program("sh").run([&["-c", script, env!("CARGO_BIN_EXE_lazygrid")], args].concat())
}

/// Ends the command by a signal after a minute of processor time, which does not depend on other processes.
fn at_once(args: &[&str]) -> Run {
    in_shell("ulimit -t 60; exec \"$0\" \"$@\"", args)
}

#[test]
fn closed_standard_output_is_an_error() {
    let scratch = Scratch::new();
    let file = scratch.write("spheres.csv", SPHERES);
    for arguments in ["-o -", "--json"] {
        let script = format!("exec \"$0\" detect \"$1\" --backend cpu {arguments} >&-");
        let said = in_shell(&script, &[&file]).fails().err;
        assert!(said.contains("closed"), "{arguments}: {said}");
    }
    let null = fs::OpenOptions::new().read(true).write(true).open("/dev/null").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_lazygrid"));
    let command = command.args(["detect", &file, "--backend", "cpu", "-o", "-"]).stderr(Stdio::null());
    assert_eq!(command.stdout(null).status().unwrap().code(), Some(0));
}

#[test]
fn message_of_too_many_bits_is_refused_at_once() {
    let scratch = Scratch::new();
    let many = format!("bits = \"{}\"\nsymbol-time = 1e-3", "10".repeat(3_000_000));
    for (message, count) in
        [("random-bits = 4294967295\nsymbol-time = 1e-3".to_owned(), "4294967295"), (many, "6000000")]
    {
        let file = scratch.write("message.toml", &scenario(&message));
        let said = at_once(&["simulate", &file, "--output", &scratch.path("run")]).fails().err;
        assert!(
            said.contains(&format!("{count} bits are more than the limit of 4194304; send fewer")),
            "{said}"
        );
        assert!(said.len() < 1000, "{said}");
    }
    let other = |k: usize| {
        format!(
            "[[transmitter]]\nname = \"t{k}\"\nrandom-bits = 4000000\nsymbol-time = 1e-3\nrelease = [{{ species = \"A\", count = 5 }}]\n"
        )
    };
    let file = scratch.write("message.toml", &scenario(&(0..100).map(other).collect::<String>()));
    let said = LAZYGRID.run(["simulate", &file, "--output", &scratch.path("run")]).fails().err;
    assert!(
        said.contains("up to 't1' send 8000000 symbols, more than the limit of 4194304; send fewer"),
        "{said}"
    );
    let file = scratch.write("message.toml", &scenario("random-bits = 1000\nsymbol-time = 1e-3"));
    LAZYGRID.run(["simulate", &file, "--output", &scratch.path("run")]).succeeds();
}

#[test]
fn long_arguments_are_quoted_in_part() {
    let long = "é".repeat(10_000);
    for arguments in [
        vec!["detect", "a.csv", "--algorithm", &long],
        vec!["detect", "a.csv", "--backend", &long],
        vec!["detect", "a.csv", "--radius", &long],
        vec!["detect", "a.csv", &format!("--radius=A={long}")],
        vec!["detect", "a.csv", "--periodic", &format!("1,1,{long}")],
        vec!["detect", "a.csv", &format!("-o{long}")],
        vec!["detect", "a.csv", &format!("--{long}")],
        vec![&long],
    ] {
        let run = LAZYGRID.run(arguments);
        assert_eq!(run.code, Some(2), "{}", run.err);
        assert!(run.err.contains("éé…") && run.err.len() < 1000, "{}", run.err);
    }
    let length = format!("1,1,0.{}1", "0".repeat(10_000));
    let run = LAZYGRID.run(["detect", "a.csv", "--periodic", &length]);
    assert!(run.code == Some(2) && run.err.len() < 1000, "{}", run.err);
}

#[test]
fn long_paths_and_names_are_quoted_in_part() {
    let scratch = Scratch::new();
    let (long, path) = ("n".repeat(10_000), "folder/".repeat(10_000));
    let spheres = scratch.write("a.csv", &format!("species,x,y,z,r\n{long},0,0,0,1\n"));
    let named = scratch.write("named.csv", &format!("species,x,y,z\n{long},0,0,0\n"));
    let digits = scratch.write("digits.csv", &format!("x,y,z,r\n0.{}7,0,0,1\n", "123".repeat(10_000)));
    let file = scratch.write("a.toml", &scenario(""));
    let run = scratch.path("run");
    LAZYGRID.run(["simulate", &file, "--output", &run]).succeeds();
    let radius = format!("{long}=1");
    let swept = format!("transmitter.tx.release.0.species=A,{long}");
    for (arguments, code) in [
        (vec!["detect", &path], 1),
        (vec!["detect", &spheres, "-o", &(path.clone() + "a.csv")], 1),
        (vec!["detect", &named, "--radius", "A=1"], 1),
        (vec!["detect", &named, "--radius", &("m".to_owned() + &radius), "--radius", &radius], 0),
        (vec!["detect", &spheres, "--radius", &radius, "--radius", &(radius.clone() + "0")], 2),
        (vec!["detect", &digits, "--precision", "f32"], 0),
        (vec!["simulate", &path], 1),
        (vec!["simulate", &file, "--output", &path], 1),
        (vec!["simulate", &file, "--output", &scratch.path("swept"), "--sweep", &swept], 1),
    ] {
        let run = LAZYGRID.run(&arguments);
        assert_eq!(run.code, Some(code), "{}", run.err);
        assert!(run.err.contains('…') || code == 0, "{}", run.err);
        assert!(run.err.len() < 2000, "{} bytes: {}", run.err.len(), run.err);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn help_that_cannot_be_printed_is_an_error() {
    for option in ["--help", "--version"] {
        for (to, reason) in [(">/dev/full", "No space left"), (">&-", "closed")] {
            let said = in_shell(&format!("exec \"$0\" {option} {to}"), &[]).fails().err;
            assert!(
                said.starts_with("error: cannot write to standard output: ") && said.contains(reason),
                "{said}"
            );
        }
        let run = LAZYGRID.run_with_closed_output([option]);
        assert_eq!((run.code, run.err.as_str()), (Some(0), ""));
    }
}

#[cfg(unix)]
#[test]
fn pairs_are_written_into_a_pipe_with_a_name() {
    let scratch = Scratch::new();
    let (file, pipe) = (scratch.write("spheres.csv", SPHERES), scratch.path("pairs.csv"));
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let reader = Command::new("cat").arg(&pipe).stdout(Stdio::piped()).spawn().unwrap();
    LAZYGRID.run(["detect", &file, "--backend", "cpu", "-o", &pipe]).succeeds();
    let read = reader.wait_with_output().unwrap().stdout;
    let expected =
        LAZYGRID.run(["detect", &file, "--backend", "cpu", "-o", "-", "--format", "csv"]).succeeds();
    assert_eq!(String::from_utf8_lossy(&read), expected.out);
}

#[cfg(unix)]
#[test]
fn spheres_are_read_from_a_pipe_with_a_name() {
    let scratch = Scratch::new();
    let (file, pipe) = (scratch.write("spheres.csv", SPHERES), scratch.path("pipe.csv"));
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let pairs = scratch.path("pairs.csv");
    let detect = |input: &str, more: &[&str]| {
        let args = ["detect", input, "--backend", "cpu", "-o", &pairs];
        LAZYGRID.run(args.iter().chain(more)).succeeds();
        std::fs::read_to_string(&pairs).unwrap()
    };
    let expected = detect(&file, &[]);
    let mut writer = Command::new("cp").args([&file, &pipe]).spawn().unwrap();
    assert_eq!(detect(&pipe, &[]), expected);
    assert!(writer.wait().unwrap().success());
    let excluded = scratch.write("excluded.csv", "0 1\n");
    let expected = detect(&file, &["--exclude", &excluded]);
    let mut writer = Command::new("cp").args([&excluded, &pipe]).spawn().unwrap();
    assert_eq!(detect(&file, &["--exclude", &pipe]), expected);
    assert!(writer.wait().unwrap().success());
}

/// The requested stack is larger than any system grants.
#[cfg(unix)]
#[test]
fn refused_thread_for_signals_is_an_error() {
    let scratch = Scratch::new();
    let (file, run) = (scratch.write("a.toml", &scenario("")), scratch.path("run"));
    let made = scratch.path("made.csv");
    let commands: [(&[&str], &str); 2] = [
        (&["generate", "equal", "-n", "10", "-o", &made], &made),
        (&["simulate", &file, "--threads", "1", "--output", &run], &run),
    ];
    for (command, output_path) in commands {
        let mut command_line = Command::new(env!("CARGO_BIN_EXE_lazygrid"));
        let output = command_line.args(command).env("RUST_MIN_STACK", (1_u64 << 46).to_string()).output();
        let output = output.unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{command:?}: {said}");
        assert!(said.contains("cannot start the thread that listens for Ctrl-C"), "{command:?}: {said}");
        assert!(!fs::exists(output_path).unwrap(), "{command:?}");
        LAZYGRID.run(command.iter()).succeeds();
    }
}

#[test]
fn incomplete_files_of_a_killed_run_are_removed_by_the_next_one() {
    let scratch = Scratch::new();
    let file = scratch.write("a.toml", &scenario(""));
    let run = scratch.path("run");
    LAZYGRID.run(["simulate", &file, "--output", &run]).succeeds();
    let left = scratch.write("run/.lazygrid-draft-aB3xY9", "half a checkpoint");
    let foreign = scratch.write("run/.draft-thesis", "mine");
    LAZYGRID.run(["simulate", &file, "--output", &run, "--resume", "--steps", "3"]).succeeds();
    assert!(!fs::exists(left).unwrap() && fs::exists(foreign).unwrap());
}

#[test]
fn resumed_sweep_looks_only_at_replicas_that_exist() {
    let scratch = Scratch::new();
    let (file, run) = (scratch.write("a.toml", &scenario("")), scratch.path("run"));
    let args = ["simulate", &file, "--output", &run, "--sweep", "time-step=1e-3,2e-3"];
    LAZYGRID.run(args).succeeds();
    let said = at_once(&[&args[..], &["--replicas", "4294967295", "--resume"]].concat()).fails().err;
    assert!(said.contains("the disk has"), "{said}");
}

/// A run that ignored the signal would take hours. After 20 s of processor time another signal ends it.
#[test]
fn billions_of_replicas_take_no_memory_and_obey_sigterm() {
    let scratch = Scratch::new();
    let file = scratch.write("a.toml", &scenario(""));
    let run = scratch.path("run");
    let script = "ulimit -v 1000000; ulimit -t 20; exec \"$0\" simulate \"$1\" --output \"$2\" --replicas 4294967295 --threads 2 \
                  --no-space-check";
    let args = ["-c", script, env!("CARGO_BIN_EXE_lazygrid"), &file, &run];
    let begun = Program("sh").start(args, Stdio::null(), Stdio::null());
    let begun = begun.wait_until(|| fs::exists(run.clone() + "/.lock").unwrap());
    // Time to run out of memory.
    std::thread::sleep(Duration::from_secs(2));
    let output = begun.end("-TERM");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(143), "{said}");
    assert!(said.contains("stopped with 0 of 4294967295 replicas done"), "{said}");
}

#[test]
fn algorithm_of_the_cpu_is_refused_by_a_run_on_the_gpu() {
    let scratch = Scratch::new();
    let (file, out) = (scratch.write("s.toml", &scenario("")), scratch.path("out"));
    let args = ["simulate", &file, "-o", &out, "--backend", "gpu", "--algorithm", "hash-grid"];
    let run = LAZYGRID.run(args);
    assert!(run.code == Some(2) && run.err.contains("hash-grid searches on the CPU"), "{}", run.err);
}
