use lazygrid::gpu::Crossover;
use lazygrid_tests::skip;

use super::*;

#[test]
fn the_gpu_finds_the_pairs_of_both_files() {
    if !has_gpu() {
        let run = lazygrid(["detect", &data("lammps-pour.dump"), "--backend", "gpu"]);
        assert!(run.code != Some(0) && run.err.contains("no GPU adapter"), "{}", run.err);
        return;
    }
    let pairs = |file: &str, options: &[&str]| {
        let file = data(file);
        let args = ["detect", &file, "--backend", "gpu", "--json"];
        let object = lazygrid(args.iter().chain(options)).succeeds().json();
        assert_eq!(object["backend"], "gpu");
        assert!(object["gpu"]["dispatches"].as_u64() > Some(2), "{object}");
        object["pairs"].as_u64()
    };
    assert_eq!(pairs("lammps-pour.dump", &[]), Some(3072));
    assert_eq!(pairs("smoldyn-burst.lst", &SMOLDYN), Some(35_236));
}

#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
fn times(out: &str) -> Vec<(&str, f64)> {
    let (_, rows) = out.split_once("\ntime ").unwrap();
    rows.lines()
        .map(|row| {
            let [name, time] = row.split_whitespace().collect::<Vec<_>>().try_into().unwrap();
            let unit = time.find(|c: char| c.is_alphabetic()).unwrap();
            let scale = match &time[unit..] {
                "s" => 1.0,
                "ms" => 1e-3,
                "µs" => 1e-6,
                _ => 1e-9,
            };
            (name, time[..unit].parse::<f64>().unwrap() * scale)
        })
        .collect()
}

#[test]
fn the_total_time_counts_nothing_twice() {
    if !has_gpu() {
        return;
    }
    for backend in ["cpu", "gpu"] {
        let run = lazygrid(["detect", &data("lammps-pour.dump"), "--backend", backend]).succeeds();
        let times = times(&run.out);
        let waits = times.iter().any(|(name, _)| *name == "wait");
        assert_eq!(waits, backend == "gpu", "{}", run.out);
        let on_device = ["survey", "entries", "sort", "search"];
        let counted =
            times.iter().filter(|(name, _)| *name != "total" && !(waits && on_device.contains(name)));
        let (sum, total) = (counted.map(|(_, time)| time).sum::<f64>(), times.last().unwrap());
        assert!(total.0 == "total" && (sum - total.1).abs() < 0.02 * total.1, "{sum}: {}", run.out);
    }
}

#[test]
fn an_adapter_is_chosen_by_index_or_by_name() {
    let (pour, adapters) = (data("lammps-pour.dump"), lazygrid::gpu::adapters());
    let detect = |options: &[&str]| lazygrid(["detect", &pour, "--json"].iter().chain(options));
    let devices = lazygrid(["devices"]).succeeds().out;
    for (index, adapter) in adapters.iter().enumerate() {
        assert!(devices.contains(&format!("gpu  {index}: {}", adapter.name)), "{devices}");
        let found = detect(&["--adapter", &index.to_string()]).succeeds().json();
        assert_eq!((&found["adapter"], &found["pairs"]), (&adapter.name.as_str().into(), &3072.into()));
        if adapters.iter().filter(|other| other.name == adapter.name).count() == 1 {
            let name = adapter.name.to_uppercase();
            let found = detect(&["--adapter", &name, "--backend", "gpu"]).succeeds().json();
            assert_eq!(found["adapter"], adapter.name);
        }
    }
    let unknown = detect(&["--adapter", "missing card"]).fails().err;
    match adapters.first() {
        None => assert!(unknown.contains("no GPU adapter"), "{unknown}"),
        Some(first) => {
            assert!(unknown.contains("missing card") && unknown.contains(&first.name), "{unknown}")
        }
    }
    let contradiction = detect(&["--adapter", "0", "--backend", "cpu"]);
    assert!(
        contradiction.code == Some(2) && contradiction.err.contains("adapter '0'"),
        "{}",
        contradiction.err
    );
    if adapters.len() < 2 {
        skip(None, &format!("choosing one of several adapters, as there are only {}", adapters.len()));
    }
}

#[test]
#[cfg(target_os = "linux")]
fn the_calibration_is_stored_and_used() {
    if !has_gpu() {
        assert!(lazygrid(["calibrate"]).fails().err.contains("no GPU adapter"));
        return;
    }
    let (scratch, pour) = (Scratch::new(), data("lammps-pour.dump"));
    let cache = scratch.path("cache");
    let reason = || {
        let run =
            LAZYGRID.run_with_cache(&cache, &["detect", &pour, "--backend", "gpu", "--json"]).succeeds();
        (run.json()["reason"].as_str().unwrap().to_owned(), run.err)
    };
    let (assumed, warning) = reason();
    assert!(assumed.contains("not measured on this") && warning.is_empty(), "{assumed} {warning}");

    let file = scratch.path("cache/lazygrid/calibration.json");
    let run = LAZYGRID.run_with_cache(&cache, &["calibrate"]).succeeds();
    assert!(run.out.contains(&lazygrid::gpu::adapters()[0].name) && run.out.contains(&file), "{}", run.out);
    let stored: Value = serde_json::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
    let [below, per_class] = ["naive_below", "per_class"]
        .map(|name| stored["calibrations"][0][name].as_u64().unwrap().try_into().unwrap());
    assert!(stored["calibrations"][0]["skin"]["search_ns"].as_f64().unwrap() > 0.0, "{stored}");
    assert!(run.out.contains("nanoseconds for each sphere"), "{}", run.out);
    let (measured, _) = reason();
    assert!(measured.contains("(measured on this adapter)"), "{measured}");
    // The pour has three sizes.
    let at = Crossover::new(below, per_class).for_classes(3);
    assert!(measured.contains(&format!(" {at} ")), "{measured}, {stored}");

    let other = fs::read_to_string(&file).unwrap().replace(env!("CARGO_PKG_VERSION"), "0.0.0");
    fs::write(&file, other).unwrap();
    assert!(reason().0.contains("not measured on this"));
    LAZYGRID.run_with_cache(&cache, &["calibrate"]).succeeds();
    let stored: Value = serde_json::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
    assert_eq!(stored["calibrations"].as_array().unwrap().len(), 1);

    fs::write(&file, "{\"calibrations\": [{").unwrap();
    let (assumed, warning) = reason();
    assert!(assumed.contains("not measured on this") && warning.contains(&file), "{assumed} {warning}");
    let nowhere = scratch.write("file", "");
    let run = LAZYGRID.run_with_cache(&nowhere, &["calibrate"]).fails();
    assert!(run.err.contains("cannot write") && run.err.contains(&nowhere), "{}", run.err);
    assert!(!run.out.contains("size"), "measured in vain: {}", run.out);
}
