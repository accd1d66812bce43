use std::fs;
use std::path::Path;
use std::process::Command;

use lazygrid_tests::command::Scratch;

use crate::LAZYGRID;
use crate::refusals::scenario;
use crate::simulate::files;

#[test]
fn run_leaves_files_of_others_alone() {
    let scratch = Scratch::new();
    let file = scratch.write("a.toml", &scenario(""));
    let run = scratch.path("run");
    fs::create_dir(&run).unwrap();
    let series = scratch.write("run/series.csv", "the work of years\n");
    let said = LAZYGRID.run(["simulate", &file, "--output", &run]).fails().err;
    assert!(said.contains("series.csv") && said.contains("--overwrite"), "{said}");
    assert_eq!(fs::read_to_string(&series).unwrap(), "the work of years\n");
    LAZYGRID.run(["simulate", &file, "--output", &run, "--overwrite"]).succeeds();
    assert!(fs::read_to_string(&series).unwrap().starts_with("step,"));
    for name in ["series.csv", "checkpoint", ".lock"] {
        let pipe = scratch.path(&format!("run/{name}"));
        fs::remove_file(&pipe).unwrap();
        assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for how in ["--overwrite", "--resume"] {
            let said = LAZYGRID.run(["simulate", &file, "--output", &run, how]).fails().err;
            assert!(said.contains(name) && said.contains("it is a pipe"), "{said}");
        }
        fs::remove_file(&pipe).unwrap();
        LAZYGRID.run(["simulate", &file, "--output", &run, "--overwrite"]).succeeds();
    }
}

#[test]
fn run_leaves_frames_of_others_alone() {
    let scratch = Scratch::new();
    let file = scratch
        .write("a.toml", &(scenario("").replace("[[species]]", "[output]\nframes = [\"npy\"]\n[[species]]")));
    let run = scratch.path("run");
    fs::create_dir(&run).unwrap();
    let frame = scratch.write("run/frame-000000002.npy", "the work of years\n");
    for more in [&[][..], &["--replicas", "2"], &["--sweep", "time-step=1e-3,2e-3"]] {
        let args = ["simulate", &file, "--frames-every", "2", "--output", &run];
        let said = LAZYGRID.run(args.iter().chain(more)).fails().err;
        assert!(
            said.contains("it holds a file frame-000000002.npy") && said.contains("--overwrite"),
            "{said}"
        );
        assert_eq!(fs::read_to_string(&frame).unwrap(), "the work of years\n", "{more:?}");
    }
    fs::rename(&frame, scratch.path("run/frame-of-mine.npy")).unwrap();
    LAZYGRID.run(["simulate", &file, "--frames-every", "2", "--output", &run]).succeeds();
    assert!(fs::read(&frame).unwrap().starts_with(b"\x93NUMPY"));
    let more = ["--steps", "4", "--frames-every", "2", "--resume", "--output", &run];
    LAZYGRID.run(["simulate", &file].iter().chain(&more)).succeeds();
    assert!(fs::exists(scratch.path("run/frame-of-mine.npy")).unwrap());
}

#[test]
fn run_leaves_plots_of_others_alone() {
    let scratch = Scratch::new();
    let (file, run) = (scratch.write("a.toml", &scenario("")), scratch.path("run"));
    fs::create_dir_all(run.clone() + "/plots").unwrap();
    let plot = scratch.write("run/plots/particles.svg", "the work of years\n");
    let simulate =
        |more: &[&str]| LAZYGRID.run(["simulate", &file, "--report", "--output", &run].iter().chain(more));
    for more in [&[][..], &["--replicas", "2"], &["--sweep", "time-step=1e-3,2e-3"]] {
        let said = simulate(more).fails().err;
        assert!(
            said.contains("it holds a file plots/particles.svg") && said.contains("--overwrite"),
            "{said}"
        );
    }
    fs::rename(&plot, scratch.path("mine.svg")).unwrap();
    simulate(&[]).succeeds();
    assert!(fs::read_to_string(&plot).unwrap().starts_with("<svg"));
    simulate(&["--resume", "--steps", "3"]).succeeds();
    let page = fs::read_to_string(run.clone() + "/report.html").unwrap();
    fs::rename(scratch.path("mine.svg"), &plot).unwrap();
    let said = simulate(&["--resume", "--steps", "3"]).fails().err;
    assert!(said.contains("it holds a file plots/particles.svg"), "{said}");
    assert_eq!(fs::read_to_string(&plot).unwrap(), "the work of years\n");
    assert_eq!(fs::read_to_string(run.clone() + "/report.html").unwrap(), page);
    simulate(&["--overwrite"]).succeeds();
    assert!(fs::read_to_string(&plot).unwrap().starts_with("<svg"));
}

#[test]
fn resumed_replicas_leave_files_of_others_alone() {
    let scratch = Scratch::new();
    let text = scenario("").replace("[[species]]", "[output]\nframes = [\"npy\"]\n[[species]]");
    let (file, run) = (scratch.write("a.toml", &text), scratch.path("run"));
    let simulate = |replicas: &str, more: &[&str]| {
        let args = ["simulate", &file, "--frames-every", "2", "--output", &run, "--replicas", replicas];
        LAZYGRID.run(args.iter().chain(more))
    };
    simulate("1", &[]).succeeds();
    let second = run.clone() + "/replica-0001/";
    fs::create_dir(&second).unwrap();
    for name in ["series.csv", "frame-000000002.npy", "bit-errors.csv"] {
        let foreign = second.clone() + name;
        fs::write(&foreign, "the work of years\n").unwrap();
        // A refused run must not claim the files.
        for _ in 0..2 {
            let said = simulate("2", &["--resume"]).fails().err;
            let message = format!("it holds a file {name} of no run that can be continued; move the file");
            assert!(said.contains(&message), "{said}");
            assert_eq!(fs::read_to_string(&foreign).unwrap(), "the work of years\n");
        }
        fs::remove_file(foreign).unwrap();
    }
    // A run that ends before its first checkpoint keeps its own files.
    let frame = second.clone() + "frame-000000000.npy";
    fs::create_dir(&frame).unwrap();
    assert!(simulate("2", &["--resume"]).fails().err.contains("frame-000000000.npy: cannot write"));
    assert!(fs::exists(second.clone() + "series.csv").unwrap());
    fs::remove_dir(&frame).unwrap();
    simulate("2", &["--resume"]).succeeds();
    // A replica whose checkpoint is lost also keeps its files, unless their seed differs.
    fs::remove_file(second.clone() + "checkpoint").unwrap();
    fs::rename(second.clone() + ".lock", scratch.path("lock")).unwrap();
    fs::copy(run.clone() + "/replica-0000/.lock", second.clone() + ".lock").unwrap();
    assert!(simulate("2", &["--resume"]).fails().err.contains("it holds a file series.csv"));
    fs::rename(scratch.path("lock"), second + ".lock").unwrap();
    simulate("2", &["--resume"]).succeeds();
}

#[test]
fn report_leaves_tables_and_pages_of_others_alone() {
    let scratch = Scratch::new();
    let (file, run) = (scratch.write("a.toml", &channel()), scratch.path("run"));
    let at = |name: &str| format!("{run}/{name}");
    let read = |name: &str| fs::read_to_string(at(name)).unwrap();
    let simulate = |more: &[&str]| LAZYGRID.run(["simulate", &file, "--output", &run].iter().chain(more));
    simulate(&["--report", "--steps", "20"]).succeeds();
    let all = ["impulse-response.csv", "by-symbol.csv", "interference.csv", "bit-errors.csv", "report.html"];
    let mut steps = 20;
    for name in all {
        steps += 1;
        simulate(&["--report", "--resume", "--steps", &steps.to_string()]).succeeds();
        let before = all.map(read);
        fs::write(at(name), "the work of years\n").unwrap();
        let page = read("report.html");
        let said = simulate(&["--report", "--resume", "--steps", &steps.to_string()]).fails().err;
        let reason = match name {
            "report.html" => {
                "that was written by another version or by another program; move it, or start over with"
            }
            _ => "of no run that can be continued",
        };
        assert!(said.contains(&format!("it holds a file {name} {reason}")), "{said}");
        assert_eq!((read(name), read("report.html")), ("the work of years\n".to_owned(), page));
        steps += 1;
        simulate(&["--resume", "--steps", &steps.to_string()]).succeeds();
        assert_eq!(read(name), "the work of years\n");
        let others = all.into_iter().filter(|other| *other != name && fs::exists(at(other)).unwrap());
        // Without the page, its tables are not known.
        assert_eq!(others.count(), if name == "report.html" { 4 } else { 0 }, "{name}");
        let said = simulate(&["--report", "--resume", "--steps", &steps.to_string()]).fails().err;
        assert!(said.contains(&format!("it holds a file {name}")), "{said}");
        fs::remove_file(at(name)).unwrap();
        assert!(before.iter().all(|content| !content.contains("the work of years")));
    }
    simulate(&["--report", "--overwrite", "--steps", "20"]).succeeds();
    assert!(all.map(read).iter().all(|content| !content.contains("the work of years")));
}

#[test]
fn report_replaces_own_files_with_other_line_ends() {
    let scratch = Scratch::new();
    let (file, run) = (scratch.write("a.toml", &channel()), scratch.path("run"));
    let simulate = |steps: &str, more: &[&str]| {
        let args = ["simulate", &file, "--output", &run, "--report", "--steps", steps];
        LAZYGRID.run(args.iter().chain(more))
    };
    simulate("20", &[]).succeeds();
    let plots = fs::read_dir(run.clone() + "/plots").unwrap().map(|entry| entry.unwrap().path());
    let files =
        ["impulse-response.csv", "interference.csv", "bit-errors.csv", "by-symbol.csv", "report.html"];
    for path in files.map(|name| Path::new(&run).join(name)).into_iter().chain(plots) {
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replace('\n', "\r\n")).unwrap();
    }
    simulate("21", &["--resume"]).succeeds();
    assert!(!fs::read_to_string(run + "/bit-errors.csv").unwrap().contains('\r'));
}

fn channel() -> String {
    let text = scenario("bits = \"1011\"\nsymbol-time = 5e-3")
        .replace("[[species]]", "[output]\narrivals = true\n[[species]]");
    text + "[[receiver]]\nname = \"rx\"\nkind = \"absorbing\"\ncenter = [0.1, 0.0, 0.0]\nradius = 0.05\n"
}

#[test]
fn resumed_run_refuses_reports_of_others_before_its_first_step() {
    let scratch = Scratch::new();
    let file = scratch.write("a.toml", &channel());
    for (k, runs) in [&[][..], &["--replicas", "2"], &["--sweep", "transmitter.tx.release.0.count=5,6"]]
        .into_iter()
        .enumerate()
    {
        let run = scratch.path(&format!("run-{k}"));
        let simulate = |steps: &str, more: &[&str]| {
            let args = ["simulate", &file, "--output", &run, "--report", "--steps", steps];
            LAZYGRID.run(args.iter().chain(runs).chain(more))
        };
        simulate("20", &[]).succeeds();
        let mut names = vec!["report.html", "plots/particles.svg"];
        match k {
            0 => names.push("bit-errors.csv"),
            1 => names.extend(["bit-errors.csv", "mean.csv"]),
            _ => names.extend(["point-0001/bit-errors.csv", "point-0000/mean.csv", "sweep.csv"]),
        }
        for name in names {
            let path = format!("{run}/{name}");
            let bytes = fs::read(&path).unwrap();
            fs::write(&path, "the work of years\n").unwrap();
            let before = files(&run);
            let said = simulate("21", &["--resume"]).fails().err;
            let name = name.rsplit_once("000/").or(name.rsplit_once("001/")).map_or(name, |(_, name)| name);
            assert!(said.contains(&format!("it holds a file {name} ")), "{said}");
            assert!(files(&run) == before, "{runs:?}, {name}: files have changed");
            fs::write(&path, bytes).unwrap();
        }
        if k == 2 {
            let path = format!("{run}/point-0000/report.html");
            let bytes = fs::read(&path).unwrap();
            fs::write(&path, "the work of years\n").unwrap();
            let more = ["--resume", "--sweep", "transmitter.tx.release.0.count=5,6,7"];
            let args = ["simulate", &file, "--output", &run, "--report", "--steps", "20"];
            let said = LAZYGRID.run(args.iter().chain(&more)).fails().err;
            assert!(said.contains("it holds a file report.html "), "{said}");
            assert!(!Path::new(&format!("{run}/point-0002/checkpoint")).exists());
            fs::write(&path, bytes).unwrap();
            fs::write(run.clone() + "/bit-errors.csv", "the work of years\n").unwrap();
        }
        let mine = scratch.write(&format!("run-{k}/plots/mine.svg"), "the work of years\n");
        simulate("21", &["--resume"]).succeeds();
        assert_eq!(fs::read_to_string(mine).unwrap(), "the work of years\n");
        fs::remove_file(run.clone() + "/report.html").unwrap();
        fs::remove_dir_all(run.clone() + "/plots").unwrap();
        simulate("21", &["--resume"]).succeeds();
    }
}

#[test]
fn more_steps_leave_pages_and_copies_of_others_alone() {
    let scratch = Scratch::new();
    let resume = |text: &str, name: &str, more: &[&str]| {
        let (file, run) = (scratch.write("a.toml", text), scratch.path(name));
        let simulate = |steps: &[&str]| {
            LAZYGRID.run(["simulate", &file, "--output", &run].iter().chain(more).chain(steps))
        };
        simulate(&[]).succeeds();
        let others = ["animation.html", "arrivals.arrow"].map(|file| format!("{run}/{file}"));
        others.iter().for_each(|path| fs::write(path, "the work of years\n").unwrap());
        simulate(&["--resume", "--steps", "3"]).succeeds();
        let is_left = |path: &String| fs::read(path).is_ok_and(|content| content == b"the work of years\n");
        assert!(others.iter().all(is_left), "{name}");
    };
    resume(&scenario(""), "plain", &[]);
    resume(&scenario(""), "replicas", &["--replicas", "2"]);
    resume(&channel(), "logged", &[]);
}

#[test]
fn resumed_run_refuses_pages_and_copies_of_others_that_it_would_replace() {
    let scratch = Scratch::new();
    let refuse = |text: &str, name: &str, more: &[&str], result: &str| {
        let (file, run) = (scratch.write("a.toml", text), scratch.path(name));
        let simulate = |steps: &[&str]| {
            LAZYGRID.run(["simulate", &file, "--output", &run].iter().chain(more).chain(steps))
        };
        simulate(&[]).succeeds();
        simulate(&["--resume", "--steps", "21"]).succeeds();
        let path = format!("{run}/{result}");
        assert!(fs::exists(&path).unwrap(), "{name}");
        fs::write(&path, "the work of years\n").unwrap();
        let before = files(&run);
        for steps in ["21", "22"] {
            let said = simulate(&["--resume", "--steps", steps]).fails().err;
            let result = result.rsplit('/').next().unwrap();
            assert!(
                said.contains(&format!("it holds a file {result} that was written by another version")),
                "{said}"
            );
            assert!(files(&run) == before, "{name}: files have changed");
        }
    };
    refuse(&scenario(""), "animated", &["--animate"], "animation.html");
    refuse(&scenario(""), "replicas", &["--animate", "--replicas", "2"], "replica-0000/animation.html");
    if cfg!(feature = "arrow") {
        let arrow = ["--arrivals-format", "arrow"];
        refuse(&channel(), "logged", &arrow, "releases.arrow");
        let (file, run) = (scratch.write("a.toml", &channel()), scratch.path("copied"));
        let simulate = |more: &[&str]| LAZYGRID.run(["simulate", &file, "--output", &run].iter().chain(more));
        simulate(&arrow).succeeds();
        let copies = ["arrivals.arrow", "releases.arrow"].map(|name| format!("{run}/{name}"));
        assert!(copies.iter().all(|copy| fs::exists(copy).unwrap()));
        simulate(&["--resume", "--steps", "21"]).succeeds();
        assert!(copies.iter().all(|copy| !fs::exists(copy).unwrap()));
    }
}

#[cfg(unix)]
#[test]
fn run_leaves_the_target_of_its_lock_alone() {
    let scratch = Scratch::new();
    let (file, run) = (scratch.write("a.toml", &scenario("")), scratch.path("run"));
    let target = scratch.write("mine", "the work of years\n");
    fs::create_dir(&run).unwrap();
    std::os::unix::fs::symlink(&target, run.clone() + "/.lock").unwrap();
    LAZYGRID.run(["simulate", &file, "--output", &run]).succeeds();
    assert_eq!(fs::read_to_string(&target).unwrap(), "the work of years\n");
}

#[test]
fn sweep_leaves_scenarios_of_others_alone() {
    let scratch = Scratch::new();
    let (file, run) = (scratch.write("a.toml", &scenario("")), scratch.path("run"));
    let sweep = |values: &str, more: &[&str]| {
        let values = format!("time-step={values}");
        LAZYGRID.run(["simulate", &file, "--output", &run, "--sweep", &values].iter().chain(more))
    };
    fs::create_dir_all(run.clone() + "/point-0001").unwrap();
    let foreign = scratch.write("run/point-0001/scenario.toml", "the work of years\n");
    let is_left = |said: &str| {
        assert!(said.contains("it holds a file scenario.toml") && said.contains("--overwrite"), "{said}");
        assert_eq!(fs::read_to_string(&foreign).unwrap(), "the work of years\n");
    };
    is_left(&sweep("1e-3,2e-3", &[]).fails().err);
    assert!(!fs::exists(run.clone() + "/points.csv").unwrap());
    sweep("1e-3", &[]).succeeds();
    is_left(&sweep("1e-3,2e-3", &["--resume"]).fails().err);
    sweep("1e-3", &["--overwrite"]).succeeds();
    is_left(&sweep("1e-3,2e-3", &["--resume"]).fails().err);
    sweep("1e-3,2e-3", &["--overwrite"]).succeeds();
    assert!(fs::read_to_string(&foreign).unwrap().starts_with("steps = 2"));
    sweep("1e-3", &["--overwrite"]).succeeds();
    assert!(!fs::exists(&foreign).unwrap());
    sweep("1e-3,2e-3", &["--resume"]).succeeds();
}
