//! The radix sort and the prefix scan compared with a copy on the device.
#![allow(clippy::print_stdout)]

use std::error::Error;

use clap::Parser;
use lazygrid_bench::measure::{QuickMode, Spread, markdown, provenance};
use lazygrid_check::timing::bandwidth::{GpuTimer, Measured};

#[derive(Parser)]
#[command(about = "Radix sort and prefix scan compared with the copy bandwidth of the device")]
struct Args {
    /// Numbers of values, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [1_000_000, 10_000_000])]
    n: Vec<u32>,
    /// Key bits of the sort, separated by commas; rounded up to passes of eight bits
    #[arg(long, value_delimiter = ',', default_values_t = [24, 25, 32])]
    bits: Vec<u32>,
    /// Rounds, after one to warm up
    #[arg(long, default_value_t = 30)]
    rounds: usize,
    /// Use no subgroup operations
    #[arg(long)]
    no_subgroups: bool,
    #[command(flatten)]
    mode: QuickMode,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = Args::parse();
    if args.mode.is_quick() {
        (args.n, args.rounds) = (vec![0, 1, 257, 20_000], 1);
    }
    let Some(gpu) = lazygrid_tests::device() else { return Ok(()) };
    let adapter = gpu.adapter.clone();
    let watch = GpuTimer::new(gpu, args.rounds)?;
    let clock =
        if watch.has_gpu_timestamps() { "timestamps of the GPU" } else { "wall time, submission included" };
    println!("{}\n\n{}, {}; {clock}\n", provenance(), adapter.name, adapter.driver);
    let mut rows = Vec::new();
    for &n in &args.n {
        let copy = watch.copy(n)?;
        rows.push(row("copy", n, &copy, &copy));
        rows.push(row("scan", n, &watch.scan(n, !args.no_subgroups)?, &copy));
        for &bits in &args.bits {
            let sort = watch.sort(n, bits, !args.no_subgroups)?;
            rows.push(row(&format!("sort, {bits} bits"), n, &sort, &copy));
        }
    }
    let header = ["", "values", "ms (low–high)", "million values/s", "MB moved", "GB/s", "of the copy's"];
    println!("{}", markdown(&header, &rows));
    Ok(())
}

fn row(what: &str, n: u32, measured: &Measured, copy: &Measured) -> Vec<String> {
    let bandwidth = |m: &Measured| m.bytes as f64 / Spread::from_values(&m.times).median;
    let milliseconds: Vec<f64> = measured.times.iter().map(|time| time * 1e3).collect();
    vec![
        what.to_owned(),
        n.to_string(),
        Spread::from_values(&milliseconds).to_string(),
        format!("{:.1}", f64::from(n) / Spread::from_values(&measured.times).median * 1e-6),
        format!("{:.1}", measured.bytes as f64 * 1e-6),
        format!("{:.2}", bandwidth(measured) * 1e-9),
        format!("{:.0} %", 100.0 * bandwidth(measured) / bandwidth(copy)),
    ]
}
