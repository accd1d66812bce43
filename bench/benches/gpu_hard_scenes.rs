//! The GPU cell list in hard scenes, by GPU timestamps per phase.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::time::Duration;

use clap::Parser;
use lazygrid::gpu::{Calibration, GpuConfig, GpuDevice, GpuPhase, GpuSession};
use lazygrid::{Algorithm, Sphere, Spheres};
use lazygrid_bench::measure::{QuickMode, markdown, provenance};
use lazygrid_io::scenes::Scene;

#[derive(Parser)]
#[command(about = "The GPU cell list in scenes that are hard on grids")]
struct Args {
    /// Number of spheres of each scene
    #[arg(long, default_value_t = 1_000_000)]
    n: usize,
    /// Number of spheres of the burst
    #[arg(long, default_value_t = 100_000)]
    burst: usize,
    /// Radius of the giant over that of the others
    #[arg(long, default_value_t = 100.0)]
    giant: f32,
    /// Distance of the two clumps in diameters
    #[arg(long, default_value_t = 1e6)]
    gap: f32,
    /// Algorithm to compare with, in scenes without giant or gap
    #[arg(long)]
    baseline: Option<Algorithm>,
    /// Thresholds of the cell list's radix sort, in spheres, separated by commas; measured alternately
    #[arg(long, value_delimiter = ',', default_values_t = [Calibration::RADIX_SORT_FROM])]
    radix_from: Vec<u32>,
    /// Only the scenes of equal and of five sizes
    #[arg(long)]
    uniform_only: bool,
    /// Rounds, after one to warm up
    #[arg(long, default_value_t = 5)]
    rounds: usize,
    #[command(flatten)]
    mode: QuickMode,
}

struct BenchScene {
    name: &'static str,
    spheres: Vec<Sphere>,
    is_uniform: bool,
}

struct SceneRun<'a> {
    scene: &'a BenchScene,
    algorithm: Algorithm,
    sort: &'static str,
    session: GpuSession,
    pairs: u64,
    stages: Vec<Vec<Duration>>,
}

impl SceneRun<'_> {
    fn run(&mut self, is_warm: bool) -> Result<(), Box<dyn Error>> {
        let ticket = self.session.begin(Spheres::from(&self.scene.spheres))?;
        self.pairs = self.session.finish_count(ticket)?;
        if is_warm {
            let timing_of = |phase: &GpuPhase| self.session.timings().iter().find(|t| t.name == phase.name());
            let time_of = |phase| timing_of(phase).map_or(Duration::ZERO, |timing| timing.time);
            self.stages.push(GpuPhase::ALL.iter().map(time_of).collect());
        }
        Ok(())
    }

    fn median(&self) -> Vec<f64> {
        let mut stages = self.stages.clone();
        stages.sort_by_key(|stages| stages.iter().sum::<Duration>());
        stages[stages.len() / 2].iter().map(Duration::as_secs_f64).collect()
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = Args::parse();
    if args.mode.is_quick() {
        (args.n, args.burst, args.giant, args.rounds) = (2000, 500, 4.0, 1);
        args.baseline = Some(Algorithm::LazyGrid);
    }
    let Some(gpu) = lazygrid_tests::device() else { return Ok(()) };
    println!("{}\n\n{}\n", provenance(), gpu.adapter.name);
    let mut scenes = scenes(&args);
    scenes.truncate(if args.uniform_only { 2 } else { scenes.len() });
    let mut runners = Vec::new();
    for scene in &scenes {
        for &radix_from in &args.radix_from {
            runners.push(runner(&gpu, scene, Algorithm::CellList, radix_from)?);
        }
        if let Some(other) = args.baseline.filter(|_| scene.is_uniform) {
            runners.push(runner(&gpu, scene, other, Calibration::RADIX_SORT_FROM)?);
        }
    }
    for round in 0..=args.rounds {
        for runner in &mut runners {
            runner.run(round > 0)?;
        }
        for (a, b) in runners.iter().zip(&runners[1..]) {
            // GPUs may decide pairs within 4 ulp of tangency differently.
            if std::ptr::eq(a.scene, b.scene) && a.pairs.abs_diff(b.pairs) > 1 + a.pairs / 100_000 {
                let (a, b, name) = (a.pairs, b.pairs, a.scene.name);
                return Err(format!("{a} pairs and {b} in {name}").into());
            }
        }
    }
    println!("{}", table(&runners));
    Ok(())
}

fn runner<'a>(
    gpu: &GpuDevice,
    scene: &'a BenchScene,
    algorithm: Algorithm,
    radix_from: u32,
) -> Result<SceneRun<'a>, Box<dyn Error>> {
    let pair_capacity = if scene.name == "burst" { 24 } else { 4 } * scene.spheres.len() as u32;
    let settings = GpuConfig::default()
        .algorithm(algorithm)
        .pair_capacity(pair_capacity)
        .radix_sort_from(radix_from)
        .timestamps(true);
    let session = GpuSession::new(gpu.clone(), settings)?;
    let is_counted = algorithm == Algorithm::CellList && scene.spheres.len() < radix_from as usize;
    let sort = if is_counted { "by counting" } else { "by radix" };
    Ok(SceneRun { scene, algorithm, sort, session, pairs: 0, stages: Vec::new() })
}

fn scenes(args: &Args) -> Vec<BenchScene> {
    let equal = Scene::Equal.spheres(args.n, 1);
    let mut giant = equal.clone();
    if let Some(sphere) = giant.first_mut() {
        *sphere = Sphere::new([0.0; 3], args.giant);
    }
    let mut clumps = Scene::Equal.spheres(args.n / 2, 1);
    let far = |sphere: &Sphere| Sphere { center: sphere.center + glam::Vec3::X * 2.0 * args.gap, ..*sphere };
    let there: Vec<_> = Scene::Equal.spheres(args.n - args.n / 2, 2).iter().map(far).collect();
    clumps.extend(there);
    let bench_scene = |name, spheres, is_uniform| BenchScene { name, spheres, is_uniform };
    vec![
        bench_scene("equal", equal, true),
        bench_scene("five sizes", Scene::FiveSizes.spheres(args.n, 1), true),
        bench_scene("one giant", giant, false),
        bench_scene("two clumps", clumps, false),
        bench_scene("burst", Scene::Burst.spheres(args.burst, 1), true),
    ]
}

fn table(runners: &[SceneRun<'_>]) -> String {
    let sum = |runner: &SceneRun<'_>| runner.median().iter().sum::<f64>();
    let rows: Vec<Vec<String>> = runners
        .iter()
        .map(|runner| {
            let stages = runner.median().into_iter().map(|seconds| format!("{:.1}", seconds * 1e3));
            let is_cell_list = runner.algorithm == Algorithm::CellList;
            let same = |other: &&SceneRun<'_>| is_cell_list && std::ptr::eq(other.scene, runner.scene);
            let other = runners.iter().filter(same).find(|other| other.algorithm != Algorithm::CellList);
            let is_base =
                |base: &&SceneRun<'_>| base.algorithm == runner.algorithm && base.sort == runner.sort;
            let has_same_size = |base: &&SceneRun<'_>| base.scene.spheres.len() == runner.scene.spheres.len();
            let base = runners.iter().find(is_base).filter(|_| is_cell_list).filter(has_same_size);
            let ratio = |ratio: Option<f64>| ratio.map_or(String::new(), |ratio| format!("{ratio:.2}"));
            [runner.scene.name.to_owned(), runner.scene.spheres.len().to_string()]
                .into_iter()
                .chain([format!("{} {}", runner.algorithm, runner.sort), runner.pairs.to_string()])
                .chain(stages)
                .chain([format!("{:.1}", sum(runner) * 1e3)])
                .chain([ratio(base.map(|base| sum(runner) / sum(base)))])
                .chain([ratio(other.map(|other| sum(other) / sum(runner)))])
                .collect()
        })
        .collect();
    let stages: Vec<_> = GpuPhase::ALL.iter().map(|phase| format!("{}, ms", phase.name())).collect();
    let head: Vec<&str> = ["scene", "spheres", "algorithm", "pairs"]
        .into_iter()
        .chain(stages.iter().map(String::as_str))
        .chain(["all, ms", "time / time of equal", "time of baseline / time"])
        .collect();
    markdown(&head, &rows)
}
