//! Small benchmarks for whoever changes a detector: every algorithm, scene and kind of result.
//!
//! `cargo bench -p lazygrid-bench --bench stages -- cell-list/burst`

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use lazygrid::{Algorithm, Backend, Config, Detector, Order};
use lazygrid_bench::scenes::Scene;

/// Few enough that one call is a matter of milliseconds even for the slow algorithms.
const N: usize = 5_000;
const SEED: u64 = 1;

fn stages(criterion: &mut Criterion) {
    for algorithm in Algorithm::CPU {
        for scene in [Scene::Equal, Scene::FiveSizes, Scene::Burst, Scene::BurstLinear] {
            let spheres = scene.spheres(N, SEED);
            let config = Config::default().backend(Backend::Cpu).algorithm(algorithm);
            let mut ordered = Detector::new(config.clone()).expect("a CPU algorithm");
            let mut unordered = Detector::new(config.order(Order::Unordered)).expect("a CPU algorithm");

            let mut group = criterion.benchmark_group(format!("{algorithm}/{scene}"));
            group.sample_size(20).throughput(Throughput::Elements(N as u64));
            group.bench_function(BenchmarkId::new("pairs", N), |b| {
                b.iter(|| ordered.pairs(&spheres).expect("valid spheres").len());
            });
            group.bench_function(BenchmarkId::new("pairs-unordered", N), |b| {
                b.iter(|| unordered.pairs(&spheres).expect("valid spheres").len());
            });
            group.bench_function(BenchmarkId::new("count", N), |b| {
                b.iter(|| ordered.count(&spheres).expect("valid spheres"));
            });
            group.bench_function(BenchmarkId::new("neighbors", N), |b| {
                b.iter(|| {
                    ordered.neighbors(&spheres).expect("valid spheres");
                });
            });
            group.finish();
        }
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(std::time::Duration::from_millis(300))
        .measurement_time(std::time::Duration::from_secs(1));
    targets = stages
}
criterion_main!(benches);
