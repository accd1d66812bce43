use lazygrid::{Backend, Detector, Spheres};
use lazygrid_mpi::{Distributed, GlobalPair, OwnedSpheres, Ownership};
use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;

use crate::scenes::{Scene, config, digest, ids, local, random, sum};

const MILLION: u64 = 1_000_000;

pub(crate) fn million(world: &SimpleCommunicator) {
    let ranks = world.size() as u64;
    let scenes: &[Scene] = match ranks {
        8 => &[Scene::Uniform, Scene::FiveSizes, Scene::Giant, Scene::Gaussian, Scene::WideSizes],
        _ => &[Scene::FiveSizes],
    };
    for &scene in scenes {
        let mut distributed = Distributed::new(world, config().ownership(Ownership::BALANCE)).unwrap();
        let mut particles = scene.owned(MILLION, world.rank() as u32, |k| (k * ranks / MILLION) as u32);
        let report = distributed.rebalance(&mut particles).unwrap();
        assert!(
            report.rebuilt && report.owned.imbalance() <= 1.05,
            "{scene:?}: {}",
            report.owned.imbalance()
        );
        let found = distributed.pairs(local(&particles)).unwrap();
        let (hash, count) = (digest(found.iter().map(GlobalPair::ids)), found.len() as u64);
        let found = (sum(world, count), sum_wrapping(world, hash));
        assert_eq!(found, whole(world, scene), "{scene:?}");
        let report = distributed.report().clone();
        let ghosts = report.ghosts.total as f64 / MILLION as f64;
        let most = if scene == Scene::Gaussian { 0.045 } else { 0.025 };
        if scene != Scene::WideSizes {
            assert!(ghosts <= most, "{scene:?}: {ghosts}");
            assert!(report.pairs.imbalance() <= 1.10, "{scene:?}: {:?}", report.pairs);
        }
        steady(world, &mut distributed, &mut particles, scene);
        if world.rank() == 0 {
            println!(
                "{scene:?} on {ranks} ranks: owned max/mean {:.3}, pairs max/mean {:.3}, ghosts {:.2} %, {} pairs",
                report.owned.imbalance(),
                report.pairs.imbalance(),
                100.0 * ghosts,
                report.pairs.total
            );
        }
    }
}

/// Small displacements send at most two bytes per sphere besides migrated spheres.
fn steady(
    world: &SimpleCommunicator,
    distributed: &mut Distributed,
    particles: &mut OwnedSpheres,
    scene: Scene,
) {
    for (sphere, &id) in particles.spheres.iter_mut().zip(&particles.ids) {
        sphere.center += lazygrid::glam::Vec3::from([20, 21, 22].map(|axis| 0.1 * (random(id, axis) - 0.5)));
    }
    let report = distributed.rebalance(particles).unwrap();
    assert!(!report.rebuilt && report.moved < MILLION / 50, "{scene:?}: {} moved", report.moved);
    distributed.count(local(particles)).unwrap();
    let sent = sum(world, distributed.report().sent) as f64 / MILLION as f64;
    assert!(scene == Scene::WideSizes || sent <= 2.0, "{scene:?}: {sent} bytes per sphere");
}

fn whole(world: &SimpleCommunicator, scene: Scene) -> (u64, u64) {
    let (mut count, mut hash) = (0, 0);
    if world.rank() == 0 {
        let config = lazygrid::Config::default().backend(Backend::Cpu).order(lazygrid::Order::Unordered);
        let mut detector = Detector::new(config).unwrap();
        let all = scene.all(MILLION);
        let pairs = detector.pairs(Spheres::from(&all)).unwrap();
        (count, hash) = (pairs.len() as u64, digest(pairs.iter().map(ids)));
    }
    (sum(world, count), sum_wrapping(world, hash))
}

fn sum_wrapping(world: &SimpleCommunicator, word: u64) -> u64 {
    let (high, low) = (sum(world, word >> 32), sum(world, word & 0xFFFF_FFFF));
    (high << 32).wrapping_add(low)
}

pub(crate) fn one_point(world: &SimpleCommunicator) {
    let (n, ranks) = (10_000_u64, world.size() as u32);
    let mut distributed = Distributed::new(world, config().ownership(Ownership::BALANCE)).unwrap();
    let mut particles = Scene::Point.owned(n, world.rank() as u32, |_| 0);
    let report = distributed.rebalance(&mut particles).unwrap();
    assert!(report.owned.imbalance() <= 1.05, "{}", report.owned.imbalance());
    assert_eq!(distributed.count(local(&particles)), Ok(n * (n - 1) / 2));
    let report = distributed.report();
    // For even P, only one of ranks k and k + P/2 reports their pairs.
    let most = 1.03 + if ranks % 2 == 0 { 1.0 / f64::from(ranks) } else { 0.0 };
    assert!(report.pairs.imbalance() <= most, "{:?}", report.pairs);
    assert_eq!(report.elsewhere, 0);
}
