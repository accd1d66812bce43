//! `RESULTS-GPU.md`: predicted GPU times next to measured ones.

use std::fmt::Write;

use lazygrid::Algorithm;
use lazygrid::gpu::plan::Planner;
use lazygrid::gpu::{CallCost, DeviceLimits, GpuConfig, wgpu};
use serde::Deserialize;

const SIZES: [u32; 5] = [10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];
/// Seconds of an empty dependent dispatch: 1.7 µs on an H200 through Vulkan.
const DISPATCH_SECONDS: f64 = 1.7e-6;

struct Device {
    name: &'static str,
    bandwidth: f64,
    source: &'static str,
}

const DEVICES: [Device; 4] = [
    Device { name: "NVIDIA H200", bandwidth: 4.3e12, source: "a copy kernel, measured" },
    Device { name: "NVIDIA RTX 4090", bandwidth: 1.01e12, source: "published peak" },
    Device { name: "AMD RX 7900 XTX", bandwidth: 0.96e12, source: "published peak" },
    Device { name: "integrated, 90 GB/s", bandwidth: 9e10, source: "two channels of DDR5-5600" },
];

#[derive(Clone, Debug, Deserialize)]
pub struct GpuRun {
    version: String,
    #[serde(default)]
    commit: Option<String>,
    gpu: Option<Adapter>,
    #[serde(default)]
    primitives: Primitives,
    #[serde(default)]
    speeds: Vec<Speed>,
    #[serde(default)]
    failures: Vec<serde_json::Value>,
}

#[derive(Clone, Debug, Deserialize)]
struct Adapter {
    name: String,
    driver: String,
    api: String,
    hardware: bool,
    subgroups: String,
}

#[derive(Clone, Debug, Default, Deserialize)]
struct Primitives {
    #[serde(default)]
    clock: String,
    #[serde(default)]
    rows: Vec<Primitive>,
}

#[derive(Clone, Debug, Deserialize)]
struct Primitive {
    what: String,
    bytes_per_second: f64,
}

#[derive(Clone, Debug, Deserialize)]
struct Speed {
    backend: String,
    algorithm: String,
    scene: String,
    spheres: u64,
    pairs: u64,
    seconds: f64,
    busy_seconds: f64,
    /// `true` if a call has several submissions, which wall time alone measures.
    #[serde(default)]
    divided: bool,
    #[serde(default)]
    quartiles: Option<Quartiles>,
    gpu: Option<SpeedCost>,
}

#[derive(Clone, Debug, Deserialize)]
struct Quartiles {
    busy_seconds: [f64; 2],
}

#[derive(Clone, Debug, Deserialize)]
struct SpeedCost {
    dispatches: f64,
    traffic_bytes: Option<f64>,
}

impl GpuRun {
    pub fn parse(text: &str) -> Result<Self, String> {
        let run: Self = serde_json::from_str(text).map_err(|error| error.to_string())?;
        if run.gpu.is_none() {
            return Err("no GPU was measured in this run".to_owned());
        }
        Ok(run)
    }

    fn bandwidth(&self) -> Option<f64> {
        let copies = self.primitives.rows.iter().filter(|row| row.what == "copy");
        copies.map(|row| row.bytes_per_second).reduce(f64::max)
    }
}

/// Assumes that each dispatch waits for the previous one, and each byte is transferred once.
fn expected(dispatches: f64, traffic_bytes: f64, bandwidth: f64) -> f64 {
    dispatches * DISPATCH_SECONDS + traffic_bytes / bandwidth
}

/// Returns the costs of a call that chooses its cells and of one that reuses them.
fn costs(spheres: u32) -> Option<[CallCost; 2]> {
    let limits = wgpu::Limits {
        max_storage_buffer_binding_size: (1 << 31) - 4,
        max_buffer_size: 1 << 32,
        max_compute_workgroup_storage_size: 48 << 10,
        ..wgpu::Limits::default()
    };
    let config = GpuConfig::default().algorithm(Algorithm::CellList);
    let planner = Planner::new(config, DeviceLimits::from(&limits));
    Some([planner.plan(spheres).ok()?.cost, planner.cost_with_reused_cells(spheres).ok()?])
}

fn duration(seconds: f64) -> String {
    let (number, unit) = if seconds < 1e-3 { (seconds * 1e6, "µs") } else { (seconds * 1e3, "ms") };
    let digits = (2 - number.max(1e-9).log10().floor() as i32).max(0) as usize;
    format!("{number:.digits$} {unit}")
}

fn count(number: u64) -> String {
    match number {
        1_000_000.. if number.is_multiple_of(1_000_000) => format!("{} M", number / 1_000_000),
        1_000.. if number.is_multiple_of(1_000) => format!("{} k", number / 1_000),
        _ => number.to_string(),
    }
}

pub fn document(runs: &[GpuRun], commit: &str) -> String {
    let mut text = format!(
        "# Results on GPUs\n\n\
         Written by `lazygrid-bench gpu-results` at commit {commit}. {}\n\n",
        match runs.iter().filter(|run| run.gpu.as_ref().is_some_and(|gpu| gpu.hardware)).count() {
            0 => "**Times in the first section are arithmetic, not measurements.**".to_owned(),
            1 => "The run of one GPU follows; times in the first section are arithmetic.".to_owned(),
            many => format!("The runs of {many} GPUs follow; times in the first section are arithmetic."),
        }
    );
    expectations(&mut text);
    text += HOW_TO_RUN;
    text += "## Measured\n\n";
    text += MEASURED_ELSEWHERE;
    runs.iter().for_each(|run| measured(&mut text, run));
    text.truncate(text.trim_end().len());
    text + "\n"
}

const MEASURED_ELSEWHERE: &str = "\
[bench/results/nvidia-h100-h200.md](bench/results/nvidia-h100-h200.md) has the times of calls and kernels on an H100 and an
H200. On the H200 a call takes 8 times the sum of dispatches and bytes for ten thousand spheres, and 4 times for a million or
more.

";

const HOW_TO_RUN: &str = "\
## A run on a GPU

```sh
cargo run --release -p lazygrid-cli -- check --full --json > gpu.json
cargo run --release -p lazygrid-bench -- gpu-results gpu.json -o RESULTS-GPU.md
```

Without a Rust compiler: open the file that `lazygrid page` writes, choose *Measure*, copy the JSON into `gpu.json`, and
run the second command elsewhere. [docs/page.md](docs/page.md) says more.

";

fn expectations(text: &mut String) {
    *text += "\
## Expected by arithmetic

The cell list on five sizes of spheres at a filling of 5 %. The plan of a call says how many dispatches it has and how many bytes
they read and write; `lazygrid plan` prints it. Of 17 calls for spheres that move little, 16 reuse the cells that an
earlier call chose. A call takes about

    dispatches × 1.7 µs + bytes ÷ bandwidth

An empty dispatch that waits for the previous one takes 1.7 µs, measured on an H200 through Vulkan. The estimate leaves out
instructions, of which the search has the most, latencies, the pairs, and caches, which hold a million spheres on some devices.

";
    let _ = write!(text, "| spheres | cells | dispatches | bytes per sphere |");
    for device in &DEVICES {
        let _ = write!(text, " {} |", device.name);
    }
    let _ = writeln!(text, "\n|{}", " ---: |".repeat(4 + DEVICES.len()));
    for spheres in SIZES {
        for (cells, cost) in ["chosen", "reused"].into_iter().zip(costs(spheres).into_iter().flatten()) {
            let traffic = cost.traffic_bytes.unwrap_or(0) as f64;
            let (n, per_sphere) = (count(spheres.into()), traffic / f64::from(spheres));
            let _ = write!(text, "| {n} | {cells} | {} | {per_sphere:.0} |", cost.dispatches);
            for device in &DEVICES {
                let seconds = expected(cost.dispatches.into(), traffic, device.bandwidth);
                let _ = write!(text, " {} |", duration(seconds));
            }
            *text += "\n";
        }
    }
    *text += "\nBandwidths: ";
    let sources =
        DEVICES.iter().map(|d| format!("{} {:.2} TB/s ({})", d.name, d.bandwidth * 1e-12, d.source));
    *text += &sources.collect::<Vec<_>>().join("; ");
    *text += ".\n\n";
}

fn measured(text: &mut String, run: &GpuRun) {
    let Some(gpu) = &run.gpu else { return };
    let kind =
        if gpu.hardware { "hardware" } else { "**software, runs on the CPU; says nothing about GPUs**" };
    let commit = run.commit.as_ref().map_or(String::new(), |commit| format!(", commit {commit}"));
    let _ = writeln!(
        text,
        "### {}\n\n{kind}; {}; {}; {}; lazygrid {}{commit}; times by {}.\n",
        gpu.name, gpu.api, gpu.driver, gpu.subgroups, run.version, run.primitives.clock
    );
    if !run.failures.is_empty() {
        let _ = writeln!(text, "**{} checks of this run failed.**\n", run.failures.len());
    }
    let bandwidth = run.bandwidth();
    if let Some(bandwidth) = bandwidth {
        let _ = writeln!(text, "A copy reads and writes {:.0} GB/s together.\n", bandwidth * 1e-9);
    }
    *text += "| scene | spheres | algorithm | pairs | on the GPU | quartiles | with transfers | ns per sphere | arithmetic | measured ÷ arithmetic |\n";
    *text += "| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n";
    for speed in run.speeds.iter().filter(|speed| speed.backend == "gpu") {
        let bound = || {
            let cost = speed.gpu.as_ref()?;
            Some(expected(cost.dispatches, cost.traffic_bytes?, bandwidth?))
        };
        let (bound, ratio) = match bound().filter(|_| gpu.hardware && !speed.divided) {
            Some(bound) => (duration(bound), format!("{:.1}", speed.busy_seconds / bound)),
            None => ("–".to_owned(), "–".to_owned()),
        };
        let busy = if speed.divided { "–".to_owned() } else { duration(speed.busy_seconds) };
        let quartiles = speed
            .quartiles
            .as_ref()
            .filter(|_| !speed.divided)
            .map_or("–".to_owned(), |quartiles| quartiles.busy_seconds.map(duration).join(" to "));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {quartiles} | {} | {:.2} | {bound} | {ratio} |",
            speed.scene,
            count(speed.spheres),
            speed.algorithm,
            speed.pairs,
            busy,
            duration(speed.seconds),
            speed.busy_seconds / speed.spheres as f64 * 1e9,
        );
    }
    *text += "\n";
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(hardware: bool) -> GpuRun {
        let json = serde_json::json!({
            "version": "0.1.0", "cpu": null, "ok": true, "failures": [],
            "gpu": { "name": "A GPU", "driver": "1", "api": "vulkan", "hardware": hardware, "subgroups": "subgroups of 32", "timestamps": true },
            "primitives": { "clock": "the GPU's clock", "rows": [
                { "what": "copy", "values": 1, "seconds": 1.0, "bytes_per_second": 1e12, "of_copy": 1.0 },
            ] },
            "speeds": [{
                "backend": "gpu", "algorithm": "cell-list", "scene": "five-sizes", "spheres": 1_000_000, "pairs": 7,
                "seconds": 0.002, "busy_seconds": 0.001, "quartiles": { "seconds": [0.001, 0.003], "busy_seconds": [0.0009, 0.0012] },
                "stages": {}, "rounds": 9, "gpu": { "dispatches": 10, "working_bytes": 1, "pair_bytes": 1, "traffic_bytes": 483_000_000 },
            }],
        });
        GpuRun::parse(&json.to_string()).expect("a run")
    }

    #[test]
    fn measured_times_stand_beside_the_arithmetic() {
        let text = document(&[run(true)], "abc");
        // 10 × 1.7 µs + 483 MB ÷ 1 TB/s are 0.5 ms.
        assert!(text.contains("| five-sizes | 1 M | cell-list | 7 | 1.00 ms | 900 µs to 1.20 ms | 2.00 ms | 1.00 | 500 µs | 2.0 |"), "{text}");
        assert!(text.contains("The run of one GPU follows"));
    }

    #[test]
    fn software_adapters_do_not_count_as_measured_gpus() {
        let text = document(&[run(false)], "abc");
        assert!(!text.contains("of one GPU follows") && text.contains("says nothing about GPUs"));
        assert!(text.contains("| 1.00 | – | – |"), "{text}");
    }

    #[test]
    fn expectations_grow_with_spheres_and_shrink_with_bandwidth() {
        let seconds = |spheres| {
            let [cost, _] = costs(spheres).expect("a plan");
            DEVICES.map(|d| {
                expected(cost.dispatches.into(), cost.traffic_bytes.expect("known") as f64, d.bandwidth)
            })
        };
        let (few, many) = (seconds(10_000), seconds(10_000_000));
        assert!(few.iter().zip(many).all(|(few, many)| *few < many) && many.is_sorted());
        for spheres in SIZES {
            let [chosen, reused] = costs(spheres).expect("a plan");
            assert!(reused.dispatches <= chosen.dispatches && reused.traffic_bytes < chosen.traffic_bytes);
        }
    }

    #[test]
    fn runs_without_a_gpu_are_refused() {
        assert!(GpuRun::parse("{\"version\":\"0.1.0\",\"gpu\":null}").is_err());
        assert!(GpuRun::parse("[]").is_err());
    }
}
