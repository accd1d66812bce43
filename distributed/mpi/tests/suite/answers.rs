use std::ops::ControlFlow;

use lazygrid::{Interaction, Interactions, Order, Space};
use lazygrid_mpi::{Delivery, Distributed, LocalSpheres, OwnedSpheres, Ownership};
use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;

use crate::scenes::{Scene, config, expected, gathered, ids, local, sum};

#[derive(Clone, Copy, Debug)]
enum Placement {
    RoundRobin,
    LastRank,
    Balanced,
}

impl Placement {
    const ALL: [Self; 3] = [Self::RoundRobin, Self::LastRank, Self::Balanced];

    fn owned(self, scene: Scene, n: u64, rank: u32, ranks: u32) -> OwnedSpheres {
        match self {
            Self::RoundRobin => scene.owned(n, rank, |k| (k % u64::from(ranks)) as u32),
            _ => scene.owned(n, rank, |_| ranks - 1),
        }
    }
}

pub(crate) fn every_scene(world: &SimpleCommunicator) {
    let (rank, ranks) = (world.rank() as u32, world.size() as u32);
    for space in [Space::UNBOUNDED, Space::periodic([Some(30.0), None, Some(44.0)]).unwrap()] {
        let mut unbalanced = Distributed::new(world, config().space(space)).unwrap();
        let balance = config().space(space).ownership(Ownership::BALANCE);
        let mut balanced = Distributed::new(world, balance).unwrap();
        for scene in Scene::ALL {
            for n in [0, 1, 7, if scene == Scene::Point { 300 } else { 2000 }] {
                let expected = expected(&scene.all(n), space);
                for placement in Placement::ALL {
                    let mut particles = placement.owned(scene, n, rank, ranks);
                    let distributed = match placement {
                        Placement::Balanced => {
                            let report = balanced.rebalance(&mut particles).unwrap();
                            assert_eq!(report.owned.total, n);
                            &mut balanced
                        }
                        _ => &mut unbalanced,
                    };
                    let found = gathered(world, distributed.pairs(local(&particles)).unwrap());
                    assert!(
                        found == expected,
                        "{scene:?}, {n} spheres, {placement:?}, {space:?}: {} pairs and not {}",
                        found.len(),
                        expected.len()
                    );
                    assert_eq!(distributed.report().pairs.total, expected.len() as u64);
                }
            }
        }
    }
}

pub(crate) fn interactions(world: &SimpleCommunicator) {
    let (n, rank, ranks) = (1500, world.rank() as u64, world.size() as u64);
    let mut table = Interactions::new(3, Interaction::Never).unwrap();
    table.set(0, 1, Interaction::Within(3.5)).unwrap();
    table.set(2, 2, Interaction::Touch).unwrap();
    let mut one = {
        let config = lazygrid::Config::default().interactions(table.clone()).threads(1);
        lazygrid::Detector::new(config).unwrap()
    };
    let all = Scene::FiveSizes.all(n);
    let species: Vec<u32> = (0..n as u32).map(|k| k % 3).collect();
    let with = lazygrid::Spheres::from(&all).with_species(&species).unwrap();
    let mut expected: Vec<_> = one.pairs(with).unwrap().iter().map(ids).collect();
    expected.sort_unstable();
    assert!(expected.len() > 100);

    let config = config().interactions(table).ownership(Ownership::BALANCE);
    let mut distributed = Distributed::new(world, config).unwrap();
    let mut particles = Scene::FiveSizes.owned(n, rank as u32, |k| (k % ranks) as u32);
    particles.species = Some((0..n).filter(|k| k % ranks == rank).map(|k| (k % 3) as u32).collect());
    for _ in 0..2 {
        let found = gathered(world, distributed.pairs(local(&particles)).unwrap());
        assert!(found == expected, "{} pairs and not {}", found.len(), expected.len());
        distributed.rebalance(&mut particles).unwrap();
    }
}

pub(crate) fn both_owners(world: &SimpleCommunicator) {
    let (rank, ranks) = (world.rank() as u32, world.size() as u32);
    let particles = Scene::Gaussian.owned(2000, rank, |k| (k % u64::from(ranks)) as u32);
    let mut once = Distributed::new(world, config()).unwrap();
    let pairs = once.pairs(local(&particles)).unwrap();
    for pair in pairs {
        let local = [pair.a, pair.b].into_iter().filter(|end| end.rank == rank);
        assert!(local.clone().count() > 0 && pair.a.id < pair.b.id);
        local.for_each(|end| assert_eq!(particles.ids[end.index as usize], end.id));
    }
    assert!(pairs.is_sorted_by(|a, b| a.ids() < b.ids()));
    let all = gathered(world, pairs);
    let mut owners = Distributed::new(world, config().delivery(Delivery::Owners)).unwrap();
    let found: Vec<_> = owners.pairs(local(&particles)).unwrap().iter().map(|pair| pair.ids()).collect();
    let mine = |id: &u64| particles.ids.contains(id);
    let wanted: Vec<_> = all.iter().copied().filter(|pair| pair.iter().any(mine)).collect();
    assert_eq!(found, wanted);
    assert_eq!(owners.report().pairs.total, all.len() as u64);
}

pub(crate) fn streams(world: &SimpleCommunicator) {
    let (rank, ranks) = (world.rank() as u32, world.size() as u32);
    let particles = Scene::FiveSizes.owned(2000, rank, |k| (k % u64::from(ranks)) as u32);
    let mut distributed = Distributed::new(world, config().order(Order::Unordered)).unwrap();
    let listed = gathered(world, distributed.pairs(local(&particles)).unwrap());
    let mut streamed = Vec::new();
    let total = distributed.stream(local(&particles), 7, |pairs| {
        assert!(!pairs.is_empty() && pairs.len() <= 7);
        streamed.extend_from_slice(pairs);
        ControlFlow::Continue(())
    });
    assert_eq!(total, Ok(listed.len() as u64));
    assert_eq!(gathered(world, &streamed), listed);
    assert_eq!(distributed.count(local(&particles)), Ok(listed.len() as u64));
    let mut handed = 0;
    let stopped = distributed.stream(local(&particles), 1, |pairs| {
        handed += pairs.len() as u64;
        match rank {
            0 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    });
    let all = distributed.gather(&[handed]).unwrap();
    if rank == 0 {
        assert_eq!(stopped, Ok(all.iter().sum::<u64>()));
    }
    let column = |f: fn(&lazygrid::Sphere) -> f32| particles.spheres.iter().map(f).collect::<Vec<_>>();
    let (x, y, z) = (column(|s| s.center.x), column(|s| s.center.y), column(|s| s.center.z));
    let r = column(|s| s.radius);
    let columns = lazygrid::Spheres::columns(&x, &y, &z, &r).unwrap();
    assert_eq!(distributed.count(LocalSpheres::new(columns, &particles.ids)), Ok(listed.len() as u64));
    let grid = lazygrid::Config::default().algorithm(lazygrid::Algorithm::RecursiveGrid);
    let mut distributed = Distributed::new(world, config().detector(grid)).unwrap();
    assert_eq!(gathered(world, distributed.pairs(local(&particles)).unwrap()), listed);
    assert_eq!(distributed.count(local(&particles)), Ok(listed.len() as u64));
}

pub(crate) fn rounds(world: &SimpleCommunicator) {
    let (rank, ranks) = (world.rank() as u32, world.size() as u32);
    let expected = expected(&Scene::Uniform.all(2000), Space::UNBOUNDED);
    for limit in [64, 100, 5000] {
        let config = config()
            .ownership(Ownership::BALANCE)
            .delivery(Delivery::Owners)
            .message_limit(limit * u64::from(ranks));
        let mut distributed = Distributed::new(world, config).unwrap();
        let mut particles = Scene::Uniform.owned(2000, rank, |_| 0);
        let moved = distributed.rebalance(&mut particles).unwrap().moved;
        assert_eq!(moved > 0, ranks > 1);
        let mut found = gathered(world, distributed.pairs(local(&particles)).unwrap());
        found.dedup();
        assert!(found == expected, "messages of {limit} bytes per rank");
        assert_eq!(sum(world, particles.ids.len() as u64), 2000);
    }
}

pub(crate) fn bytes_of_few_ranks(world: &SimpleCommunicator) {
    let (rank, last) = (world.rank(), world.size() - 1);
    let mut distributed = Distributed::new(world, config()).unwrap();
    assert_eq!(distributed.gather::<u8>(&[]), Ok(Vec::new()));
    let bytes: &[u8] = if rank == last { b"pairs" } else { b"" };
    let all = distributed.gather(bytes).unwrap();
    assert_eq!(all, if rank == 0 { b"pairs".to_vec() } else { Vec::new() });
}
