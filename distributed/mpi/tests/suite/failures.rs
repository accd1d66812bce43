use lazygrid::{Interaction, Interactions, Sphere};
use lazygrid_mpi::{Config, Delivery, Distributed, Error, LocalSpheres, OwnedSpheres, Ownership};
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};

use crate::scenes::{Scene, config, local};

pub(crate) fn panic(world: &SimpleCommunicator) {
    assert!(world.rank() + 1 < world.size(), "a panic on rank {}, as was asked for", world.rank());
    world.barrier();
}

fn owned(world: &SimpleCommunicator, n: u64) -> OwnedSpheres {
    let ranks = world.size() as u64;
    Scene::Uniform.owned(n, world.rank() as u32, |k| (k % ranks) as u32)
}

pub(crate) fn bad_sphere(world: &SimpleCommunicator) {
    let last = world.size() as u32 - 1;
    let mut distributed = Distributed::new(world, config().ownership(Ownership::BALANCE)).unwrap();
    for (bad, shown) in [
        (Sphere::new([f32::NAN, 0.0, 0.0], 1.0), "NaN"),
        (Sphere::new([0.0; 3], -1.0), "-1"),
        (Sphere::new([0.0, f32::INFINITY, 0.0], 1.0), "inf"),
    ] {
        let mut particles = owned(world, 800);
        if world.rank() as u32 == last {
            particles.spheres[3] = bad;
            particles.spheres[5] = bad;
        }
        let refused = |error: Error| {
            let Error::Input { rank, index, ref message } = error else { panic!("{error}") };
            assert_eq!((rank, index), (last, Some(3)));
            assert!(message.starts_with("sphere 3 has center (") && message.contains(shown), "{message}");
            assert!(message.contains("2 of "), "{message}");
            assert!(error.to_string().starts_with(&format!("rank {last}: sphere 3 has")));
        };
        refused(distributed.count(local(&particles)).unwrap_err());
        refused(distributed.pairs(local(&particles)).unwrap_err());
        let before = particles.ids.clone();
        refused(distributed.rebalance(&mut particles).unwrap_err());
        assert_eq!(particles.ids, before);
        assert!(distributed.count(local(&owned(world, 800))).is_ok());
    }
}

pub(crate) fn duplicate_ids(world: &SimpleCommunicator) {
    let (rank, last) = (world.rank() as u32, world.size() as u32 - 1);
    let mut distributed = Distributed::new(world, config()).unwrap();
    let mut particles = owned(world, 800);
    assert!(distributed.count(local(&particles)).is_ok());
    let ids = particles.ids.clone();
    if rank == 0 {
        particles.ids[1] = 77;
    }
    if rank == last {
        particles.ids[4] = 77;
    }
    for _ in 0..2 {
        let error = distributed.count(local(&particles)).unwrap_err();
        assert_eq!(error, Error::DuplicateId { id: 77, first: [0, 1], second: [last, 4] });
    }
    let text = error_text(&mut distributed, &particles);
    assert!(
        text.starts_with(&format!("duplicate id 77: sphere 1 on rank 0 and sphere 4 on rank {last}; ")),
        "{text}"
    );
    particles.ids = ids;
    assert!(distributed.count(local(&particles)).is_ok());
}

fn error_text(distributed: &mut Distributed, particles: &OwnedSpheres) -> String {
    distributed.count(local(particles)).unwrap_err().to_string()
}

pub(crate) fn pairs_of_owners_above_the_limit(world: &SimpleCommunicator) {
    let (rank, others) = (world.rank() as u32, world.size() as u64 - 1);
    let small = |k: u32| Sphere::new([k as f32, rank as f32, 0.0], 0.1);
    let spheres = if rank == 0 { vec![Sphere::new([0.0; 3], 1000.0)] } else { (0..8).map(small).collect() };
    let ids = (0..spheres.len() as u64).map(|k| 100 * u64::from(rank) + k).collect();
    let particles = OwnedSpheres { spheres, ids, ..OwnedSpheres::default() };
    let mut distributed = Distributed::new(world, config().delivery(Delivery::Owners).max_pairs(10)).unwrap();
    match distributed.pairs(local(&particles)) {
        Ok(pairs) => assert!(others < 2 && pairs.len() as u64 == 8 * others, "{} pairs", pairs.len()),
        Err(error) => assert_eq!(error, Error::TooManyPairs { rank: 0, found: 8 * others, limit: 10 }),
    }
}

pub(crate) fn refusals(world: &SimpleCommunicator) {
    let (rank, last) = (world.rank() as u32, world.size() as u32 - 1);
    let particles = owned(world, 800);
    let mut distributed = Distributed::new(world, config()).unwrap();
    let ids = if rank == last { &particles.ids[1..] } else { &particles.ids[..] };
    let Err(Error::Input { rank: named, index: None, message }) =
        distributed.count(LocalSpheres::new(&particles.spheres, ids))
    else {
        panic!("ids were missing")
    };
    assert!(named == last && message.contains("`ids`"), "{message}");
    let limit = |limit| config().max_pairs(limit);
    let point = Scene::Point.owned(400, rank, |k| (k % u64::from(last + 1)) as u32);
    let error = Distributed::new(world, limit(10)).unwrap().pairs(local(&point)).unwrap_err();
    let Error::TooManyPairs { rank: 0, found, limit: 10 } = error else { panic!("{error}") };
    assert!(found > 10);
    let table = Interactions::new(2, Interaction::Touch).unwrap();
    let mut distributed = Distributed::new(world, config().interactions(table)).unwrap();
    assert_eq!(distributed.count(local(&OwnedSpheres::default())), Ok(0));
    let error = distributed.count(local(&particles)).unwrap_err().to_string();
    assert!(error.starts_with("rank 0: interactions are set but"), "{error}");
    let mut with = particles.clone();
    with.species =
        Some((0..with.ids.len() as u32).map(|k| if rank == last && k == 9 { 2 } else { k % 2 }).collect());
    let error = distributed.count(local(&with)).unwrap_err();
    assert!(matches!(error, Error::Input { rank, index: Some(9), .. } if rank == last), "{error}");
    settings(world);
}

fn settings(world: &SimpleCommunicator) {
    let refused = |config: Config, name: &str| match Distributed::new(world, config) {
        Err(Error::Setting { name: refused, .. }) => assert_eq!(refused, name),
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("{name} was accepted"),
    };
    refused(config().message_limit(63 * world.size() as u64), "message_limit");
    refused(config().message_limit(1 << 31), "message_limit");
    refused(config().threads(0), "threads");
    refused(config().ownership(Ownership::Balance { bound: 0.9 }), "bound");
    let eager = lazygrid::Config::default().algorithm(lazygrid::Algorithm::EagerGrid);
    let error = Distributed::new(world, config().detector(eager)).err().unwrap().to_string();
    assert!(error.starts_with("rank 0: eager-grid does not run on the cpu backend"), "{error}");
}
