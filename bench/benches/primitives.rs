//! Radix sort and prefix scan of the GPU engine beside what the device takes for a copy: pairs per second, bytes
//! moved, and the part of the copy's bandwidth that they use. Markdown on standard output.
//!
//! `cargo bench -p lazygrid-bench --bench primitives -- --n 1000000,10000000 --bits 24,25,32`
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::time::{Duration, Instant};

use clap::Parser;
use lazygrid::gpu::wgpu::{self, BufferUsages};
use lazygrid::gpu::{GpuDevice, PrefixScan, RadixSort, Sorted};
use lazygrid_bench::measure::{Spread, markdown, provenance};
use lazygrid_kernels::kernel::{DIGIT_BITS, WIDE_TILE};
use lazygrid_kernels::layout::Lengths;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

#[derive(Parser)]
#[command(about = "Radix sort and prefix scan against the copy bandwidth of the device")]
struct Args {
    /// Numbers of values, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [1_000_000, 10_000_000])]
    n: Vec<u32>,
    /// Key bits of the sort, separated by commas; whole passes of eight are made
    #[arg(long, value_delimiter = ',', default_values_t = [24, 25, 32])]
    bits: Vec<u32>,
    /// Rounds that count; one more comes first to warm up
    #[arg(long, default_value_t = 30)]
    rounds: usize,
    /// Without subgroup operations
    #[arg(long)]
    no_subgroups: bool,
    /// Check the answers at small sizes instead of measuring; also without `--bench`, which `cargo bench` passes
    #[arg(long)]
    quick: bool,
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = Args::parse();
    if args.quick || !args.bench {
        (args.n, args.rounds) = (vec![0, 1, 257, 20_000], 1);
    }
    let own = match GpuDevice::open(true) {
        Err(error @ lazygrid::Error::NoAdapter { .. })
            if std::env::var_os("LAZYGRID_REQUIRE_GPU").is_none() =>
        {
            println!("not run: {error}");
            return Ok(());
        }
        opened => opened?,
    };
    let bench = Bench::new(own, args.rounds);
    let clock =
        if bench.ticks.is_some() { "timestamps of the GPU" } else { "wall time, submission included" };
    println!("{}\n\n{}, {}; {clock}\n", provenance(), bench.own.adapter.name, bench.own.adapter.driver);
    let mut rows = Vec::new();
    for &n in &args.n {
        let copy = bench.copy(n)?;
        rows.push(row("copy", n, &copy, &copy));
        rows.push(row("scan", n, &bench.scan(n, !args.no_subgroups)?, &copy));
        for &bits in &args.bits {
            let sort = bench.sort(n, bits, !args.no_subgroups)?;
            rows.push(row(&format!("sort, {bits} bits"), n, &sort, &copy));
        }
    }
    let header = ["", "values", "ms (low–high)", "million values/s", "MB moved", "GB/s", "of the copy's"];
    println!("{}", markdown(&header, &rows));
    Ok(())
}

/// Times in seconds, and the bytes that each time was spent on.
struct Measured {
    times: Vec<f64>,
    bytes: u64,
}

fn row(what: &str, n: u32, measured: &Measured, copy: &Measured) -> Vec<String> {
    let bandwidth = |m: &Measured| m.bytes as f64 / Spread::of(&m.times).median;
    let milliseconds: Vec<f64> = measured.times.iter().map(|time| time * 1e3).collect();
    vec![
        what.to_owned(),
        n.to_string(),
        Spread::of(&milliseconds).to_string(),
        format!("{:.1}", f64::from(n) / Spread::of(&measured.times).median * 1e-6),
        format!("{:.1}", measured.bytes as f64 * 1e-6),
        format!("{:.2}", bandwidth(measured) * 1e-9),
        format!("{:.0} %", 100.0 * bandwidth(measured) / bandwidth(copy)),
    ]
}

struct Bench {
    own: GpuDevice,
    rounds: usize,
    /// Two timestamps and where they are resolved to, where the device has them.
    ticks: Option<(wgpu::QuerySet, wgpu::Buffer)>,
}

impl Bench {
    fn new(own: GpuDevice, rounds: usize) -> Self {
        let ticks = own.adapter.has_timestamps.then(|| {
            let queries = own.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: None,
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            });
            (queries, buffer(&own, 16, BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC))
        });
        Self { own, rounds, ticks }
    }

    /// A copy of what a sort reads and writes once: keys and payload.
    fn copy(&self, n: u32) -> Result<Measured, Box<dyn Error>> {
        let size = u64::from(n.max(2)) * 8;
        let [from, to] = [BufferUsages::COPY_SRC, BufferUsages::COPY_DST].map(|u| buffer(&self.own, size, u));
        let record = |encoder: &mut wgpu::CommandEncoder| {
            encoder.copy_buffer_to_buffer(&from, 0, &to, 0, size);
            Ok(())
        };
        Ok(Measured { times: self.times(|_| (), record)?, bytes: 2 * size })
    }

    /// Reads every value twice and writes it once.
    fn scan(&self, n: u32, subgroups: bool) -> Result<Measured, Box<dyn Error>> {
        let values = random(n);
        let (fresh, work) = (self.filled(&values), self.room(n));
        let mut scan = PrefixScan::new(&self.own.device, subgroups);
        let renew = |encoder: &mut wgpu::CommandEncoder| copy_all(encoder, &fresh, &work);
        let times = self.times(renew, |encoder| scan.encode(encoder, &work, n).map(drop))?;
        let mut sum = 0_u32;
        let expected = values.iter().map(|value| {
            let before = sum;
            sum = sum.wrapping_add(*value);
            before
        });
        if !expected.eq(self.read(&work, n)?) {
            return Err(format!("the scan of {n} values is wrong").into());
        }
        Ok(Measured { times, bytes: 12 * u64::from(n) })
    }

    /// Every pass counts the keys, scans the counters, and moves keys and payload.
    fn sort(&self, n: u32, bits: u32, subgroups: bool) -> Result<Measured, Box<dyn Error>> {
        let (keys, payload) = (random(n), (0..n).collect::<Vec<_>>());
        let fresh = [&keys, &payload].map(|values| self.filled(values));
        let work = Sorted { keys: self.room(n), payload: self.room(n) };
        let mut sort = RadixSort::new(&self.own.device, subgroups);
        let mut sorted = None;
        let renew = |encoder: &mut wgpu::CommandEncoder| {
            copy_all(encoder, &fresh[0], &work.keys);
            copy_all(encoder, &fresh[1], &work.payload);
        };
        let times = self.times(renew, |encoder| {
            sorted = Some(sort.encode(encoder, &work, n, bits)?);
            Ok(())
        })?;
        let mask = u32::MAX >> (32 - bits);
        let mut expected = payload;
        expected.sort_by_key(|&at| keys[at as usize] & mask);
        let found = sorted.map(|sorted| self.read(&sorted.payload, n)).transpose()?;
        if found.as_ref() != Some(&expected) {
            return Err(format!("the sort of {n} keys by {bits} bits is wrong").into());
        }
        // Keys counted, moved with their payload, and a counter per digit and tile written, scanned and read.
        let a_pass = 20 * u64::from(n) + 16 * u64::from(Lengths::for_sort(n, WIDE_TILE).counters);
        Ok(Measured { times, bytes: u64::from(bits.div_ceil(DIGIT_BITS)) * a_pass })
    }

    /// Seconds of each round: `prepare` is recorded before what is timed.
    fn times(
        &self,
        prepare: impl Fn(&mut wgpu::CommandEncoder),
        mut record: impl FnMut(&mut wgpu::CommandEncoder) -> Result<(), lazygrid::Error>,
    ) -> Result<Vec<f64>, Box<dyn Error>> {
        let mut times = Vec::new();
        for _ in 0..=self.rounds {
            let mut encoder = self.own.device.create_command_encoder(&Default::default());
            prepare(&mut encoder);
            let start = match &self.ticks {
                None => {
                    self.run(encoder)?;
                    encoder = self.own.device.create_command_encoder(&Default::default());
                    record(&mut encoder)?;
                    Instant::now()
                }
                Some((queries, ticks)) => {
                    stamp(&mut encoder, queries, 0);
                    record(&mut encoder)?;
                    stamp(&mut encoder, queries, 1);
                    encoder.resolve_query_set(queries, 0..2, ticks, 0);
                    Instant::now()
                }
            };
            self.run(encoder)?;
            times.push(match &self.ticks {
                None => start.elapsed().as_secs_f64(),
                Some((_, ticks)) => {
                    let words = self.read(ticks, 4)?;
                    let tick = |at: usize| u64::from(words[at + 1]) << 32 | u64::from(words[at]);
                    let period = f64::from(self.own.queue.get_timestamp_period()) * 1e-9;
                    tick(2).saturating_sub(tick(0)) as f64 * period
                }
            });
        }
        Ok(times.split_off(1))
    }

    fn run(&self, encoder: wgpu::CommandEncoder) -> Result<(), Box<dyn Error>> {
        let submission = self.own.queue.submit([encoder.finish()]);
        self.wait(Some(submission))
    }

    fn wait(&self, submission_index: Option<wgpu::SubmissionIndex>) -> Result<(), Box<dyn Error>> {
        let timeout = Some(Duration::from_secs(600));
        self.own.device.poll(wgpu::PollType::Wait { submission_index, timeout })?;
        Ok(())
    }

    fn filled(&self, values: &[u32]) -> wgpu::Buffer {
        let fresh =
            buffer(&self.own, values.len() as u64 * 4, BufferUsages::COPY_SRC | BufferUsages::COPY_DST);
        self.own.queue.write_buffer(&fresh, 0, bytemuck::cast_slice(values));
        fresh
    }

    fn room(&self, n: u32) -> wgpu::Buffer {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        buffer(&self.own, u64::from(n) * 4, usage)
    }

    fn read(&self, from: &wgpu::Buffer, n: u32) -> Result<Vec<u32>, Box<dyn Error>> {
        let size = u64::from(n) * 4;
        let staging = buffer(&self.own, size, BufferUsages::MAP_READ | BufferUsages::COPY_DST);
        let mut encoder = self.own.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(from, 0, &staging, 0, size);
        self.own.queue.submit([encoder.finish()]);
        staging.slice(..).map_async(wgpu::MapMode::Read, |_| ());
        self.wait(None)?;
        let view = staging.slice(..).get_mapped_range()?;
        Ok(bytemuck::pod_collect_to_vec(&view[..size as usize]))
    }
}

fn buffer(own: &GpuDevice, size: u64, usage: BufferUsages) -> wgpu::Buffer {
    let size = size.max(16);
    own.device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
}

/// A pass without work whose beginning waits for all that was recorded before.
fn stamp(encoder: &mut wgpu::CommandEncoder, queries: &wgpu::QuerySet, at: u32) {
    let writes = wgpu::ComputePassTimestampWrites {
        query_set: queries,
        beginning_of_pass_write_index: Some(at),
        end_of_pass_write_index: None,
    };
    encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes: Some(writes) });
}

fn copy_all(encoder: &mut wgpu::CommandEncoder, from: &wgpu::Buffer, to: &wgpu::Buffer) {
    encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size().min(to.size()));
}

fn random(n: u32) -> Vec<u32> {
    let mut rng = ChaCha8Rng::seed_from_u64(n.into());
    (0..n).map(|_| rng.next_u32()).collect()
}
