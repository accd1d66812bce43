use lazygrid::Algorithm;
use lazygrid::gpu::adapters;
use lazygrid_tests::command::has_gpu;
use serde_json::Value;

use crate::LAZYGRID;

fn checked(args: &[&str]) -> Value {
    let object = LAZYGRID.run([&["check", "--json"], args].concat()).succeeds().json();
    assert_eq!((&object["ok"], &object["failures"]), (&Value::from(true), &Value::from(Vec::<Value>::new())));
    object
}

fn timed(object: &Value, backend: &str) -> Vec<String> {
    let rows = object["speeds"].as_array().expect("rows").iter().filter(|row| row["backend"] == backend);
    rows.map(|row| {
        assert!(row["pairs"].as_u64().is_some_and(|pairs| pairs > 1000), "{row}");
        assert!(row["stages"].as_object().is_some_and(|stages| !stages.is_empty()), "{row}");
        row["algorithm"].as_str().expect("a name").to_owned()
    })
    .collect()
}

fn names(algorithms: &[Algorithm]) -> Vec<String> {
    algorithms.iter().map(|algorithm| algorithm.name().to_owned()).collect()
}

#[test]
fn the_cpu_is_all_right() {
    let object = checked(&["--quick", "--backend", "cpu"]);
    assert_eq!(timed(&object, "cpu"), names(Algorithm::CPU));
    assert_eq!((&object["gpu"], &object["kernels"]), (&Value::Null, &Value::Null));
    let scenes = &object["scenes"];
    assert!(scenes["scenes"].as_u64() > Some(90) && scenes["ways_on_cpu"].as_u64() >= Some(10), "{scenes}");
    assert_eq!(scenes["ways_on_gpu"], 0);
}

#[test]
fn the_gpu_is_all_right_where_there_is_one() {
    if !has_gpu() {
        let run = LAZYGRID.run(["check", "--quick", "--backend", "gpu"]).fails();
        assert!(run.err.contains("no GPU adapter was found"), "{}", run.err);
        return;
    }
    let object = checked(&["--quick", "--backend", "gpu", "--adapter", "0"]);
    assert_eq!(timed(&object, "gpu"), names(Algorithm::GPU));
    assert_eq!(object["gpu"]["name"], adapters()[0].name);
    assert!(object["kernels"]["checked"].as_u64() > Some(10), "{}", object["kernels"]);
    let what = |row: &Value| row["what"].as_str().map(str::to_owned);
    let rows: Vec<_> =
        object["primitives"]["rows"].as_array().expect("rows").iter().filter_map(what).collect();
    assert_eq!(rows, ["copy", "scan", "sort, 24 bits"]);
    for speed in object["speeds"].as_array().expect("speeds") {
        let cost = &speed["gpu"];
        assert!(cost["dispatches"].as_u64() > Some(2) && cost["working_bytes"].as_u64() > Some(0), "{speed}");
        assert_eq!(cost["traffic_bytes"].is_u64(), speed["algorithm"] == "cell-list", "{speed}");
    }
}

#[test]
fn a_seed_is_a_round() {
    for seed in ["0", "7", "18446744073709551615"] {
        let object = checked(&["--seed", seed, "--backend", "cpu"]);
        assert_eq!(object["fuzz"]["rounds"], 1);
        assert_eq!(object["fuzz"]["first_seed"].to_string(), seed);
    }
    let run = LAZYGRID.run(["check", "--seed", "7", "--backend", "cpu"]).succeeds();
    assert!(run.out.contains("starting with seed 7") && run.out.contains("all right"), "{}", run.out);
}
