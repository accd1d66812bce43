//! Compares three CPU algorithms with the GPU's cell list in dense scenes. Fails at the first frame with different
//! pairs.
//!
//! Coordinates and radii are multiples of 1/2048 of the largest cutoff, so `f32` is exact near a cutoff.
//!
//! ```sh
//! cargo run --release -p lazygrid-check --example cross_check -- 1e10
//! ```
#![expect(clippy::print_stdout, reason = "the output of a program")]

use std::error::Error;
use std::ops::ControlFlow;

use lazygrid::{Algorithm, Backend, Config, Detector, Order, Skin, Sphere};
use lazygrid_check::checksum;
use lazygrid_io::scenes::Scene;

const CHUNK: usize = 1 << 22;
const SPHERES: usize = 100_000;
/// The GPU omits scenes with more pairs: a software adapter takes a microsecond per pair.
const MAX_GPU_PAIRS: u64 = 1 << 22;
const DENSITIES: [f32; 3] = [1.0, 0.5, 0.2];

fn rounded(spheres: &[Sphere], density: f32) -> Vec<Sphere> {
    let largest = spheres.iter().map(|sphere| sphere.radius).fold(0.0, f32::max);
    let step = 2.0 * largest / 2048.0;
    let round = |x: f32| (x / step).round() * step;
    spheres
        .iter()
        .map(|sphere| Sphere::new(sphere.center.to_array().map(|x| round(x * density)), round(sphere.radius)))
        .collect()
}

fn digest(detector: &mut Detector, spheres: &[Sphere]) -> Result<(u64, u64), Box<dyn Error>> {
    let mut sum = 0_u64;
    let pairs = detector.stream(spheres, CHUNK, |pairs| {
        sum = sum.wrapping_add(checksum(pairs));
        ControlFlow::Continue(())
    })?;
    Ok((pairs, sum))
}

fn main() -> Result<(), Box<dyn Error>> {
    let wanted: f64 = std::env::args().nth(1).as_deref().unwrap_or("1e8").parse()?;
    let cpu = [Algorithm::CellList, Algorithm::RecursiveGrid, Algorithm::HashGrid].map(|a| (Backend::Cpu, a));
    let mut detectors = Vec::new();
    for (backend, algorithm) in cpu.into_iter().chain([(Backend::Gpu, Algorithm::CellList)]) {
        let config = Config::default().backend(backend).algorithm(algorithm);
        let config = config.order(Order::Unordered).skin(Skin::Off);
        detectors.push((backend, algorithm, Detector::new(config)?));
    }
    let (mut frame, mut pairs, mut on_gpu) = (0_u64, 0_u64, 0_u64);
    while (pairs as f64) < wanted {
        let density = DENSITIES[frame as usize % DENSITIES.len()];
        for scene in [Scene::Equal, Scene::FiveSizes, Scene::Burst, Scene::BurstLinear] {
            let spheres = rounded(&scene.spheres(SPHERES, frame), density);
            let mut expected = None;
            for (backend, algorithm, detector) in &mut detectors {
                let count = expected.map_or(0, |(count, _)| count);
                if *backend == Backend::Gpu && count > MAX_GPU_PAIRS {
                    continue;
                }
                let found = digest(detector, &spheres)?;
                if *expected.get_or_insert(found) != found {
                    let other = format!("{found:?}, the first algorithm {expected:?}");
                    return Err(format!("frame {frame}, {scene}: {backend} {algorithm} found {other}").into());
                }
                on_gpu += if *backend == Backend::Gpu { count } else { 0 };
            }
            pairs += expected.map_or(0, |(count, _)| count);
        }
        frame += 1;
        println!("equal in {frame} frames of 4 scenes: {pairs} pairs, {on_gpu} of them on the GPU too");
    }
    Ok(())
}
