use std::fs;

#[cfg(unix)]
use super::interruptions::{LONG, begun};
use super::{SCENARIO, files, lazygrid, rows};
use lazygrid_tests::command::Scratch;

#[test]
fn replicas_are_runs_by_themselves_and_threads_change_no_byte() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let replicas = |threads: &str| {
        let out = scratch.path(threads);
        let args = ["simulate", &scenario, "--output", &out, "--replicas", "5", "--threads", threads];
        lazygrid(args).succeeds();
        out
    };
    let one = replicas("1");
    let all = files(&one);
    for threads in ["2", "3", "7"] {
        assert_eq!(files(&replicas(threads)), all, "{threads} threads");
    }
    let seeds = rows(&(one.clone() + "/replicas.csv"));
    assert_eq!(seeds.len(), 5);
    for (k, row) in seeds.iter().enumerate() {
        assert_eq!(row["replica"], k.to_string());
        let alone = scratch.path("alone");
        lazygrid(["simulate", &scenario, "--output", &alone, "--seed", &row["seed"], "--overwrite"])
            .succeeds();
        assert_eq!(files(&alone), files(&format!("{one}/replica-000{k}")), "replica {k}");
    }
    assert!(!all.iter().any(|(name, _)| name.contains("replica-0005")));
}

#[test]
fn mean_matches_the_replicas() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("s.toml", SCENARIO), scratch.path("out"));
    let run = lazygrid(["simulate", &scenario, "--output", &out, "--replicas", "4"]).succeeds();
    assert!(
        run.out
            .starts_with("replicas   4 of 4 done\nseed       5\nsteps      39 (0.039 s)\nmean       acid: "),
        "{}",
        run.out
    );
    let series: Vec<_> = (0..4).map(|k| rows(&format!("{out}/replica-000{k}/series.csv"))).collect();
    let mean = rows(&(out + "/mean.csv"));
    assert_eq!(mean.len(), series[0].len());
    let mut spread = 0.0;
    for (at, row) in mean.iter().enumerate() {
        assert_eq!(
            (&row["step"], &row["time"], &row["replicas"][..]),
            (&series[0][at]["step"], &series[0][at]["time"], "4")
        );
        for name in [
            "acid",
            "base",
            "salt",
            "acid + base -> salt",
            "salt -> acid",
            "rx:acid",
            "rx:base",
            "pairs",
            "contacts",
        ] {
            let values: Vec<f64> = series.iter().map(|rows| rows[at][name].parse().unwrap()).collect();
            let average = values.iter().sum::<f64>() / 4.0;
            let squares: f64 = values.iter().map(|v| (v - average).powi(2)).sum();
            let error = (squares / 3.0 / 4.0).sqrt();
            let read = |what: &str| row[&format!("{name} {what}")].parse::<f64>().unwrap();
            assert!(
                (read("mean") - average).abs() < 1e-9 && (read("error") - error).abs() < 1e-9,
                "{name} of {row:?}"
            );
            spread += error;
        }
    }
    assert!(spread > 0.0, "replicas do not differ");
}

#[test]
fn replicas_are_resumed_replaced_and_refused() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let [out, whole] = ["out", "whole"].map(|name| scratch.path(name));
    let simulate =
        |out: &str, more: &[&str]| lazygrid(["simulate", &scenario, "--output", out].iter().chain(more));
    assert!(
        simulate(&out, &["--replicas", "2", "--resume"]).fails().err.contains("replicas.csv: cannot read")
    );
    simulate(&whole, &["--replicas", "4"]).succeeds();
    simulate(&out, &["--replicas", "2", "--steps", "17"]).succeeds();
    fs::remove_dir_all(out.clone() + "/replica-0001").unwrap();
    let series = out.clone() + "/replica-0000/series.csv";
    fs::write(&series, fs::read_to_string(&series).unwrap() + "18,half a li").unwrap();
    let before = files(&out);
    for (more, message) in [
        (&["--replicas", "2"][..], "holds a run already"),
        (&[], "holds a run already"),
        (&["--replicas", "1", "--resume"], "there are 2 replicas; give as many or more"),
        (&["--replicas", "2", "--resume", "--seed", "6"], "give the --seed that they were begun with"),
        (&["--resume"], "checkpoint: cannot read"),
    ] {
        let run = simulate(&out, more).fails();
        assert!(run.err.contains(message), "{more:?}: {}", run.err);
    }
    assert_eq!(files(&out), before);
    let table = out.clone() + "/replicas.csv";
    let seeds = fs::read_to_string(&table).unwrap();
    for damaged in ["", &seeds[..seeds.len() - 4], &seeds.replacen("0,", "4,", 1)] {
        fs::write(&table, damaged).unwrap();
        let run = simulate(&out, &["--replicas", "2", "--resume"]).fails();
        assert!(run.err.contains("replicas.csv: ") && run.err.contains("it is damaged"), "{}", run.err);
    }
    fs::write(&table, &seeds).unwrap();
    let run = simulate(&out, &["--replicas", "2", "--resume", "--steps", "5"]).fails();
    assert!(run.err.contains("replica 0: ") && run.err.contains("17 steps are done"), "{}", run.err);
    simulate(&out, &["--replicas", "4", "--resume"]).succeeds();
    assert_eq!(files(&out), files(&whole));
    simulate(&out, &["--replicas", "4", "--overwrite", "--seed", "6"]).succeeds();
    assert_ne!(files(&out), files(&whole));
    simulate(&out, &["--overwrite"]).succeeds();
    assert!(!std::path::Path::new(&(out.clone() + "/replicas.csv")).exists());
    simulate(&out, &["--resume"]).succeeds();
}

#[test]
#[cfg(unix)]
fn interrupted_replicas_leave_the_finished_ones() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let [out, whole] = ["out", "whole"].map(|name| scratch.path(name));
    let args = |out| [&["simulate", &scenario, "--output", out, "--replicas", "32"][..], &LONG].concat();
    let ended = begun(&args(&out), &(out.clone() + "/replica-0004/checkpoint")).end("-INT");
    let message = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(130), "{message}");
    assert!(
        message.contains("of 32 replicas done; resume with: ") && message.contains("--replicas 32 --resume"),
        "{message}"
    );
    let done: u64 = message.split_whitespace().nth(3).unwrap().parse().unwrap();
    assert!((1..32).contains(&done), "{message}");
    assert!(rows(&(out.clone() + "/mean.csv")).iter().all(|row| row["replicas"] == done.to_string()));
    assert!(!fs::exists(out.clone() + "/replica-0031").unwrap());
    lazygrid(args(&out).into_iter().chain(["--resume"])).succeeds();
    lazygrid(args(&whole)).succeeds();
    assert_eq!(files(&out), files(&whole));
}

#[test]
fn overwritten_replicas_are_resumed_with_more() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let [out, whole] = ["out", "whole"].map(|name| scratch.path(name));
    let simulate = |out: &str, more: &[&str]| {
        lazygrid(["simulate", &scenario, "--output", out].iter().chain(more)).succeeds()
    };
    simulate(&out, &["--replicas", "3"]);
    simulate(&out, &["--replicas", "2", "--seed", "6", "--overwrite"]);
    simulate(&out, &["--replicas", "3", "--seed", "6", "--resume"]);
    simulate(&whole, &["--replicas", "3", "--seed", "6"]);
    assert_eq!(files(&out), files(&whole));
}

#[test]
fn replica_without_a_checkpoint_begins_again() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let [out, whole] = ["out", "whole"].map(|name| scratch.path(name));
    let simulate = |out: &str, more: &[&str]| {
        lazygrid(["simulate", &scenario, "--output", out, "--replicas", "2"].iter().chain(more)).succeeds()
    };
    simulate(&out, &[]);
    simulate(&whole, &[]);
    fs::remove_file(out.clone() + "/replica-0001/checkpoint").unwrap();
    simulate(&out, &["--resume"]);
    assert_eq!(files(&out), files(&whole));
}
