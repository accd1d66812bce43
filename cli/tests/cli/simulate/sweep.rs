use std::fs;

#[cfg(unix)]
use super::interruptions::{LONG, begun};
use super::{SCENARIO, files, lazygrid, rows};
use lazygrid_tests::command::Scratch;

const BURST: &str = r#"
time-step = 0.002
steps = 200
seed = 3
[[species]]
name = "A"
diffusion = 100
[[transmitter]]
name = "tx"
release = [{ species = "A", count = 2000 }]
[[receiver]]
name = "rx"
center = [10, 0, 0]
radius = 2
kind = "absorbing"
[output]
every = 200
[sweep]
receiver.rx.center.x = [4, 8]
species.A.diffusion = [50, 100]
"#;

#[test]
fn sweep_gives_the_closed_form_at_each_point() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("s.toml", BURST), scratch.path("out"));
    let args = ["simulate", &scenario, "--output", &out, "--replicas", "3", "--report"];
    let run = lazygrid(args).succeeds();
    assert!(run.out.starts_with("sweep      4 points, 12 runs done\n"), "{}", run.out);
    let table = rows(&(out.clone() + "/sweep.csv"));
    assert_eq!(table.len(), 4);
    for row in &table {
        let number = |name: &str| row[name].parse::<f64>().unwrap();
        let [distance, diffusion] = ["receiver.rx.center.x", "species.A.diffusion"].map(number);
        // (r/d)·erfc((d − r)/√(4Dt)) of 6000 particles in three replicas.
        let fraction = 2.0 / distance * libm::erfc((distance - 2.0) / (4.0 * diffusion * 0.4).sqrt());
        let error = (2000.0 * fraction * (1.0 - fraction) / 3.0).sqrt();
        let [mean, low, high] = ["rx:A", "rx:A low", "rx:A high"].map(number);
        assert!((mean - 2000.0 * fraction).abs() < 4.0 * error, "{row:?}, not {}", 2000.0 * fraction);
        assert!(low < mean && mean < high && number("replicas") == 3.0, "{row:?}");
    }
    let [point, alone] = [out.clone() + "/point-0002", scratch.path("alone")];
    let args = ["simulate", &(point.clone() + "/scenario.toml"), "--output", &alone, "--replicas", "3"];
    lazygrid(args).succeeds();
    assert_eq!(rows(&(alone.clone() + "/mean.csv")), rows(&(point + "/mean.csv")));
    let report = fs::read_to_string(out.clone() + "/report.html").unwrap();
    let svg = fs::read_to_string(out + "/plots/arrivals.svg").unwrap();
    assert!(report.contains(&svg) && svg.contains("rx:A, species.A.diffusion = 50"));
}

#[test]
fn report_of_a_point_has_the_command_that_makes_it() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("s.toml", BURST), scratch.path("out"));
    let args =
        ["simulate", &scenario, "--output", &out, "--replicas", "2", "--report", "--series-every", "100"];
    lazygrid(args).succeeds();
    let point = out + "/point-0001";
    let path = point.clone() + "/report.html";
    let report = fs::read_to_string(&path).unwrap();
    let options = "--seed 3 --steps 200 --series-every 100 --report --replicas 2";
    assert!(report.contains("point-0001/scenario.toml") && report.contains(options), "{report}");
    fs::remove_file(&path).unwrap();
    let args = ["simulate", &(point.clone() + "/scenario.toml"), "--output", &point];
    lazygrid(args.into_iter().chain(options.split(' ')).chain(["--resume"])).succeeds();
    let names_file =
        |line: &&str| ["lazygrid simulate: ", "<td>scenario</td>"].iter().any(|name| line.contains(name));
    let again = fs::read_to_string(&path).unwrap();
    assert!(
        again.lines().filter(|line| !names_file(line)).eq(report.lines().filter(|line| !names_file(line)))
    );
}

#[test]
fn refused_resumption_changes_no_file() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("s.toml", BURST), scratch.path("out"));
    lazygrid(["simulate", &scenario, "--output", &out, "--report"]).succeeds();
    let before = files(&out);
    scratch.write("s.toml", &BURST.replace("radius = 2", "radius = 3"));
    let refused = lazygrid(["simulate", &scenario, "--output", &out, "--resume"]).fails();
    assert!(refused.err.contains("of another scenario"), "{}", refused.err);
    assert_eq!(files(&out), before);
}

#[test]
fn momentary_responses_have_a_plot_of_their_own() {
    let scratch = Scratch::new();
    let inside = "[[receiver]]\nname = \"in\"\ncenter = [0, 0, 0]\nradius = 3\nkind = \"transparent\"\n";
    let text =
        BURST.replace("[output]", &format!("{inside}[output]\narrivals = true")).replace("every = 200", "");
    let (scenario, out) = (scratch.write("s.toml", &text), scratch.path("out"));
    lazygrid(["simulate", &scenario, "--output", &out, "--report"]).succeeds();
    let report = fs::read_to_string(out.clone() + "/report.html").unwrap();
    let plot = |name: &str| fs::read_to_string(format!("{out}/plots/{name}.svg")).unwrap();
    let [arrivals, inside] = ["impulse-responses", "impulse-responses-inside"].map(plot);
    assert!(report.contains(&arrivals) && report.contains(&inside));
    assert!(arrivals.contains("tx to rx: A") && !arrivals.contains("tx to in: A"));
    assert!(inside.contains("tx to in: A") && inside.contains("fraction of the particles"));
}

#[test]
fn options_sweep_and_threads_change_no_byte() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let sweep = |out: &str, more: &[&str]| {
        let args = ["simulate", &scenario, "--output", out, "--sweep", "species.acid.diffusion=1,5"];
        lazygrid(args.iter().chain(more)).succeeds();
        files(out)
    };
    let [one, two] = ["one", "two"].map(|name| scratch.path(name));
    assert_eq!(sweep(&one, &["--threads", "1"]), sweep(&two, &["--threads", "3"]));
    let points = rows(&(one.clone() + "/points.csv"));
    assert_eq!(points.iter().map(|row| &row["species.acid.diffusion"][..]).collect::<Vec<_>>(), ["1", "5"]);
    let alone = scratch.path("alone");
    lazygrid(["simulate", &scenario, "--output", &alone, "--replicas", "1"]).succeeds();
    let series = |out: &str| fs::read_to_string(format!("{out}/replica-0000/series.csv")).unwrap();
    assert_eq!(series(&alone), series(&(one + "/point-0001")));
}

#[test]
fn sweeps_are_resumed_replaced_and_refused() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let [out, whole] = ["out", "whole"].map(|name| scratch.path(name));
    let simulate =
        |out: &str, more: &[&str]| lazygrid(["simulate", &scenario, "--output", out].iter().chain(more));
    let [two, three] = ["species.acid.diffusion=1,5", "species.acid.diffusion=1,5,9"];
    simulate(&whole, &["--sweep", three, "--replicas", "2"]).succeeds();
    simulate(&out, &["--sweep", two]).succeeds();
    fs::remove_dir_all(out.clone() + "/point-0001").unwrap();
    for (more, message) in [
        (&["--sweep", two][..], "holds a run already"),
        (&[], "holds a run already"),
        (&["--sweep", "species.acid.diffusion=1,6", "--resume"], "it has '1,5' and the sweep has '1,6'"),
        (&["--sweep", "species.acid.diffusion=1", "--resume"], "it has 2 points and the sweep has 1"),
        (&["--sweep", "species.acid.difusion=1"], "the nearest is 'species.acid.diffusion'"),
    ] {
        let run = simulate(&out, more).fails();
        assert!(run.err.contains(message), "{more:?}: {}", run.err);
    }
    for (key, option) in [
        ("seed", "--seed"),
        ("steps", "--steps"),
        ("output.every", "--series-every"),
        ("output.frames-every", "--frames-every"),
    ] {
        let run = simulate(&out, &["--sweep", &format!("{key}=1,2"), option, "3"]);
        assert_eq!(run.code, Some(2), "{}", run.err);
        assert!(run.err.contains(&format!("{option} would replace the values of {key} in")), "{}", run.err);
    }
    simulate(&out, &["--sweep", three, "--replicas", "2", "--resume"]).succeeds();
    assert_eq!(files(&out), files(&whole));
    simulate(&out, &["--sweep", two, "--replicas", "2", "--overwrite"]).succeeds();
    assert_eq!(rows(&(out.clone() + "/sweep.csv")).len(), 2);
    simulate(&out, &["--overwrite"]).succeeds();
    assert!(!std::path::Path::new(&(out + "/points.csv")).exists());
}

#[test]
fn overwritten_sweep_is_resumed_with_more_points() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let [out, whole] = ["out", "whole"].map(|name| scratch.path(name));
    let simulate = |out: &str, more: &[&str]| {
        lazygrid(["simulate", &scenario, "--output", out].iter().chain(more)).succeeds()
    };
    let [two, three] = ["species.acid.diffusion=1,5", "species.acid.diffusion=1,5,9"];
    simulate(&out, &["--sweep", three]);
    simulate(&out, &["--sweep", two, "--seed", "6", "--overwrite"]);
    simulate(&out, &["--sweep", three, "--seed", "6", "--resume"]);
    simulate(&whole, &["--sweep", three, "--seed", "6"]);
    assert_eq!(files(&out), files(&whole));
}

#[test]
fn sweep_that_will_not_fit_the_disk_is_refused() {
    let scratch = Scratch::new();
    let [scenario, out] = [scratch.write("s.toml", SCENARIO), scratch.path("out")];
    let args = ["simulate", &scenario, "--output", &out, "--sweep", "steps=40,4000000000"];
    let disk = lazygrid(args.iter().chain(&["--series-every", "1", "--replicas", "100000"])).fails().err;
    assert!(disk.contains("is going to write about"), "{disk}");
    assert!(!fs::exists(out + "/points.csv").unwrap());
}

#[test]
#[cfg(unix)]
fn interrupted_sweep_resumes() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let [out, whole] = ["out", "whole"].map(|name| scratch.path(name));
    let sweep = "species.acid.diffusion=1,2,3,4,5,6,7,8";
    let args = |out| {
        let args = ["simulate", &scenario, "--output", out, "--sweep", sweep, "--replicas", "4"];
        [&args[..], &LONG].concat()
    };
    let ended = begun(&args(&out), &(out.clone() + "/point-0001/replica-0000/checkpoint")).end("-INT");
    let message = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(130), "{message}");
    let says =
        ["of 32 runs done; resume with: ", &format!("--sweep {sweep} "), "--replicas 4 ", " --resume\n"];
    assert!(says.iter().all(|phrase| message.contains(phrase)), "{message}");
    lazygrid(args(&out).into_iter().chain(["--resume"])).succeeds();
    lazygrid(args(&whole)).succeeds();
    assert_eq!(files(&out), files(&whole));
}

#[test]
fn order_of_the_values_does_not_change_a_plot() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", BURST);
    let plot = |name: &str, values: &str| {
        let out = scratch.path(name);
        let sweep = format!("receiver.rx.center.x={values}");
        lazygrid(["simulate", &scenario, "--output", &out, "--sweep", &sweep, "--report"]).succeeds();
        fs::read_to_string(out + "/plots/arrivals.svg").unwrap()
    };
    assert_eq!(plot("mixed", "8,4,6"), plot("ascending", "4,6,8"));
}

#[test]
fn shipped_sweep_has_bit_errors_by_distance() {
    let scratch = Scratch::new();
    let out = scratch.path("out");
    let scenario = concat!(env!("CARGO_MANIFEST_DIR"), "/../simulator/scenarios/distances.toml");
    lazygrid(["simulate", scenario, "--output", &out, "--replicas", "4", "--report"]).succeeds();
    let table = rows(&(out.clone() + "/sweep.csv"));
    assert_eq!(table.len(), 6);
    for row in &table {
        let number = |name: &str| row[&format!("tx to rx bit error rate{name}")].parse::<f64>().unwrap();
        let [rate, low, high] = ["", " low", " high"].map(number);
        assert!(low <= rate && rate <= high && high - low > 0.02, "{row:?}");
    }
    let peak = |point: usize| table[point]["tx to rx: A peak time"].parse::<f64>().unwrap();
    assert!(peak(1) < peak(5), "the response of a farther receiver peaks later: {table:?}");
    let report = fs::read_to_string(out.clone() + "/report.html").unwrap();
    for plot in ["bit-errors", "peak-time", "arrived-fraction", "late-fraction", "impulse-responses"] {
        let svg = fs::read_to_string(format!("{out}/plots/{plot}.svg")).unwrap();
        assert!(report.contains(&svg), "{plot}");
    }
}
