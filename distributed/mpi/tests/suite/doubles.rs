use std::ops::ControlFlow;

use lazygrid::{Space, Sphere};
use lazygrid_mpi::{Config, Distributed, Error, LocalSpheres, OwnedSpheres, Ownership};
use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;

use crate::scenes::{config, expected, gathered, id, local, random};

const COUNT: u64 = 600;

/// Spheres `2 i` and `2 i + 1` touch up to 2 ulp.
fn row(k: u64, offset: f64) -> [f64; 4] {
    let number = |stream| f64::from(random(k / 2, stream)) + f64::from(random(k / 2, stream + 1)) * 1e-8;
    let center = [0, 2, 4].map(|stream| offset + 12.0 * number(stream));
    let direction = [6, 8, 10].map(|stream| number(stream) - 0.5);
    if k.is_multiple_of(2) {
        return [center[0], center[1], center[2], 0.1 + 0.1 * number(12)];
    }
    let other = [0, 1, 2].map(|axis| center[axis] + 0.7 * direction[axis]);
    let [x, y, z] = [0, 1, 2].map(|axis| other[axis] - center[axis]);
    let rest = (x * x + y * y + z * z).sqrt() - row(k - 1, offset)[3];
    let ulps = [0, 1, 2, -1, -2][(k / 2 % 5) as usize];
    let radius = if rest > 0.0 { f64::from_bits(rest.to_bits().saturating_add_signed(ulps)) } else { 0.0 };
    [other[0], other[1], other[2], radius]
}

fn owned(world: &SimpleCommunicator, rows: &[[f64; 4]]) -> OwnedSpheres {
    let (rank, ranks) = (world.rank() as u64, world.size() as u64);
    let mine = || (0..rows.len() as u64).filter(|k| k % ranks == rank);
    let doubles = Some(mine().map(|k| rows[k as usize]).collect());
    OwnedSpheres { doubles, ids: mine().map(id).collect(), ..OwnedSpheres::default() }
}

fn spaces() -> [Space; 4] {
    let tilted = [Some([12.1, 0.0, 0.0]), Some([0.7, 12.3, 0.0]), Some([0.0, 0.1, 11.87])];
    let far = [Some([1.21e60, 0.0, 0.0]), Some([0.7e60, 1.23e60, 0.0]), None];
    [
        Space::UNBOUNDED,
        Space::periodic([Some(12.1), None, Some(11.87)]).unwrap(),
        Space::triclinic(tilted).unwrap(),
        Space::triclinic(far).unwrap(),
    ]
}

pub(crate) fn answers(world: &SimpleCommunicator) {
    for (space, offset) in spaces().into_iter().flat_map(|space| [0.0, 1e9].map(|offset| (space, offset))) {
        let rows: Vec<_> = (0..COUNT).map(|k| row(k, offset)).collect();
        let narrow: Vec<Sphere> = rows.iter().map(|row| Sphere::from(row.map(|x| x as f32))).collect();
        let exact = expected(&rows, space);
        assert!(exact.len() > 100 && exact != expected(&narrow, space), "{space:?} at {offset:e}");
        let config = config().space(space).ownership(Ownership::BALANCE);
        let mut distributed = Distributed::new(world, config).unwrap();
        let mut particles = owned(world, &rows);
        for _ in 0..2 {
            let found = gathered(world, distributed.pairs(local(&particles)).unwrap());
            assert!(found == exact, "{space:?} at {offset:e}: {} pairs and not {}", found.len(), exact.len());
            assert_eq!(distributed.count(local(&particles)), Ok(exact.len() as u64));
            let mut streamed = Vec::new();
            let total = distributed.stream(local(&particles), 7, |pairs| {
                streamed.extend_from_slice(pairs);
                ControlFlow::Continue(())
            });
            assert_eq!(total, Ok(exact.len() as u64));
            assert!(gathered(world, &streamed) == exact, "{space:?} at {offset:e}");
            assert_eq!(distributed.rebalance(&mut particles).unwrap().owned.total, COUNT);
            assert!(particles.spheres.is_empty() && particles.doubles.is_some());
        }
    }
}

pub(crate) fn f32_in_other_boxes(world: &SimpleCommunicator) {
    for space in [spaces()[1], spaces()[3]] {
        let narrow: Vec<Sphere> = (0..COUNT).map(|k| Sphere::from(row(k, 0.0).map(|x| x as f32))).collect();
        let exact = expected(&narrow, space);
        let ranks = world.size() as u64;
        let mine = || (0..COUNT).filter(|k| k % ranks == world.rank() as u64);
        let spheres = mine().map(|k| narrow[k as usize]).collect();
        let mut particles =
            OwnedSpheres { spheres, ids: mine().map(id).collect(), ..OwnedSpheres::default() };
        let config = config().space(space).ownership(Ownership::BALANCE);
        let mut distributed = Distributed::new(world, config).unwrap();
        for _ in 0..2 {
            assert!(gathered(world, distributed.pairs(local(&particles)).unwrap()) == exact, "{space:?}");
            distributed.rebalance(&mut particles).unwrap();
            assert!(particles.doubles.is_none());
        }
    }
}

pub(crate) fn f32_across_other_boundaries(world: &SimpleCommunicator) {
    let (rank, last) = (world.rank(), world.size() - 1);
    let space = Space::periodic([Some(10.1), None, None]).unwrap();
    let mut distributed = Distributed::new(world, config().space(space)).unwrap();
    for k in 0..50_u8 {
        let x = 6.0 + 0.01 * f32::from(k);
        let other = (f64::from(x) + [0.2, -0.2][usize::from(k % 2)] - 10.1) as f32;
        let apart = space.minimum_image([x.into(), 0.0, 0.0], [other.into(), 0.0, 0.0]).length();
        let half = (0.5 * apart) as f32;
        let radius = if 2.0 * f64::from(half) < apart { half.next_up() } else { half };
        let all = [x, other].map(|x| Sphere::new([x, 0.0, 0.0], radius));
        assert_eq!(expected(&all, space).len(), 1);
        let indices = (0..2).filter(|k| [0, last][*k as usize] == rank);
        let particles = OwnedSpheres {
            spheres: indices.clone().map(|k| all[k as usize]).collect(),
            ids: indices.collect(),
            ..OwnedSpheres::default()
        };
        assert_eq!(distributed.count(local(&particles)), Ok(1), "{all:?}");
    }
}

pub(crate) fn both_types(world: &SimpleCommunicator) {
    let (rank, last) = (world.rank(), world.size() - 1);
    let rows: Vec<_> = (0..COUNT).map(|k| row(k, 0.0)).collect();
    let mut particles = owned(world, &rows);
    if rank == last {
        let rows = particles.doubles.take().unwrap();
        particles.spheres = rows.iter().map(|row| Sphere::from(row.map(|x| x as f32))).collect();
    }
    let mut distributed = Distributed::new(world, Config::ownership(config(), Ownership::BALANCE)).unwrap();
    let counted = distributed.count(local(&particles));
    let moved = distributed.rebalance(&mut particles.clone()).map(|report| report.owned.total);
    if last == 0 {
        assert_eq!((counted.is_ok(), moved), (true, Ok(COUNT)));
        return;
    }
    for error in [counted.unwrap_err(), moved.unwrap_err()] {
        let Error::Input { index: None, message, .. } = error else { panic!("{error}") };
        assert!(message.contains("f64") && message.contains("give all ranks one type"), "{message}");
    }
    let none = OwnedSpheres::default();
    let particles = if rank == last { &none } else { &particles };
    assert!(distributed.count(local(particles)).is_ok());
    let bad = [[0.0, f64::NAN, 0.0, 1.0]];
    let error = distributed.count(LocalSpheres::new(&bad, &[id(0)][..])).unwrap_err();
    assert!(matches!(error, Error::Input { rank: 0, index: Some(0), .. }), "{error}");
}
