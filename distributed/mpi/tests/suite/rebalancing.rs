use lazygrid_mpi::{Distributed, Ownership};
use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;

use crate::scenes::{Scene, config, gathered, local, sum};

pub(crate) fn moves_data(world: &SimpleCommunicator) {
    let (rank, ranks) = (world.rank() as u32, world.size() as u32);
    for ownership in [Ownership::Keep, Ownership::BALANCE] {
        let mut distributed = Distributed::new(world, config().ownership(ownership)).unwrap();
        let mut particles = Scene::Gaussian.owned(3000, rank, |k| (k % u64::from(ranks)) as u32);
        let before = particles.clone();
        let report = distributed.rebalance(&mut particles).unwrap();
        let ids = distributed.migrate_data(&report.migration, &before.ids).unwrap();
        assert_eq!(ids, particles.ids);
        let rows: Vec<[f32; 4]> =
            before.spheres.iter().map(|s| [s.center.x, s.center.y, s.center.z, s.radius]).collect();
        let rows = distributed.migrate_data(&report.migration, &rows).unwrap();
        assert!(
            rows.iter().zip(&particles.spheres).all(|(row, sphere)| lazygrid::Sphere::from(*row) == *sphere)
        );
        match ownership {
            Ownership::Keep => assert!(particles == before && report.moved == 0),
            _ => assert!(report.owned.imbalance() <= 1.02, "{}", report.owned.imbalance()),
        }
        assert_eq!((sum(world, particles.ids.len() as u64), report.owned.total), (3000, 3000));
        assert!(distributed.migrate_data(&report.migration, &[1_u8; 5000]).is_err());
    }
}

pub(crate) fn reuses_partition(world: &SimpleCommunicator) {
    let (n, rank, ranks) = (20_000, world.rank() as u32, world.size() as u32);
    let mut distributed = Distributed::new(world, config().ownership(Ownership::BALANCE)).unwrap();
    let mut particles = Scene::Uniform.owned(n, rank, |_| 0);
    assert!(distributed.rebalance(&mut particles).unwrap().rebuilt);
    let again = distributed.rebalance(&mut particles).unwrap();
    assert_eq!((again.rebuilt, again.moved), (false, 0));
    particles.spheres.iter_mut().for_each(|sphere| sphere.center.x += 0.1);
    let step = distributed.rebalance(&mut particles).unwrap();
    assert!(!step.rebuilt && step.moved < n / 50);
    let pairs = gathered(world, distributed.pairs(local(&particles)).unwrap());
    particles.spheres.iter_mut().for_each(|sphere| sphere.center *= 0.2);
    particles.spheres.iter_mut().for_each(|sphere| sphere.radius *= 0.2);
    particles.spheres.iter_mut().for_each(|sphere| sphere.center += 100.0);
    let moved = distributed.rebalance(&mut particles).unwrap();
    assert_eq!(moved.rebuilt, ranks > 1);
    assert!(moved.owned.imbalance() <= 1.05, "{}", moved.owned.imbalance());
    let shrunk = gathered(world, distributed.pairs(local(&particles)).unwrap());
    assert!(shrunk.len().abs_diff(pairs.len()) < pairs.len() / 20);
}
