use std::ops::ControlFlow;

use lazygrid::glam::Vec3;
use lazygrid::{Algorithm, Backend, Detector, Interaction, Interactions, Skin, Space, Sphere, Spheres};
use lazygrid_mpi::{Config, Distributed, Error, LocalSpheres, OwnedSpheres, Ownership};
use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;

use crate::scenes::{config, gathered, id, ids, random, sum};

const SIDE: f32 = 12.0;

struct World {
    spheres: Vec<Sphere>,
    species: Vec<u32>,
    owners: Vec<u32>,
    ranks: u32,
    drawn: u64,
}

impl World {
    fn choose(&mut self, count: u64) -> u64 {
        self.drawn += 1;
        (random(self.drawn, 100) * count as f32) as u64
    }

    fn point(&self, k: usize) -> [f32; 3] {
        [0, 1, 2].map(|axis| SIDE * random(self.drawn << 12 | k as u64, axis))
    }

    fn resize(&mut self, n: usize) {
        for k in self.spheres.len()..n {
            let radius = 0.4 * 0.5_f32.powi(k as i32 % 4);
            self.spheres.push(Sphere::new(self.point(k), radius));
            self.species.push(k as u32 % 3);
            self.owners.push(k as u32 % self.ranks);
        }
        self.spheres.truncate(n);
        self.species.truncate(n);
        self.owners.truncate(n);
    }

    fn change(&mut self) -> u64 {
        match self.choose(9) {
            0 => return 1 + self.choose(5),
            1 | 2 => {
                let by = [1e-4, 1e-2, 0.3][self.choose(3) as usize];
                for k in 0..self.spheres.len() {
                    let step = Vec3::from(self.point(k)) / SIDE - 0.5;
                    self.spheres[k].center += by * step;
                }
            }
            3 | 4 => {
                let factor = [1e-3, 0.2, 1.01, 2.0, 4.0, 1e3][self.choose(6) as usize];
                let every = [1, 1, 4][self.choose(3) as usize];
                let changed = self.spheres.iter_mut().step_by(every);
                changed.for_each(|sphere| sphere.radius = (sphere.radius * factor).clamp(1e-6, 1.0));
            }
            5 => {
                let n = [0, 1, 299, 420, 501, 620, 900, 1500, 1500][self.choose(9) as usize];
                self.resize(n);
            }
            6 => {
                let every = 1 + self.choose(4) as usize;
                for k in (0..self.spheres.len()).step_by(every) {
                    self.spheres[k].center = self.point(k).into();
                }
            }
            7 => {
                let by = self.species.len().min(1);
                self.species.rotate_left(by);
            }
            _ => {
                let (single, ranks) = (self.choose(2) == 0, self.ranks);
                let rank = self.choose(ranks.into()) as u32;
                let owner = |k: u32| if single { rank } else { (k ^ rank) % ranks };
                (0..).zip(&mut self.owners).for_each(|(k, rank)| *rank = owner(k));
            }
        }
        1
    }

    fn owned(&self, rank: u32, with_species: bool) -> OwnedSpheres {
        let mine: Vec<usize> = (0..self.spheres.len()).filter(|&k| self.owners[k] == rank).collect();
        OwnedSpheres {
            spheres: mine.iter().map(|&k| self.spheres[k]).collect(),
            doubles: None,
            ids: mine.iter().map(|&k| id(k as u64)).collect(),
            species: with_species.then(|| mine.iter().map(|&k| self.species[k]).collect()),
        }
    }

    fn expected(&self, space: Space, table: Option<&Interactions>) -> Vec<[u64; 2]> {
        let naive = lazygrid::Config::default().backend(Backend::Cpu).algorithm(Algorithm::Naive).threads(1);
        let mut naive = Detector::new(naive.space(space).interactions(table.cloned())).unwrap();
        let spheres = Spheres::from(&self.spheres);
        let spheres = if table.is_some() { spheres.with_species(&self.species).unwrap() } else { spheres };
        let mut pairs: Vec<_> = naive.pairs(spheres).unwrap().iter().map(ids).collect();
        pairs.sort_unstable();
        pairs
    }
}

fn fail(world: &SimpleCommunicator, distributed: &mut Distributed, particles: &OwnedSpheres, kind: u64) {
    let mut bad = particles.clone();
    let has = sum(world, u64::from(!bad.ids.is_empty()) << world.rank());
    if has == 0 {
        return;
    }
    let odd = 63 - has.leading_zeros();
    let is_odd = world.rank() as u32 == odd;
    let refused =
        |error: Error| assert!(matches!(error, Error::Input { rank, .. } if rank == odd), "{error}");
    if is_odd {
        match kind {
            0 => bad.spheres[0].radius = -1.0,
            1 => bad.spheres[0].center.y = f32::NAN,
            2 => drop(bad.ids.pop()),
            _ => {}
        }
    }
    let spheres = Spheres::from(&bad.spheres);
    let spheres = match &bad.species {
        Some(species) => spheres.with_species(species).unwrap(),
        None => spheres,
    };
    let groups = vec![1; bad.spheres.len()];
    let spheres = match kind {
        3 if is_odd => spheres.with_groups(&groups).unwrap(),
        _ => spheres,
    };
    let local = LocalSpheres::new(spheres, &bad.ids);
    refused(distributed.pairs(local).unwrap_err());
    refused(distributed.count(local).unwrap_err());
    refused(distributed.stream(local, 9, |_| ControlFlow::Continue(())).unwrap_err());
}

fn call(
    world: &SimpleCommunicator,
    distributed: &mut Distributed,
    local: LocalSpheres<'_>,
    kind: u64,
) -> Vec<[u64; 2]> {
    if kind > 0 {
        return gathered(world, distributed.pairs(local).unwrap());
    }
    let mut streamed = Vec::new();
    let total = distributed.stream(local, 64, |pairs| {
        streamed.extend_from_slice(pairs);
        ControlFlow::Continue(())
    });
    let found = gathered(world, &streamed);
    assert_eq!(total, Ok(found.len() as u64));
    found
}

fn run(world: &SimpleCommunicator, seed: u64, config: Config, space: Space, table: Option<&Interactions>) {
    let rank = world.rank() as u32;
    let mut distributed = Distributed::new(world, config).unwrap();
    let (spheres, species, owners) = (Vec::new(), Vec::new(), Vec::new());
    let mut all = World { spheres, species, owners, ranks: world.size() as u32, drawn: seed << 20 };
    all.resize(1500);
    for step in 0..40 {
        let calls = all.change();
        let expected = all.expected(space, table);
        if all.choose(5) < 2 {
            let kind = all.choose(4);
            fail(world, &mut distributed, &all.owned(rank, table.is_some()), kind);
        }
        for repeat in 0..calls {
            let mut particles = all.owned(rank, table.is_some());
            if all.choose(2) == 0 {
                distributed.rebalance(&mut particles).unwrap();
            }
            let kind = all.choose(3);
            let local = particles.local().unwrap();
            let found = call(world, &mut distributed, local, kind);
            assert!(
                found == expected,
                "seed {seed}, step {step}, repeat {repeat}: {} pairs and not {} of {} spheres",
                found.len(),
                expected.len(),
                all.spheres.len()
            );
            assert_eq!(distributed.count(local), Ok(expected.len() as u64));
        }
    }
}

pub(crate) fn random_calls(world: &SimpleCommunicator) {
    let mut table = Interactions::new(3, Interaction::Touch).unwrap();
    table.set(0, 1, Interaction::Within(0.7)).unwrap();
    table.set(1, 2, Interaction::Never).unwrap();
    let periodic = Space::periodic([Some(f64::from(SIDE)), None, Some(f64::from(SIDE))]).unwrap();
    for seed in 0..8 {
        let space = if seed % 2 == 0 { Space::UNBOUNDED } else { periodic };
        let table = (seed % 4 > 1).then_some(&table);
        let skin = if seed < 4 { Skin::Auto } else { Skin::Fixed(0.2) };
        let config = config().space(space).ownership(Ownership::BALANCE);
        let config = config.detector(lazygrid::Config::default().skin(skin));
        let config = match table {
            Some(table) => config.interactions(table.clone()),
            None => config,
        };
        run(world, seed, config, space, table);
    }
}
