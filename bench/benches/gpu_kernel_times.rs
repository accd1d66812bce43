//! GPU time of each kernel and of the whole call, by timestamps.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::time::Instant;

use clap::Parser;
use lazygrid::gpu::{GpuConfig, GpuDetector, GpuDevice, GpuSpheres, Outcome, wgpu};
use lazygrid::{Algorithm, Sphere};
use lazygrid_bench::measure::{QuickMode, markdown, provenance};
use lazygrid_check::device::{download, submit, upload, wait};
use lazygrid_check::timing::bandwidth::{median, stamp, warm_up};
use lazygrid_io::scenes::Scene;

#[derive(Parser)]
#[command(about = "GPU time of each kernel of a call")]
struct Args {
    /// Scenes, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [Scene::Equal, Scene::FiveSizes])]
    scene: Vec<Scene>,
    /// Numbers of spheres, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [10_000, 100_000, 1_000_000, 10_000_000])]
    n: Vec<usize>,
    /// Algorithms, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [Algorithm::CellList])]
    algorithm: Vec<Algorithm>,
    /// Rounds, after some to warm up
    #[arg(long, default_value_t = 15)]
    rounds: usize,
    /// Only whole calls, without a table of kernels
    #[arg(long)]
    calls_only: bool,
    #[command(flatten)]
    mode: QuickMode,
}

/// Maximum number of calls until all capacities suffice.
const MAX_CAPACITY_CALLS: usize = 6;

struct TimedCall<'a> {
    gpu: &'a GpuDevice,
    detector: GpuDetector,
    input: GpuSpheres<'a>,
    queries: wgpu::QuerySet,
    ticks: wgpu::Buffer,
    pairs: u64,
}

impl<'a> TimedCall<'a> {
    fn new(
        gpu: &'a GpuDevice,
        algorithm: Algorithm,
        buffer: &'a wgpu::Buffer,
        n: u32,
    ) -> Result<Self, Box<dyn Error>> {
        let settings = GpuConfig::default().algorithm(algorithm).pair_capacity(n.max(1 << 20));
        let mut detector = GpuDetector::new(&gpu.device, settings)?;
        let input = GpuSpheres::new(buffer, n);
        let mut found = None;
        for _ in 0..MAX_CAPACITY_CALLS {
            let output = submit(gpu, |encoder| detector.encode(encoder, &input))?;
            let outcome = download::<Outcome>(gpu, &output.outcome, 1)?[0];
            match outcome.overflow {
                0 => {
                    found = Some(outcome.found());
                    break;
                }
                Outcome::OVERFLOW_WORK => {
                    detector.set_deferred_parts(detector.needed_deferred_parts(&outcome))
                }
                _ => {
                    detector.set_pair_capacity(u32::try_from(outcome.found())?.max(detector.pair_capacity()));
                    detector.set_entry_capacity(outcome.entries_needed());
                }
            }
        }
        let pairs = found.ok_or("capacities do not suffice")?;
        let count = detector.kernels().len() as u32 + 1;
        let (queries, ticks) = gpu.with_error_scope("timestamps", 0, || {
            let queries = wgpu::QuerySetDescriptor { label: None, ty: wgpu::QueryType::Timestamp, count };
            let ticks = wgpu::BufferDescriptor {
                label: None,
                size: u64::from(count) * 8,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            };
            (gpu.device.create_query_set(&queries), gpu.device.create_buffer(&ticks))
        })?;
        Ok(Self { gpu, detector, input, queries, ticks, pairs })
    }

    fn seconds(
        &self,
        count: u32,
        record: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> Result<Vec<f64>, Box<dyn Error>> {
        submit(self.gpu, |encoder| {
            record(encoder);
            encoder.resolve_query_set(&self.queries, 0..count, &self.ticks, 0);
            Ok(())
        })?;
        let ticks = download::<u64>(self.gpu, &self.ticks, count as usize)?;
        let period = f64::from(self.gpu.queue.get_timestamp_period()) * 1e-9;
        Ok(ticks.windows(2).map(|ends| ends[1].saturating_sub(ends[0]) as f64 * period).collect())
    }

    fn whole(&mut self) -> Result<f64, Box<dyn Error>> {
        self.detector.bind(&self.input)?;
        let seconds = self.seconds(2, |encoder| {
            stamp(encoder, &self.queries, 0);
            (0..self.detector.parts()).for_each(|part| self.detector.encode_part(encoder, part));
            stamp(encoder, &self.queries, 1);
        })?;
        Ok(seconds[0])
    }

    fn until_completion(&mut self) -> Result<f64, Box<dyn Error>> {
        let start = Instant::now();
        submit(self.gpu, |encoder| self.detector.encode(encoder, &self.input))?;
        wait(self.gpu)?;
        Ok(start.elapsed().as_secs_f64())
    }

    fn kernels(&self) -> Result<Vec<f64>, Box<dyn Error>> {
        let count = self.detector.kernels().len() as u32 + 1;
        self.seconds(count, |encoder| self.detector.encode_stamped(encoder, &self.queries))
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = Args::parse();
    if args.mode.is_quick() {
        (args.n, args.rounds) = (vec![300, 3000], 1);
        args.algorithm = Algorithm::GPU.to_vec();
    }
    let Some(gpu) = lazygrid_tests::device() else { return Ok(()) };
    println!("{}\n\n{}, {}\n", provenance(), gpu.adapter.name, gpu.adapter.driver);
    let has_stamps_inside = gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES);
    if !has_stamps_inside {
        println!("SKIPPED: the device has no timestamps inside passes");
        return Ok(());
    }
    let mut calls = Vec::new();
    for (&scene, &n) in args.scene.iter().flat_map(|scene| args.n.iter().map(move |n| (scene, n))) {
        let spheres = scene.spheres(n, 1);
        let buffer = upload::<Sphere>(&gpu, &spheres)?;
        for &algorithm in &args.algorithm {
            let name = format!("{scene}, {n} spheres, {algorithm}");
            let call = TimedCall::new(&gpu, algorithm, &buffer, n as u32);
            match call.and_then(|call| measure(&args, &name, n, call)) {
                Ok(row) => calls.push(row),
                Err(error) => println!("{name}: {error}\n"),
            }
        }
    }
    let head = ["call", "pairs", "dispatches", "GPU, µs", "until completion, µs", "ns per sphere"];
    println!("{}", markdown(&head, &calls));
    Ok(())
}

fn measure(
    args: &Args,
    name: &str,
    n: usize,
    mut call: TimedCall<'_>,
) -> Result<Vec<String>, Box<dyn Error>> {
    let names = call.detector.kernels();
    let (mut whole, mut waits, mut kernels) = (vec![], vec![], vec![vec![]; names.len()]);
    let start = Instant::now();
    while !args.mode.is_quick() && start.elapsed() < warm_up(call.gpu) {
        call.whole()?;
    }
    for _ in 0..args.rounds {
        whole.push(call.whole()?);
        waits.push(call.until_completion()?);
        if !args.calls_only {
            kernels.iter_mut().zip(call.kernels()?).for_each(|(kernel, seconds)| kernel.push(seconds));
        }
    }
    let micros = |times: &[f64]| median(times) * 1e6;
    if !args.calls_only {
        let rows: Vec<_> = names
            .iter()
            .zip(&kernels)
            .map(|(kernel, times)| vec![(*kernel).to_owned(), format!("{:.1}", micros(times))])
            .collect();
        println!("{name}\n\n{}", markdown(&["kernel", "µs"], &rows));
    }
    let gpu = micros(&whole);
    Ok(vec![
        name.to_owned(),
        call.pairs.to_string(),
        names.len().to_string(),
        format!("{gpu:.1}"),
        format!("{:.1}", micros(&waits)),
        format!("{:.3}", gpu * 1e3 / n as f64),
    ])
}
