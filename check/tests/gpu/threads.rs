//! Threads with detectors and sessions of their own on the shared device.

use std::ops::ControlFlow;
use std::thread;
use std::time::Duration;

use crate::common::{Random, detector, device, exact_cloud};
use lazygrid::gpu::{GpuConfig, GpuDevice, GpuSession};
use lazygrid::{Algorithm, Backend, Config, Error, Pair, Sphere, Spheres};

const ALGORITHMS: [Algorithm; 3] = [Algorithm::CellList, Algorithm::LazyGrid, Algorithm::Naive];

fn sorted(session: &mut GpuSession, spheres: &[Sphere], abandons: bool) -> Vec<Pair> {
    let [first, second] = [0, 1].map(|_| session.begin(Spheres::from(spheres)).expect("begun"));
    if abandons {
        drop(first);
    } else {
        session.finish_count(first).expect("counted");
    }
    let mut pairs = session.finish(second, u64::MAX).expect("found").to_vec();
    pairs.sort_unstable();
    pairs
}

fn run(gpu: &GpuDevice, seed: u64) {
    let mut random = Random(seed);
    let mut cpu = detector(Config::default().backend(Backend::Cpu).threads(1));
    for round in 0..6 {
        let algorithm = ALGORITHMS[(seed as usize + round) % ALGORITHMS.len()];
        let on_gpu = Config::default().backend(Backend::Gpu).algorithm(algorithm);
        let (mut whole, mut few) = (detector(on_gpu.clone()), detector(on_gpu.clone().max_pairs(5)));
        let mut hasty = detector(on_gpu.timeout(Duration::from_nanos(1)));
        let settings = GpuConfig::default().algorithm(algorithm).pair_capacity(64);
        let mut session = GpuSession::new(gpu.clone(), settings).expect("made");
        for _ in 0..3 {
            let count = 200 + random.word() as usize % 800;
            let spheres = exact_cloud(&mut random, count, 8, |_| 0.25);
            let expected = cpu.pairs(&spheres).expect("valid").to_vec();
            let found = expected.len() as u64;
            assert_eq!(
                few.count(&[Sphere::new([f32::NAN; 3], 1.0)]).map_err(|e| matches!(e, Error::Input(_))),
                Err(true)
            );
            assert_eq!(few.pairs(&spheres).map(drop), Err(Error::TooManyPairs { found, limit: 5 }));
            assert_eq!(whole.pairs(&spheres), Ok(&expected[..]), "{algorithm}");
            let counted = hasty.count(&spheres);
            assert!(counted == Ok(found) || matches!(counted, Err(Error::Timeout { .. })), "{counted:?}");
            assert!(sorted(&mut session, &spheres, round % 2 == 0) == expected, "{algorithm}");
            let mut streamed = Vec::new();
            let streaming = few.stream(&spheres, 7, |pairs| {
                streamed.extend_from_slice(pairs);
                ControlFlow::Continue(())
            });
            assert!(streaming == Ok(found) && streamed == expected, "{algorithm}");
        }
        // A call in flight ends with its session.
        let _abandoned = session.begin(Spheres::from(&[Sphere::default(); 300])).expect("begun");
    }
}

#[test]
fn failed_and_abandoned_calls_disturb_no_other_thread() {
    let Some(gpu) = device() else { return };
    thread::scope(|scope| {
        for seed in 1..=4 {
            let gpu = gpu.clone();
            scope.spawn(move || run(&gpu, seed));
        }
    });
}
