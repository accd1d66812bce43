use lazygrid::{Algorithm, Backend, Interaction, Interactions, Order, Skin, Space};
use lazygrid_mpi::{Config, Delivery, Distributed, Error, OwnedSpheres, Ownership, Settings, agree_on};
use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;

use crate::scenes::{Scene, config, expected, gathered, local};

fn owned(world: &SimpleCommunicator) -> OwnedSpheres {
    let ranks = world.size() as u64;
    Scene::Uniform.owned(900, world.rank() as u32, |k| (k % ranks) as u32)
}

fn refused(world: &SimpleCommunicator, odd: i32, [all, one]: [&Config; 2]) -> Error {
    let rank_config = if world.rank() == odd { one } else { all };
    let error = Distributed::new(world, rank_config.clone()).err().expect("ranks disagree");
    let mut distributed = Distributed::new(world, config()).expect("ranks agree");
    assert!(distributed.count(local(&owned(world))).is_ok());
    error
}

pub(crate) fn settings(world: &SimpleCommunicator) {
    let last = world.size() - 1;
    if last == 0 {
        return;
    }
    let table = |distance| {
        let mut table = Interactions::new(2, Interaction::Touch).unwrap();
        table.set(0, 1, Interaction::Within(distance)).unwrap();
        table
    };
    let space = |length| Space::periodic([Some(30.0), None, Some(length)]).unwrap();
    let balance = |bound| config().ownership(Ownership::Balance { bound });
    let cases = [
        ("space", config(), config().space(space(44.0))),
        ("space", config().space(space(44.0)), config().space(space(44.0_f32.next_up().into()))),
        ("interactions", config(), config().interactions(table(1.0))),
        ("interactions", config().interactions(table(1.0)), config().interactions(table(2.0))),
        ("ownership", config(), balance(1.2)),
        ("ownership", balance(1.2), balance(1.3)),
        ("delivery", config(), config().delivery(Delivery::Owners)),
        ("order", config(), config().order(Order::Unordered)),
        ("message_limit", config(), config().message_limit(1 << 20)),
    ];
    for (name, all, one) in &cases {
        for odd in [0, last] {
            let error = refused(world, odd, [all, one]);
            let Error::Settings { name: named, ranks, message } = &error else { panic!("{error}") };
            let other = if odd == 0 { 1 } else { odd as u32 };
            assert_eq!((named.as_str(), ranks), (*name, &[0, other]));
            assert!(message.starts_with(&format!("the setting `{name}` is ")), "{message}");
            assert!(message.contains(&format!(" on rank {other}; ")), "{message}");
        }
    }
    let error = refused(world, last, [&config(), &config().delivery(Delivery::Owners)]).to_string();
    let expected = format!("the setting `delivery` is once on rank 0 and owners on rank {last}; 1 of ");
    assert!(error.starts_with(&expected), "{error}");
    program(world);
}

fn program(world: &SimpleCommunicator) {
    let steps = |steps: i32| agree_on(world, &Settings::new("mine 2").with("steps", steps));
    assert_eq!(steps(5), Ok(()));
    let error = steps(5 + world.rank()).unwrap_err().to_string();
    assert!(error.starts_with("the setting `steps` is 5 on rank 0 and 6 on rank 1; "), "{error}");
}

pub(crate) fn own_settings(world: &SimpleCommunicator) {
    let detector = lazygrid::Config::default;
    let rank_config = match world.rank() % 4 {
        0 => config().detector(detector().algorithm(Algorithm::RecursiveGrid)).threads(2),
        1 => config().detector(detector().skin(Skin::Fixed(0.1)).tau(9)).max_pairs(1 << 20),
        2 => config().detector(detector().algorithm(Algorithm::Naive)).backend(Backend::Auto),
        _ => config().detector(detector().simd(lazygrid::Simd::Portable)),
    };
    let mut distributed = Distributed::new(world, rank_config).unwrap();
    let expected = expected(&Scene::Uniform.all(900), Space::UNBOUNDED);
    for _ in 0..3 {
        assert_eq!(gathered(world, distributed.pairs(local(&owned(world))).unwrap()), expected);
    }
}

pub(crate) fn detectors_own_table(world: &SimpleCommunicator) {
    let never = Interactions::new(1, Interaction::Never).unwrap();
    let detector =
        lazygrid::Config::default().interactions(never).space(Space::periodic([Some(5.0); 3]).unwrap());
    let mut distributed = Distributed::new(world, config().detector(detector)).unwrap();
    let expected = expected(&Scene::Uniform.all(900), Space::UNBOUNDED);
    assert_eq!(gathered(world, distributed.pairs(local(&owned(world))).unwrap()), expected);
}

pub(crate) fn failures_of_one(world: &SimpleCommunicator) {
    let last = world.size() - 1;
    let eager = lazygrid::Config::default().algorithm(Algorithm::EagerGrid);
    let limit = 63 * world.size() as u64;
    for odd in [0, last] {
        let of_one = |one: Config| refused(world, odd, [&config(), &one]);
        let named = |error: Error| match error {
            Error::Setting { name, .. } => name,
            other => panic!("{other}"),
        };
        assert_eq!(named(of_one(config().threads(0))), "threads");
        assert_eq!(named(of_one(config().ownership(Ownership::Balance { bound: f64::NAN }))), "bound");
        assert_eq!(named(of_one(config().message_limit(limit))), "message_limit");
        let error = of_one(config().detector(eager.clone()));
        assert!(matches!(error, Error::Detection { rank, .. } if rank as i32 == odd), "{error}");
        #[cfg(feature = "gpu")]
        let has_gpu = !lazygrid::gpu::adapters().is_empty();
        #[cfg(not(feature = "gpu"))]
        let has_gpu = false;
        if !has_gpu {
            let error = of_one(config().backend(Backend::Gpu));
            assert!(matches!(error, Error::Detection { rank, .. } if rank as i32 == odd), "{error}");
        }
    }
}
