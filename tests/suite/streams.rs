//! Streams whose consumer itself uses a detector.

use std::ops::ControlFlow;
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use lazygrid::{Algorithm, Backend, Config, Detector, Order};
use lazygrid_io::scenes::Scene;

/// A limit far longer than the search takes.
const TIME_LIMIT: Duration = Duration::from_secs(120);

fn detector(algorithm: Algorithm, threads: usize) -> Detector {
    let config = Config::default().backend(Backend::Cpu).algorithm(algorithm).threads(threads);
    Detector::new(config.order(Order::Unordered)).expect("a detector")
}

#[test]
fn consumer_with_a_detector_of_its_own_pool_does_not_hang() {
    for algorithm in [Algorithm::CellList, Algorithm::HashGrid, Algorithm::Naive] {
        let (sender, results) = channel();
        thread::spawn(move || {
            let n = if algorithm == Algorithm::Naive { 20_000 } else { 60_000 };
            let mut spheres = Scene::Equal.spheres(n, 71);
            spheres.iter_mut().for_each(|sphere| sphere.radius *= 3.0);
            let inner = Scene::FiveSizes.spheres(30_000, 72);
            let mut inner_detector = detector(Algorithm::CellList, 2);
            let expected = inner_detector.count(&inner).expect("an answer");
            let mut outer = detector(algorithm, 2);
            let all = outer.count(&spheres).expect("an answer");
            let (mut pairs, mut calls) = (0, 0);
            let found = outer.stream(&spheres, 1 << 20, |chunk| {
                if calls < 30 {
                    assert_eq!(inner_detector.count(&inner), Ok(expected));
                }
                (pairs, calls) = (pairs + chunk.len() as u64, calls + 1);
                ControlFlow::Continue(())
            });
            let _ = sender.send((found, all, pairs, calls));
        });
        let (found, all, pairs, calls) =
            results.recv_timeout(TIME_LIMIT).unwrap_or_else(|_| panic!("{algorithm}: the stream hangs"));
        assert_eq!((found, pairs), (Ok(all), all), "{algorithm}");
        assert!(calls > 8, "{algorithm}: {calls} chunks");
    }
}

#[test]
fn consumer_that_breaks_or_panics_is_not_called_again() {
    let mut spheres = Scene::Equal.spheres(60_000, 73);
    spheres.iter_mut().for_each(|sphere| sphere.radius *= 3.0);
    let mut detector = detector(Algorithm::CellList, 2);
    let all = detector.count(&spheres).expect("an answer");
    let mut calls = 0;
    let broken = detector.stream(&spheres, 1 << 20, |_| {
        calls += 1;
        ControlFlow::Break(())
    });
    assert!(broken.is_ok_and(|found| found < all));
    assert_eq!(calls, 1);
    let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        detector.stream(&spheres, 1 << 20, |_| {
            calls += 1;
            panic!("a consumer's panic");
        })
    }));
    assert!(panicked.is_err());
    assert_eq!(calls, 2);
    assert_eq!(detector.count(&spheres), Ok(all));
}
