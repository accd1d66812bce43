use super::{files, lazygrid, rows};
use lazygrid_tests::command::{Scratch, has_gpu};

const SCENARIO: &str = r#"
time-step = 0.001
steps = 60
seed = 3
[[species]]
name = "A"
diffusion = 20
[[species]]
name = "B"
diffusion = 20
[[species]]
name = "C"
diffusion = 20
[[decay]]
equation = "B -> C + C"
rate = 30
[[transmitter]]
name = "left"
center = [-1, 0, 0]
times = [0, 0.02]
release = [{ species = "A", count = 300 }, { species = "B", count = 200 }]
[[transmitter]]
name = "right"
center = [1, 0, 0]
numbers = "poisson"
release = [{ species = "B", rate = 5000 }]
[[receiver]]
name = "near"
center = [-1.6, 0, 0]
radius = 0.4
kind = "absorbing"
[[receiver]]
name = "far"
center = [1.6, 0, 0]
radius = 0.4
kind = "endpoint"
species = ["A", "C"]
[output]
arrivals = true
every = 20
"#;

#[test]
fn every_arrival_is_logged_with_the_transmitter_of_origin() {
    assert_arrivals_are_logged("cpu");
}

#[test]
fn gpu_logs_every_arrival_with_the_transmitter_of_origin() {
    if has_gpu() {
        assert_arrivals_are_logged("gpu");
    }
}

#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
fn assert_arrivals_are_logged(backend: &str) {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("s.toml", SCENARIO), scratch.path("out"));
    lazygrid(["simulate", &scenario, "--output", &out, "--backend", backend]).succeeds();
    let arrivals = rows(&(out.clone() + "/arrivals.csv"));
    for row in rows(&(out.clone() + "/series.csv")) {
        let until: u32 = row["step"].parse().unwrap();
        for (receiver, species) in [("near", "A"), ("near", "B"), ("near", "C"), ("far", "A"), ("far", "C")] {
            let so_far = arrivals.iter().filter(|arrival| arrival["step"].parse::<u32>().unwrap() <= until);
            let count = so_far.filter(|a| a["receiver"] == receiver && a["species"] == species).count();
            assert_eq!(
                row[&format!("{receiver}:{species}")],
                count.to_string(),
                "{receiver}:{species} at {until}"
            );
        }
    }
    let releases = rows(&(out.clone() + "/releases.csv"));
    let released = |transmitter: &str, species: &str| -> u64 {
        let rows =
            releases.iter().filter(|row| row["transmitter"] == transmitter && row["species"] == species);
        rows.map(|row| row["count"].parse::<u64>().unwrap()).sum()
    };
    assert_eq!([released("left", "A"), released("left", "B")], [600, 400]);
    let steady = released("right", "B");
    assert!((300..400).contains(&(steady + 50)) && released("right", "A") == 0, "{steady}");
    let (mut ids, mut seen) = (std::collections::HashSet::new(), std::collections::BTreeMap::<_, u32>::new());
    for arrival in &arrivals {
        assert!(ids.insert(arrival["id"].clone()), "{arrival:?} came twice");
        *seen.entry((arrival["receiver"].clone(), arrival["transmitter"].clone())).or_default() += 1;
        let [time, released] = ["time", "released"].map(|name| arrival[name].parse::<f64>().unwrap());
        assert!(released < time, "{arrival:?}");
        match &arrival["transmitter"][..] {
            "left" => assert!(released == 0.0 || (released == 0.02 && time > 0.02), "{arrival:?}"),
            "right" => assert!(arrival["species"] != "A" && released > 0.0, "{arrival:?}"),
            _ => panic!("{arrival:?}"),
        }
        let id: u64 = arrival["id"].parse().unwrap();
        assert!(id >= 500 || (arrival["transmitter"] == "left" && arrival["released"] == "0"), "{arrival:?}");
    }
    let count = |receiver: &str, from: &str| *seen.get(&(receiver.into(), from.into())).unwrap_or(&0);
    assert!(count("near", "left") > 20 * count("near", "right").max(1), "{seen:?}");
    assert!(count("far", "right") > 3 * count("far", "left").max(1), "{seen:?}");
    assert!(arrivals.iter().any(|a| a["species"] == "C" && a["transmitter"] == "right"), "no C of right");
}

#[test]
fn a_resumed_log_is_the_same_to_the_last_byte() {
    let scratch = Scratch::new();
    let scenario = scratch.write("s.toml", SCENARIO);
    let [whole, resumed] = ["whole", "parts"].map(|name| scratch.path(name));
    lazygrid(["simulate", &scenario, "--output", &whole, "--threads", "1"]).succeeds();
    lazygrid(["simulate", &scenario, "--output", &resumed, "--steps", "23"]).succeeds();
    for name in ["arrivals.csv", "releases.csv"] {
        let path = format!("{resumed}/{name}");
        std::fs::write(&path, std::fs::read_to_string(&path).unwrap() + "24,what a crash left").unwrap();
    }
    lazygrid(["simulate", &scenario, "--output", &resumed, "--resume"]).succeeds();
    assert_eq!(files(&whole), files(&resumed));
    let silent = scratch.write("silent.toml", &SCENARIO.replace("arrivals = true\n", ""));
    lazygrid(["simulate", &silent, "--output", &scratch.path("silent")]).succeeds();
    assert!(
        !files(&scratch.path("silent"))
            .iter()
            .any(|(name, _)| name == "arrivals.csv" || name == "releases.csv")
    );
}

#[test]
fn arrow_files_take_a_build_with_the_feature() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("s.toml", SCENARIO), scratch.path("out"));
    let run = lazygrid(["simulate", &scenario, "--output", &out, "--arrivals-format", "arrow"]);
    if cfg!(feature = "arrow") {
        run.succeeds();
        for name in ["arrivals", "releases"] {
            let file = std::fs::read(format!("{out}/{name}.arrow")).unwrap();
            assert!(file.starts_with(b"ARROW1") && file.ends_with(b"ARROW1"), "{name}");
        }
    } else {
        assert!(run.fails().err.contains("--features arrow"));
        assert!(!std::path::Path::new(&out).exists());
    }
}
