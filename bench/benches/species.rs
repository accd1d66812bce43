//! Spheres with and without a table of interactions.

use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use lazygrid::{Backend, Config, Detector, Skin, Spheres, gpu};
use lazygrid_bench::SpeciesScene;

const SIZES: [usize; 2] = [20_000, 80_000];

fn species(criterion: &mut Criterion) {
    let backends =
        if gpu::adapters().is_empty() { &[Backend::Cpu][..] } else { &[Backend::Cpu, Backend::Gpu] };
    for &backend in backends {
        // Spheres at rest would never rebuild a candidate list.
        let config = Config::default().backend(backend).skin(Skin::Off);
        for (scene, n) in SpeciesScene::ALL.into_iter().flat_map(|scene| SIZES.map(|n| (scene, n))) {
            let mut group = criterion.benchmark_group(format!("{backend}/{}/{n}", scene.name()));
            group.sample_size(10).throughput(Throughput::Elements(n as u64));
            let (all, ids) = (scene.spheres(n, 1), scene.species(n));
            let table = scene.table().expect("few species");
            let mut plain = Detector::new(config.clone()).expect("a backend");
            let mut by_species = Detector::new(config.clone().interactions(table)).expect("a backend");
            let spheres = Spheres::from(&all);
            let with_species = spheres.with_species(&ids).expect("one of each");
            group.bench_function("table", |b| {
                b.iter(|| by_species.count(with_species).expect("valid spheres"));
            });
            if scene.is_of_two_sets() {
                let (first, second): (Vec<_>, Vec<_>) =
                    all.iter().zip(&ids).partition(|(_, species)| **species == 0);
                let [first, second] =
                    [first, second].map(|set| set.into_iter().map(|(s, _)| *s).collect::<Vec<_>>());
                group.bench_function("two sets", |b| {
                    b.iter(|| plain.count((&first, &second)).expect("valid spheres"));
                });
            } else {
                group.bench_function("no table", |b| b.iter(|| plain.count(spheres).expect("valid spheres")));
            }
            group.finish();
        }
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1));
    targets = species
}
criterion_main!(benches);
