#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::HashMap;
use std::fs;

use super::{SCENARIO, files, lazygrid, rows};
use lazygrid_tests::command::Scratch;

const BITS: &str = r#"
time-step = 0.004
steps = 620
seed = 11
[[species]]
name = "A"
diffusion = 100
[[transmitter]]
name = "tx"
random-bits = 10
symbol-time = 0.2
start = 0.02
numbers = "poisson"
release = [{ species = "A", count = 60 }]
[[receiver]]
name = "rx"
center = [10, 0, 0]
radius = 5
kind = "absorbing"
[output]
every = 50
arrivals = true
"#;

const REPLICAS: usize = 16;

/// Arrived fraction of a burst: (r/d)·erfc((d − r)/√(4Dt)).
fn arrived(time: f64) -> f64 {
    if time <= 0.0 { 0.0 } else { 0.5 * libm::erfc(5.0 / (400.0 * time).sqrt()) }
}

fn number(row: &HashMap<String, String>, name: &str) -> f64 {
    row[name].parse().unwrap()
}

#[test]
fn report_of_the_last_run_is_replaced_not_rewritten() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("bits.toml", BITS), scratch.path("out"));
    let args = ["simulate", &scenario, "--output", &out, "--report", "--overwrite", "--seed"];
    let at = |name: &str| format!("{out}/{name}");
    lazygrid(args.into_iter().chain(["1"])).succeeds();
    let plot = fs::read_dir(at("plots")).unwrap().next().unwrap().unwrap().file_name();
    let names = ["report.html", "impulse-response.csv", &format!("plots/{}", plot.to_str().unwrap())];
    let old = names.map(|name| {
        fs::hard_link(at(name), at(name) + ".old").unwrap();
        fs::read_to_string(at(name)).unwrap()
    });
    lazygrid(args.into_iter().chain(["2"])).succeeds();
    for (name, old) in names.into_iter().zip(old) {
        assert!(fs::read_to_string(at(name)).unwrap() != old, "{name}");
        assert!(fs::read_to_string(at(name) + ".old").unwrap() == old, "{name} was rewritten in place");
    }
}

#[test]
fn channels_are_as_formulas_and_logs_say() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("bits.toml", BITS), scratch.path("out"));
    let replicas = REPLICAS.to_string();
    lazygrid(["simulate", &scenario, "--output", &out, "--replicas", &replicas, "--report"]).succeeds();
    let directory = |k: usize| format!("{out}/replica-{k:04}");
    let table = |name: &str| rows(&format!("{out}/{name}"));
    let released: f64 = (0..REPLICAS)
        .flat_map(|k| rows(&(directory(k) + "/releases.csv")))
        .map(|row| number(&row, "count"))
        .sum();
    assert!((released / (30.0 * 10.0 * REPLICAS as f64) - 1.0).abs() < 0.3, "{released}");

    let responses = table("impulse-response.csv");
    assert!(responses.len() > 50, "{} rows", responses.len());
    for row in responses.iter().filter(|row| number(row, "until") < 0.45) {
        let [from, until] = ["from", "until"].map(|name| number(row, name));
        for (what, fraction) in [("fraction", arrived(until) - arrived(from)), ("so far", arrived(until))] {
            let measured = number(row, &format!("{what} mean"));
            let error = (fraction * (1.0 - fraction) / released).sqrt();
            assert!(
                (measured - fraction).abs() < 4.5 * error + 1e-3 * fraction,
                "{what} until {until}: {measured}, not {fraction}"
            );
            let said = number(row, &format!("{what} error"));
            assert!(
                fraction < 0.01 || (0.3..3.0).contains(&(said / error)),
                "{what} until {until}: {said}, not {error}"
            );
        }
    }
    for row in table("interference.csv").iter().take(4) {
        let slot = number(row, "slot");
        let fraction = arrived(0.2 * (slot + 1.0)) - arrived(0.2 * slot);
        let error = (fraction / released).sqrt() * 2.0_f64.sqrt();
        assert!((number(row, "fraction mean") - fraction).abs() < 4.0 * error, "{row:?}, not {fraction}");
    }
    let errors = table("bit-errors.csv");
    let mut best = usize::MAX;
    for delay in [0.0, 0.1, 0.4] {
        let mut slots = Vec::new();
        for k in 0..REPLICAS {
            let (sent, arrivals) =
                (rows(&(directory(k) + "/symbols.csv")), rows(&(directory(k) + "/arrivals.csv")));
            assert_eq!(sent.len(), 10);
            for symbol in sent {
                let begin = number(&symbol, "time") + delay;
                let within = |time: f64| time > begin + 1e-9 && time < begin + 0.2 + 1e-9;
                let count = arrivals.iter().filter(|arrival| within(number(arrival, "time"))).count();
                slots.push((symbol["symbol"] == "1", count));
            }
        }
        let delay_rows: Vec<_> = errors.iter().filter(|row| number(row, "delay") == delay).collect();
        let mut expected: Vec<usize> = slots.iter().map(|slot| slot.1 + 1).chain([0]).collect();
        expected.sort_unstable();
        expected.dedup();
        let thresholds: Vec<usize> = delay_rows.iter().map(|row| row["threshold"].parse().unwrap()).collect();
        assert!(delay_rows.len() > 10 && thresholds == expected, "{thresholds:?}, not {expected:?}");
        for (threshold, row) in thresholds.into_iter().zip(delay_rows) {
            let wrong = slots.iter().filter(|&&(bit, count)| (count >= threshold) != bit).count();
            assert_eq!(
                (&row["errors"], &row["bits"][..]),
                (&wrong.to_string(), "160"),
                "{delay} s, {threshold}"
            );
            assert!((number(row, "rate") - wrong as f64 / 160.0).abs() < 1e-12);
            best = if delay == 0.0 { best.min(wrong) } else { best };
        }
    }
    assert!(best < 60, "{best}");
    let report = fs::read_to_string(out.clone() + "/report.html").unwrap();
    assert!(report.contains(&format!(", {best} of 160 bits")) && report.contains("--replicas 16"));
    for name in ["particles", "arrivals", "impulse-response", "arrived", "interference", "bit-errors"] {
        let svg = fs::read_to_string(format!("{out}/plots/{name}.svg")).unwrap();
        assert!(svg.starts_with("<svg") && report.contains(&svg), "{name}");
    }
}

#[test]
fn overwritten_run_leaves_no_file_of_its_report_and_animation() {
    let scratch = Scratch::new();
    let text = BITS.replace("arrivals = true", "arrivals = true\nframes = [\"npy\"]\nframes-every = 100");
    let [out, whole] = ["out", "whole"].map(|name| scratch.path(name));
    let scenario = scratch.write("bits.toml", &text);
    lazygrid(["simulate", &scenario, "--output", &out, "--report", "--animate"]).succeeds();
    assert!(
        ["frame-000000100.npy", "bit-errors.csv", "plots"]
            .iter()
            .all(|name| { fs::exists(format!("{out}/{name}")).unwrap() })
    );
    let scenario = scratch.write("s.toml", SCENARIO);
    lazygrid(["simulate", &scenario, "--output", &out, "--overwrite"]).succeeds();
    lazygrid(["simulate", &scenario, "--output", &whole]).succeeds();
    assert_eq!(files(&out), files(&whole));
    assert!(!fs::exists(out.clone() + "/plots").unwrap());
    lazygrid(["simulate", &scenario, "--output", &out, "--overwrite", "--report"]).succeeds();
    let foreign = out.clone() + "/plots/own.svg";
    fs::write(&foreign, "<svg xmlns=\"http://www.w3.org/2000/svg\"/>").unwrap();
    lazygrid(["simulate", &scenario, "--output", &out, "--overwrite"]).succeeds();
    let plots = fs::read_dir(out + "/plots").unwrap().map(|entry| entry.unwrap().path());
    assert!(plots.eq([std::path::Path::new(&foreign)]));
}

#[test]
fn report_without_a_table_removes_an_earlier_one() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("s.toml", SCENARIO), scratch.path("out"));
    lazygrid(["simulate", &scenario, "--output", &out, "--report"]).succeeds();
    let (table, page) = (out.clone() + "/bit-errors.csv", out.clone() + "/report.html");
    fs::write(&table, "transmitter\n").unwrap();
    lazygrid(["simulate", &scenario, "--output", &out, "--report", "--resume"]).succeeds();
    assert!(fs::exists(&table).unwrap(), "no report had this table");
    let text = fs::read_to_string(&page).unwrap();
    // XXH64 of the table.
    let named = text.replacen("simulate: -->", "simulate: bit-errors.csv 12 e6a8ae2a370c076a; -->", 1);
    assert_ne!(named, text);
    fs::write(&page, named).unwrap();
    lazygrid(["simulate", &scenario, "--output", &out, "--report", "--resume"]).succeeds();
    assert!(!fs::exists(table).unwrap());
    assert_eq!(fs::read_to_string(page).unwrap(), text);
}

#[test]
fn resumed_run_drops_the_report_of_fewer_steps() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("bits.toml", BITS), scratch.path("out"));
    let derived = ["report.html", "plots", "impulse-response.csv", "bit-errors.csv"];
    let exist = || derived.map(|name| fs::exists(format!("{out}/{name}")).unwrap());
    lazygrid(["simulate", &scenario, "--output", &out, "--steps", "300", "--report"]).succeeds();
    assert_eq!(exist(), [true; 4]);
    lazygrid(["simulate", &scenario, "--output", &out, "--steps", "300", "--resume"]).succeeds();
    assert_eq!(exist(), [true; 4]);
    lazygrid(["simulate", &scenario, "--output", &out, "--steps", "301", "--resume"]).succeeds();
    assert_eq!(exist(), [false; 4]);
}

#[test]
fn a_report_of_one_run_has_its_series() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("s.toml", SCENARIO), scratch.path("out"));
    lazygrid(["simulate", &scenario, "--output", &out, "--report"]).succeeds();
    let report = fs::read_to_string(out.clone() + "/report.html").unwrap();
    assert!(
        report.contains("arrivals = true") && report.contains("<td>acid + base -&gt; salt</td>"),
        "{report}"
    );
    assert!(!std::path::Path::new(&(out.clone() + "/impulse-response.csv")).exists());
    fs::remove_file(out.clone() + "/report.html").unwrap();
    lazygrid(["simulate", &scenario, "--output", &out, "--report", "--resume"]).succeeds();
    assert_eq!(fs::read_to_string(out + "/report.html").unwrap(), report);
}

const INSIDE: &str = r#"
time-step = 0.01
steps = 210
seed = 4
[[species]]
name = "A"
diffusion = 100
[[transmitter]]
name = "tx"
random-bits = 10
symbol-time = 0.2
start = 0.05
release = [{ species = "A", count = 500 }]
[[receiver]]
name = "rx"
center = [8, 0, 0]
radius = 3
kind = "transparent"
[output]
every = 5
arrivals = true
"#;

fn inside(time: f64) -> f64 {
    let (r, d, spread) = (3.0_f64, 8.0_f64, (400.0 * time).sqrt());
    if time <= 0.0 {
        return 0.0;
    }
    let [near, far] = [(d - r) / spread, (d + r) / spread];
    0.5 * (libm::erf(far) - libm::erf(near))
        + spread / (2.0 * d * std::f64::consts::PI.sqrt()) * ((-far * far).exp() - (-near * near).exp())
}

#[test]
fn transparent_receivers_have_responses_and_bit_errors() {
    let scratch = Scratch::new();
    let (scenario, out) = (scratch.write("inside.toml", INSIDE), scratch.path("out"));
    lazygrid(["simulate", &scenario, "--output", &out, "--replicas", "12", "--report"]).succeeds();
    let replicas = || (0..12).map(|k| format!("{out}/replica-{k:04}"));
    let table = |name: &str| rows(&format!("{out}/{name}"));
    let bursts: f64 =
        replicas().flat_map(|directory| rows(&(directory + "/releases.csv"))).map(|_| 1.0).sum();
    // Bins are one step long; rows are every 5 steps after a release.
    let responses: Vec<_> =
        table("impulse-response.csv").into_iter().filter(|row| !row["fraction mean"].is_empty()).collect();
    assert!(responses.len() > 10, "{} bins", responses.len());
    for row in responses.iter().filter(|row| number(row, "from") < 0.8) {
        let fraction = inside(number(row, "from"));
        let error = (fraction / (400.0 * bursts.min(60.0))).sqrt();
        assert!(
            (number(row, "fraction mean") - fraction).abs() < 4.0 * error + 1e-4,
            "{row:?}, not {fraction}"
        );
        assert!(row["so far mean"].is_empty());
    }
    for row in table("interference.csv").iter().take(3) {
        let from = 0.2 * number(row, "slot");
        let fraction = (0..4).map(|k| inside(from + 0.05 * f64::from(k))).sum::<f64>() / 4.0;
        assert!((number(row, "fraction mean") / fraction - 1.0).abs() < 0.1, "{row:?}, not {fraction}");
    }
    let errors = table("bit-errors.csv");
    for (detector, delay) in [("peak", 0.0), ("energy", 0.05), ("strength", 0.1)] {
        let mut slots = Vec::new();
        for directory in replicas() {
            let series = rows(&(directory.clone() + "/series.csv"));
            for symbol in rows(&(directory + "/symbols.csv")) {
                let begin = number(&symbol, "time") + delay;
                // The row at the end has the burst of the next symbol.
                let within = |time: f64| time > begin - 1e-9 && time < begin + 0.2 - 1e-9;
                let counts: Vec<u64> = series
                    .iter()
                    .filter(|row| within(number(row, "time")))
                    .map(|row| row["rx:A"].parse().unwrap())
                    .collect();
                // A delay's last slot is incomplete.
                if begin + 0.2 < 2.1 + 1e-9 {
                    let seen = match detector {
                        "peak" => counts.iter().copied().max().unwrap(),
                        "energy" => counts.iter().map(|count| count * count).sum(),
                        _ => counts.iter().sum::<u64>(),
                    };
                    slots.push((symbol["symbol"] == "1", seen));
                }
            }
        }
        let matching =
            errors.iter().filter(|row| row["detector"] == detector && number(row, "delay") == delay);
        let mut thresholds = 0;
        for row in matching {
            let threshold: u64 = row["threshold"].parse().unwrap();
            let wrong = slots.iter().filter(|&&(bit, seen)| (seen >= threshold) != bit).count();
            let expected = (wrong.to_string(), slots.len().to_string());
            assert_eq!((&row["errors"], &row["bits"]), (&expected.0, &expected.1), "{detector} {threshold}");
            let [rate, low, high] = ["rate", "rate low", "rate high"].map(|name| number(row, name));
            assert!(low <= rate && rate <= high && low < high, "{row:?}");
            thresholds += 1;
        }
        assert!(thresholds > 10, "{detector}: {thresholds} thresholds");
    }
    let by_symbol = table("by-symbol.csv");
    let mean = |symbol: &str| {
        let matching = by_symbol.iter().filter(|row| row["symbol"] == symbol && number(row, "time") > 0.07);
        matching.map(|row| number(row, "count mean")).sum::<f64>()
    };
    assert!(mean("1") > 1.5 * mean("0"), "{} and {}", mean("1"), mean("0"));
    let report = fs::read_to_string(out.clone() + "/report.html").unwrap();
    for name in
        ["inside", "inside-by-symbol", "impulse-response-inside", "interference", "bit-errors-by-delay"]
    {
        let svg = fs::read_to_string(format!("{out}/plots/{name}.svg")).unwrap();
        assert!(report.contains(&svg), "{name}");
    }
    let log = |out: &str| fs::read(format!("{out}/occupancy.csv")).unwrap();
    let [whole, resumed] = ["whole", "parts"].map(|name| scratch.path(name));
    lazygrid(["simulate", &scenario, "--output", &whole]).succeeds();
    lazygrid(["simulate", &scenario, "--output", &resumed, "--steps", "103"]).succeeds();
    lazygrid(["simulate", &scenario, "--output", &resumed, "--resume"]).succeeds();
    assert_eq!(log(&whole), log(&resumed));
}
