//! Each phase of each algorithm, and each kind of result, by scene.
//!
//! `cargo bench -p lazygrid-bench --bench stages -- cell-list/burst/stage/sort`

use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use lazygrid::{Algorithm, Backend, Config, Detector, Order, Skin, Sphere, gpu};
use lazygrid_io::scenes::Scene;

/// Number of spheres, for which even slow algorithms take only milliseconds.
const N: usize = 5_000;
const SEED: u64 = 1;

fn algorithms(criterion: &mut Criterion) {
    let on_cpu = Algorithm::CPU.iter().map(|&algorithm| (Backend::Cpu, algorithm));
    let gpus = if gpu::adapters().is_empty() { &[] } else { Algorithm::GPU };
    let on_gpu = gpus.iter().map(|&algorithm| (Backend::Gpu, algorithm));
    for (backend, algorithm) in on_cpu.chain(on_gpu) {
        let name = match backend {
            Backend::Gpu => format!("{algorithm} on the GPU"),
            _ => algorithm.to_string(),
        };
        // Spheres at rest would never rebuild a candidate list.
        let config = Config::default().backend(backend).algorithm(algorithm).skin(Skin::Off);
        for scene in [Scene::Equal, Scene::FiveSizes, Scene::Burst, Scene::BurstLinear] {
            let spheres = scene.spheres(N, SEED);
            let mut group = criterion.benchmark_group(format!("{name}/{scene}"));
            group.sample_size(20).throughput(Throughput::Elements(N as u64));
            stages(&mut group, &config, &spheres);
            results(&mut group, &config, &spheres);
            group.finish();
        }
    }
}

fn detector(config: &Config) -> Detector {
    Detector::new(config.clone()).expect("an algorithm of its backend")
}

fn stages(group: &mut BenchmarkGroup<'_, WallTime>, config: &Config, spheres: &[Sphere]) {
    let mut detector = detector(config);
    detector.pairs(spheres).expect("valid spheres");
    let names: Vec<&str> = detector.report().phases.iter().map(|phase| phase.name).collect();
    for name in names {
        group.bench_function(BenchmarkId::new("stage", name), |b| {
            b.iter_custom(|calls| {
                let of_one_call = |_| {
                    detector.pairs(spheres).expect("valid spheres");
                    let report = detector.report();
                    let phase = report.phases.iter().find(|phase| phase.name == name);
                    phase.map_or(Duration::ZERO, |phase| phase.time)
                };
                (0..calls).map(of_one_call).sum()
            });
        });
    }
}

fn results(group: &mut BenchmarkGroup<'_, WallTime>, config: &Config, spheres: &[Sphere]) {
    let mut ordered = detector(config);
    let mut unordered = detector(&config.clone().order(Order::Unordered));
    group.bench_function("pairs", |b| b.iter(|| ordered.pairs(spheres).expect("valid spheres").len()));
    group.bench_function("pairs-unordered", |b| {
        b.iter(|| unordered.pairs(spheres).expect("valid spheres").len());
    });
    group.bench_function("count", |b| b.iter(|| ordered.count(spheres).expect("valid spheres")));
    group.bench_function("neighbors", |b| {
        b.iter(|| {
            ordered.neighbors(spheres).expect("valid spheres");
        });
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1));
    targets = algorithms
}
criterion_main!(benches);
