//! A cell list at each step compared with candidate lists, on spheres in GPU memory.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::time::Instant;

use clap::Parser;
use lazygrid::gpu::{
    GpuConfig, GpuDetector, GpuDevice, GpuOutput, GpuSkinDetector, GpuSpheres, Outcome, wgpu,
};
use lazygrid::{Algorithm, Sphere};
use lazygrid_bench::measure::{QuickMode, markdown, provenance};
use lazygrid_check::device::{download, submit, upload, wait};
use lazygrid_io::scenes::Scene;

#[derive(Parser)]
#[command(about = "Candidate lists on the GPU compared with a cell list at each step")]
struct Args {
    /// Scenes, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [Scene::Equal, Scene::FiveSizes])]
    scene: Vec<Scene>,
    /// Numbers of spheres, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [100_000])]
    n: Vec<usize>,
    /// Displacements of spheres per step, in radii, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [0.001, 0.01, 0.1])]
    step_length: Vec<f32>,
    /// Skins as fractions of the largest diameter, separated by commas
    #[arg(long, value_delimiter = ',', default_values_t = [0.125, 0.25, 0.5])]
    skin: Vec<f32>,
    /// Steps, after one to warm up
    #[arg(long, default_value_t = 30)]
    steps: u32,
    #[command(flatten)]
    mode: QuickMode,
}

enum TimedDetector {
    EachStep(Box<GpuDetector>),
    Candidates(Box<GpuSkinDetector>),
}

impl TimedDetector {
    fn encode(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        input: &GpuSpheres<'_>,
    ) -> Result<GpuOutput, lazygrid::Error> {
        match self {
            Self::EachStep(detector) => detector.encode(encoder, input),
            Self::Candidates(detector) => detector.encode(encoder, input),
        }
    }

    fn step(&mut self, gpu: &GpuDevice, input: &GpuSpheres<'_>) -> Result<(f64, u64), Box<dyn Error>> {
        let start = Instant::now();
        let found = submit(gpu, |encoder| self.encode(encoder, input))?;
        wait(gpu)?;
        let seconds = start.elapsed().as_secs_f64();
        let outcome = download::<Outcome>(gpu, &found.outcome, 1)?[0];
        match outcome.overflow {
            0 => Ok((seconds, outcome.found())),
            _ => Err(format!("buffers are too small: {outcome:?}").into()),
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = Args::parse();
    if args.mode.is_quick() {
        (args.n, args.steps) = (vec![300], 4);
    }
    let Some(gpu) = lazygrid_tests::device() else { return Ok(()) };
    println!("{}\n\n{}\n", provenance(), gpu.adapter.name);
    let mut rows = Vec::new();
    for (&scene, &n) in args.scene.iter().flat_map(|scene| args.n.iter().map(move |n| (scene, n))) {
        for &step_length in &args.step_length {
            let seconds = compare(&gpu, &args, scene, n, step_length)?;
            let per_sphere = |s: &f64| format!("{:.1} ({:.2})", s / n as f64 * 1e9, s / seconds[0]);
            let head = [scene.to_string(), n.to_string(), step_length.to_string()];
            rows.push(head.into_iter().chain(seconds.iter().map(per_sphere)).collect());
        }
    }
    let skins = args.skin.iter().map(|fraction| format!("skin {fraction}"));
    let head: Vec<String> = ["scene", "spheres", "step in radii", "every step"]
        .map(str::to_owned)
        .into_iter()
        .chain(skins)
        .collect();
    println!("Nanoseconds per sphere and step, and as a fraction of a search at every step\n");
    println!("{}", markdown(&head.iter().map(String::as_str).collect::<Vec<_>>(), &rows));
    Ok(())
}

fn compare(
    gpu: &GpuDevice,
    args: &Args,
    scene: Scene,
    n: usize,
    step_length: f32,
) -> Result<Vec<f64>, Box<dyn Error>> {
    let mut spheres = scene.spheres(n, 1);
    let settings =
        || GpuConfig::default().algorithm(Algorithm::CellList).pair_capacity((4 * n as u32).max(1 << 20));
    let mut runners = vec![TimedDetector::EachStep(Box::new(GpuDetector::new(&gpu.device, settings())?))];
    for fraction in &args.skin {
        runners.push(TimedDetector::Candidates(Box::new(GpuSkinDetector::new(
            &gpu.device,
            settings(),
            2.0 * fraction,
        )?)));
    }
    let mut sums = vec![0.0; runners.len()];
    for step in 0..=args.steps {
        let buffer = upload::<Sphere>(gpu, &spheres)?;
        // The queue writes with the next submission, which would be the first detector's.
        submit(gpu, |_| Ok(()))?;
        wait(gpu)?;
        let input = GpuSpheres::new(&buffer, n as u32);
        let mut found = None;
        for (runner, sum) in runners.iter_mut().zip(&mut sums) {
            let (seconds, pairs) = runner.step(gpu, &input)?;
            if *found.get_or_insert(pairs) != pairs {
                return Err(format!("{pairs} pairs at step {step}, not {found:?}").into());
            }
            *sum += if step == 0 { 0.0 } else { seconds };
        }
        Scene::advance_by(step_length, &mut spheres, 1, step);
    }
    Ok(sums.into_iter().map(|sum| sum / f64::from(args.steps)).collect())
}
