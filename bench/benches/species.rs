//! Species that seldom or never pair, and two sets: with a table of interactions and without one, on the CPU and on a
//! GPU.
//!
//! `cargo bench -p lazygrid-bench --bench species -- enzymes`

use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use lazygrid::{Backend, Config, Detector, Interaction, Interactions, Skin, Sphere, Spheres, gpu};
use lazygrid_io::scenes::Scene;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, UnitBall};

/// Number of spheres of each scene.
const N: usize = 20_000;

struct SpeciesScene {
    name: &'static str,
    spheres: Vec<Sphere>,
    species: Vec<u32>,
    count: u32,
    pairs: &'static [(u32, u32)],
}

impl SpeciesScene {
    fn ball(
        name: &'static str,
        [extent, radius]: [f32; 2],
        species: impl Fn(usize) -> u32,
        pairs: &'static [(u32, u32)],
    ) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut center = || UnitBall.sample(&mut random).map(|x: f32| extent * x);
        let spheres = (0..N).map(|_| Sphere::new(center(), radius)).collect();
        let count = 1 + pairs.iter().map(|&(a, b)| a.max(b)).max().unwrap_or(0);
        Self { name, spheres, species: (0..N).map(species).collect(), count, pairs }
    }

    fn all() -> Vec<Self> {
        let uniform = |name, pairs| {
            let spheres = Scene::Equal.spheres(N, 1);
            Self { name, spheres, species: (0..N as u32).map(|k| k % 4).collect(), count: 4, pairs }
        };
        vec![
            Self::ball("burst of one species", [0.5, 0.05], |_| 0, &[(0, 1)]),
            Self::ball("enzymes and substrate", [0.05, 0.005], |k| u32::from(k % 26 > 0), &[(0, 1)]),
            Self::ball("one target in a crowd", [7.0, 0.5], |k| u32::from(k > 0), &[(0, 1)]),
            uniform("ring of four species", &[(0, 1), (1, 2), (2, 3), (0, 3)]),
            uniform(
                "four species that all pair",
                &[(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)],
            ),
        ]
    }

    fn table(&self) -> Interactions {
        let mut table = Interactions::new(self.count, Interaction::Never).expect("few species");
        for &(a, b) in self.pairs {
            table.set(a, b, Interaction::Touch).expect("species of the table");
        }
        table
    }
}

fn species(criterion: &mut Criterion) {
    let backends =
        if gpu::adapters().is_empty() { &[Backend::Cpu][..] } else { &[Backend::Cpu, Backend::Gpu] };
    for &backend in backends {
        // Spheres at rest would never rebuild a candidate list.
        let config = Config::default().backend(backend).skin(Skin::Off);
        for scene in SpeciesScene::all() {
            let mut group = criterion.benchmark_group(format!("{backend}/{}", scene.name));
            group.sample_size(10).throughput(Throughput::Elements(N as u64));
            let mut plain = Detector::new(config.clone()).expect("a backend");
            let mut by_species =
                Detector::new(config.clone().interactions(scene.table())).expect("a backend");
            let spheres = Spheres::from(&scene.spheres);
            let with_species = spheres.with_species(&scene.species).expect("one of each");
            group.bench_function("table", |b| {
                b.iter(|| by_species.count(with_species).expect("valid spheres"));
            });
            if scene.count == 2 {
                // The first spheres of two sets are those of the first species.
                let (first, second): (Vec<_>, Vec<_>) =
                    scene.spheres.iter().zip(&scene.species).partition(|(_, species)| **species == 0);
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
