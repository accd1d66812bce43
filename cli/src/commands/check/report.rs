mod shown;

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use lazygrid::{Algorithm, Backend};
use lazygrid_check::detectors::compare::FailedCase;
use lazygrid_check::detectors::sequence::Tally;
use lazygrid_check::timing::speed::Speed;
use lazygrid_check::{Effort, Gpu};
use lazygrid_io::scenes::Scene;
use serde_json::{Map, Value, json};

use crate::args::Check;
use crate::commands::detect::summary::{cost_object, cost_text};
use crate::devices;
use crate::error::CliError;
use crate::printer::Printer;

/// A GPU's count may differ by two tangent pairs, and by one in this number.
const TANGENT: u64 = 1_000_000;

pub(super) struct Report {
    is_json: bool,
    printer: Printer,
    /// Options that select the device.
    device: String,
    effort: &'static str,
    object: Map<String, Value>,
    failures: Vec<Value>,
    files: usize,
    left_out: Vec<Value>,
    speeds: Vec<Value>,
    counts: Vec<(Scene, usize, u64)>,
    start: Instant,
}

pub(super) struct Primitive {
    pub(super) what: String,
    pub(super) values: u32,
    pub(super) seconds: f64,
    pub(super) bandwidth: f64,
    /// Fraction of the copy's bandwidth.
    pub(super) of_copy: f64,
}

#[derive(Clone, Copy)]
pub(super) struct TimingLabel {
    pub(super) backend: Backend,
    pub(super) algorithm: Algorithm,
    pub(super) scene: Scene,
    pub(super) spheres: usize,
}

impl Report {
    pub(super) fn new(args: &Check, gpu: Option<&Gpu>, skipped: Option<String>) -> Self {
        use clap::ValueEnum;
        let backend = args.backend.to_possible_value();
        let mut report = Self::empty(args.json, backend.as_ref().map_or("all", |value| value.get_name()));
        if let Some(adapter) = &args.adapter {
            report.device += &format!(" --adapter '{adapter}'");
        }
        report.effort = match args.effort() {
            Effort::Quick => " --quick",
            Effort::Default => "",
            Effort::Full => " --full",
        };
        report.record("version", env!("CARGO_PKG_VERSION"));
        report.record("cpu", devices::cpu());
        report.say(&format!("cpu        {}\n", devices::cpu()));
        match gpu.map(|gpu| &gpu.device.adapter) {
            Some(adapter) => {
                let subgroups = devices::subgroups(adapter);
                report.record(
                    "gpu",
                    json!({
                        "name": adapter.name, "driver": adapter.driver, "api": adapter.api,
                        "hardware": adapter.is_hardware, "subgroups": subgroups, "timestamps": adapter.has_timestamps,
                    }),
                );
                let kind = if adapter.is_hardware { "" } else { ", software" };
                let clock = if adapter.has_timestamps { "" } else { ", no timestamps" };
                let line = format!(
                    "{}, {} by {}, {subgroups}{kind}{clock}",
                    adapter.name, adapter.driver, adapter.api
                );
                report.say(&format!("gpu        {line}\n"));
            }
            None => {
                report.record("gpu", Value::Null);
                if let Some(reason) = skipped {
                    report.say(&format!("gpu        not checked: {reason}\n"));
                    report.record("gpu_skipped", reason);
                }
            }
        }
        report
    }

    fn empty(is_json: bool, backend: &str) -> Self {
        Self {
            is_json,
            printer: Printer::default(),
            device: format!("--backend {backend}"),
            effort: "",
            object: Map::new(),
            failures: Vec::new(),
            files: 0,
            left_out: Vec::new(),
            speeds: Vec::new(),
            counts: Vec::new(),
            start: Instant::now(),
        }
    }

    fn say(&mut self, text: &str) {
        if !self.is_json {
            self.printer.print(text);
        }
    }

    fn record(&mut self, name: &str, value: impl Into<Value>) {
        self.object.insert(name.to_owned(), value.into());
    }

    pub(super) fn kernels(&mut self, kernels: usize, time: Duration) {
        self.record("kernels", json!({ "checked": kernels, "seconds": time.as_secs_f64() }));
        self.say(&format!("kernels    {kernels} against sequential functions, {time:.1?}\n"));
    }

    pub(super) fn scenes(
        &mut self,
        [scenes, gpu, cpu]: [usize; 3],
        [left_out, not_taken]: [&[(String, usize)]; 2],
        time: Duration,
    ) {
        let object = |searches: &[(String, usize)]| -> Map<String, Value> {
            searches.iter().map(|(variant, searches)| (variant.clone(), (*searches).into())).collect()
        };
        self.record(
            "scenes",
            json!({
                "scenes": scenes, "ways_on_gpu": gpu, "ways_on_cpu": cpu, "left_out": object(left_out),
                "not_taken": object(not_taken),
                "seconds": time.as_secs_f64(),
            }),
        );
        let variants = [(gpu, "gpu"), (cpu, "cpu")].into_iter().filter(|(count, _)| *count > 0);
        let texts: Vec<String> = variants.map(|(count, on)| format!("in {count} ways on the {on}")).collect();
        let listed = |why: &str, searches: &[(String, usize)]| match searches {
            [] => String::new(),
            _ => {
                let each = searches.iter().map(|(variant, searches)| format!("{searches} of {variant}"));
                format!("; {why}: {}", each.collect::<Vec<_>>().join(", "))
            }
        };
        let left_out = listed("left out as too long", left_out);
        let not_taken = listed("left out as filtered on the host, with subgroups only", not_taken);
        self.say(&format!("scenes     {scenes} {}, {time:.1?}{left_out}{not_taken}\n", texts.join(" and ")));
    }

    pub(super) fn fuzz(&mut self, seed: u64, rounds: u64, tally: &Tally, time: Duration) {
        let Tally { sequences, calls, served, refused } = *tally;
        let of_sequences =
            json!({ "number": sequences, "calls": calls, "served": served, "refused": refused });
        let seconds = time.as_secs_f64();
        self.record(
            "fuzz",
            json!({ "first_seed": seed, "rounds": rounds, "sequences": of_sequences, "seconds": seconds }),
        );
        self.say(&format!(
            "\nfuzz       {rounds} rounds and {sequences} sequences of {calls} calls, {served} of them answered from \
             candidates, starting with seed {seed}, {time:.1?}\n"
        ));
    }

    pub(super) fn primitives(&mut self, has_gpu_clock: bool, rows: Vec<Primitive>) {
        let clock = if has_gpu_clock { "the GPU's clock" } else { "wall time" };
        let mut text =
            format!("\n{:<15}{:>11}{:>12}{:>10}   of a copy, {clock}\n", "", "values", "ms", "GB/s");
        for Primitive { what, values, seconds, bandwidth, of_copy } in &rows {
            let _ = writeln!(
                text,
                "{what:<15}{values:>11}{:>12.3}{:>10.1}{:>8.0} %",
                seconds * 1e3,
                bandwidth * 1e-9,
                of_copy * 100.0
            );
        }
        let rows: Vec<Value> = rows
            .iter()
            .map(|row| {
                json!({
                    "what": row.what, "values": row.values, "seconds": row.seconds,
                    "bytes_per_second": row.bandwidth, "of_copy": row.of_copy,
                })
            })
            .collect();
        self.record("primitives", json!({ "clock": clock, "rows": rows }));
        self.say(&text);
    }

    pub(super) fn speeds_of(&mut self, backend: Backend) {
        let busy = if backend == Backend::Gpu { "ms of gpu" } else { "ns/sphere" };
        self.say(&format!(
            "\n{:<15}{:>11}{:>12}{:>10}{busy:>11}   {backend}, stages in ms\n",
            "", "spheres", "pairs", "ms"
        ));
    }

    pub(super) fn speed(&mut self, label: TimingLabel, speed: &Speed) {
        let TimingLabel { backend, algorithm, scene, spheres } = label;
        let stages: Map<String, Value> =
            speed.stages.iter().map(|(name, seconds)| ((*name).to_owned(), (*seconds).into())).collect();
        self.speeds.push(json!({
            "backend": backend.name(), "algorithm": algorithm.name(), "scene": scene.name(), "spheres": spheres,
            "pairs": speed.pairs, "seconds": speed.seconds, "busy_seconds": speed.busy, "stages": stages,
            "rounds": speed.rounds, "gpu": speed.cost.as_ref().map(cost_object),
        }));
        let busy = match backend {
            Backend::Gpu => speed.busy * 1e3,
            _ => speed.seconds / spheres as f64 * 1e9,
        };
        let mut stages: Vec<String> =
            speed.stages.iter().map(|(name, seconds)| format!("{name} {:.3}", seconds * 1e3)).collect();
        stages.extend(speed.cost.as_ref().map(cost_text));
        self.say(&format!(
            "{algorithm:<15}{spheres:>11}{:>12}{:>10.3}{busy:>11.3}   {scene}: {}\n",
            speed.pairs,
            speed.seconds * 1e3,
            stages.join(", ")
        ));
        self.compare_count(label, speed.pairs);
    }

    fn compare_count(&mut self, label: TimingLabel, pairs: u64) {
        let TimingLabel { backend, algorithm, scene, spheres } = label;
        let known = self.counts.iter().find(|(known_scene, n, _)| *known_scene == scene && *n == spheres);
        let Some(&(.., expected)) = known else {
            self.counts.push((scene, spheres, pairs));
            return;
        };
        let tolerance = if backend == Backend::Gpu { 2 + expected / TANGENT } else { 0 };
        if pairs.abs_diff(expected) <= tolerance {
            return;
        }
        let name = format!("{algorithm} on {backend}, {spheres} spheres, {scene}");
        let what = format!("{pairs} pairs counted where {expected} are expected");
        let options = format!(
            "lazygrid generate {scene} -n {spheres} -o check.npy && lazygrid detect check.npy --count --backend {backend} --algorithm {algorithm}"
        );
        self.failure(FailedCase { name, what, options, ..FailedCase::default() });
    }

    pub(super) fn left_out(&mut self, label: TimingLabel, why: &str) {
        let TimingLabel { backend, algorithm, scene, spheres } = label;
        self.left_out.push(json!({
            "backend": backend.name(), "algorithm": algorithm.name(), "scene": scene.name(), "spheres": spheres,
            "why": why,
        }));
        self.say(&format!("{algorithm:<15}{spheres:>11}   left out, and more: {why}\n"));
    }

    pub(super) fn failure(&mut self, fault: FailedCase) {
        let path = PathBuf::from(format!("lazygrid-check-{}.csv", self.files + 1));
        let command = self.command(&path, &fault);
        let FailedCase { name, what, scenario, .. } = fault;
        let mut file = Value::Null;
        let mut text = format!("WRONG      {name}: {what}\n");
        if let Some(scenario) = &scenario {
            match shown::write(&path, scenario, &format!("{name}: {what}\n{command}")) {
                Ok(()) => {
                    let spheres = scenario.spheres.len();
                    let _ = writeln!(text, "           {spheres} spheres in {}", path.display());
                    self.files += 1;
                    file = path.display().to_string().into();
                }
                Err(error) => drop(writeln!(text, "           not written: {error}")),
            }
        }
        let _ = writeln!(text, "           {command}");
        self.failures.push(json!({
            "name": name, "what": what, "file": file, "command": command,
            "spheres": scenario.map(|scenario| scenario.spheres.len()),
        }));
        self.say(&text);
    }

    fn command(&self, path: &Path, fault: &FailedCase) -> String {
        let FailedCase { name, options, environment, .. } = fault;
        let (device, effort, scenario) = (&self.device, self.effort, fault.scenario.as_ref());
        let seed = name.strip_prefix("fuzz seed ").and_then(|rest| rest.split_once(':'));
        let fuzz = seed.map(|(seed, _)| format!("lazygrid check {device} --seed {seed}"));
        let detect =
            scenario.filter(|_| !options.is_empty()).and_then(|scenario| shown::options(path, scenario));
        match (detect, fuzz) {
            (Some(of_scene), fuzz) => {
                let detect = format!("{environment}lazygrid detect {}{options}{of_scene}", path.display());
                fuzz.map_or(detect.clone(), |fuzz| format!("{detect}, or {fuzz}"))
            }
            (None, None) if scenario.is_none() && !options.is_empty() => options.clone(),
            (_, Some(fuzz)) => fuzz,
            _ => format!("lazygrid check {device}{effort}"),
        }
    }

    pub(super) fn finish(mut self) -> Result<(), CliError> {
        let failures = self.failures.len();
        let time = self.start.elapsed();
        let [speeds, left_out, failed] =
            [&mut self.speeds, &mut self.left_out, &mut self.failures].map(std::mem::take);
        for (name, list) in [("speeds", speeds), ("left_out", left_out), ("failures", failed)] {
            self.record(name, list);
        }
        self.record("seconds", time.as_secs_f64());
        self.record("ok", failures == 0);
        if self.is_json {
            self.printer.print(format!("{}\n", Value::Object(self.object)));
        } else if failures == 0 {
            self.printer.print(format!("\nall right, {:.0} s\n", time.as_secs_f64()));
        }
        if failures == 0 { self.printer.finish() } else { Err(CliError::Wrong { failures }) }
    }
}

#[cfg(test)]
mod tests;
