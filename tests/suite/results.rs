use std::ops::ControlFlow;

use lazygrid::{Algorithm, Backend, Config, Detector, Error, Neighbors, Order, Pair, Spheres};
use lazygrid_tests::results::streamed;
use lazygrid_tests::{
    DetectorVariant, SuiteVariant, THREADS, TestInput, difference, hard, in_pool, variants,
};
use proptest::prelude::*;
use proptest::sample::select;

use crate::properties::{check, one_of_each};

fn detector(variant: DetectorVariant, config: Config) -> Result<Detector, String> {
    Detector::new(config.backend(variant.backend()).algorithm(variant.algorithm)).map_err(|e| e.to_string())
}

fn small_spheres() -> impl Strategy<Value = TestInput> {
    hard::any_spheres().prop_map(|mut spheres| {
        spheres.truncate(120);
        spheres.into()
    })
}

#[test]
fn count_equals_the_list() {
    check(96, hard::any_spheres(), |spheres| {
        let scenario = TestInput::from(spheres);
        let oracle = scenario.oracle();
        for variant in variants::for_scenario(&scenario) {
            let expected = variant.own_pairs(&scenario, &oracle)?.len() as u64;
            let mut detector = detector(variant, Config::default().max_pairs(0))?;
            let count = variant.run(|| detector.count(scenario.query())).map_err(|e| e.to_string())?;
            let report = detector.report();
            let reported = (report.spheres, report.pairs);
            if count != expected || reported != (scenario.spheres.len() as u64, expected) {
                return Err(format!(
                    "{variant}: counted {count}, reported {reported:?}, expected {expected}"
                ));
            }
        }
        Ok(())
    });
}

#[test]
fn too_many_pairs_reports_the_exact_count() {
    check(32, (small_spheres(), any::<proptest::sample::Index>()), |(scenario, limit)| {
        let oracle = scenario.oracle();
        let limit = limit.index(oracle.len() + 2) as u64;
        for (variant, order) in variants_and_orders(&scenario) {
            let found = variant.own_pairs(&scenario, &oracle)?.len() as u64;
            let mut detector = detector(variant, Config::default().max_pairs(limit).order(order))?;
            let list = variant.run(|| detector.pairs(scenario.query()).map(<[Pair]>::len));
            let expected = match found > limit {
                true => Err(Error::TooManyPairs { found, limit }),
                false => Ok(found as usize),
            };
            let neighbors = detector.neighbors(scenario.query()).map(|n| n.indices().len() / 2);
            if list != expected || neighbors != expected {
                return Err(format!("{variant}: {list:?} and {neighbors:?} instead of {expected:?}"));
            }
        }
        Ok(())
    });
}

fn variants_and_orders(scenario: &TestInput) -> impl Iterator<Item = (DetectorVariant, Order)> {
    let orders = [Order::Canonical, Order::Unordered];
    variants::for_scenario(scenario).into_iter().flat_map(move |variant| orders.map(|order| (variant, order)))
}

#[test]
fn a_stream_equals_the_list() {
    let limits = select(vec![0, 1, 2, 7, 100, u64::MAX]);
    let chunks = select(vec![0, 1, 3, 64, usize::MAX]);
    check(64, (small_spheres(), limits, chunks), |(scenario, limit, chunk)| {
        let expected = scenario.oracle();
        for (variant, order) in variants_and_orders(&scenario) {
            let mut detector = detector(variant, Config::default().max_pairs(limit).order(order))?;
            let found = variant.run(|| streamed(&mut detector, scenario.query(), chunk))?;
            difference(&scenario, &found, &expected, variant.tolerance())
                .map_err(|e| format!("{variant}: {e}"))?;
            if order == Order::Canonical && !found.is_sorted() {
                return Err(format!("{variant}: the stream is not in canonical order"));
            }
        }
        Ok(())
    });
}

#[test]
fn break_stops_a_stream() {
    let limits = select(vec![1, 10, u64::MAX]);
    check(48, (small_spheres(), limits, 1_usize..50, 1_usize..5), |(scenario, limit, chunk, stop)| {
        let oracle = scenario.oracle();
        for (variant, order) in variants_and_orders(&scenario) {
            let expected = variant.own_pairs(&scenario, &oracle)?;
            let mut detector = detector(variant, Config::default().max_pairs(limit).order(order))?;
            let (mut calls, mut pairs) = (0, Vec::new());
            let handed = variant.run(|| {
                detector.stream(scenario.query(), chunk, |chunk| {
                    calls += 1;
                    pairs.extend_from_slice(chunk);
                    if calls == stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                })
            });
            if calls > stop || handed != Ok(pairs.len() as u64) || pairs.len() > stop * chunk {
                return Err(format!("{variant}: {handed:?} pairs in {calls} calls, to stop at {stop}"));
            }
            if order == Order::Canonical && pairs != expected[..pairs.len()] {
                return Err(format!("{variant}: a broken stream is not the beginning of the list"));
            }
            let whole = variant.run(|| streamed(&mut detector, scenario.query(), chunk))?;
            difference(&scenario, &whole, &expected, variant.tolerance())
                .map_err(|e| format!("{variant}, after a break: {e}"))?;
        }
        Ok(())
    });
}

#[test]
fn break_stops_a_long_stream() {
    let scenario = TestInput::from(vec![lazygrid::Sphere::new([0.0; 3], 1.0); 1500]);
    for (variant, order) in variants_and_orders(&scenario) {
        for limit in [50_000, u64::MAX] {
            let mut detector =
                detector(variant, Config::default().max_pairs(limit).order(order)).expect("a detector");
            let mut calls = 0;
            let handed = variant.run(|| {
                detector.stream(scenario.query(), 1000, |_| {
                    calls += 1;
                    if calls == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                })
            });
            assert_eq!(calls, 3, "{variant}, {order:?}");
            assert!(handed.is_ok_and(|handed| handed <= 3000), "{variant}, {order:?}");
        }
    }
}

fn neighbor_lists(pairs: &[Pair], spheres: usize) -> Vec<Vec<u32>> {
    let mut lists = vec![Vec::new(); spheres];
    for pair in pairs {
        lists[pair.i as usize].push(pair.j);
        lists[pair.j as usize].push(pair.i);
    }
    lists.iter_mut().for_each(|list| list.sort_unstable());
    lists
}

#[test]
fn neighbors_equal_the_pairs() {
    check(64, hard::any_spheres(), |spheres| {
        let scenario = TestInput::from(spheres);
        let oracle = scenario.oracle();
        for (variant, order) in variants_and_orders(&scenario) {
            let pairs = variant.own_pairs(&scenario, &oracle)?;
            let expected = neighbor_lists(&pairs, scenario.spheres.len());
            let mut detector = detector(variant, Config::default().order(order))?;
            let lists = |n: Neighbors<'_>| -> Vec<Vec<u32>> {
                for (k, list) in (0..).zip(&n) {
                    assert_eq!(n.neighbors_of(k), list);
                }
                n.iter().map(<[u32]>::to_vec).collect()
            };
            let found = variant.run(|| detector.neighbors(scenario.query()).map(lists));
            if found.as_ref() != Ok(&expected) {
                return Err(format!("{variant}: {found:?}, expected {expected:?}"));
            }
        }
        Ok(())
    });
}

#[test]
fn rows_and_columns_are_the_same() {
    check(64, hard::mixture(hard::any_spheres()), |scenario| {
        let column = |k: usize| -> Vec<f32> {
            scenario.spheres.iter().map(|s| [s.center.x, s.center.y, s.center.z, s.radius][k]).collect()
        };
        let [x, y, z, r] = [0, 1, 2, 3].map(column);
        let rows: Vec<[f32; 4]> = (0..x.len()).map(|i| [x[i], y[i], z[i], r[i]]).collect();
        let species = scenario.mixture.as_ref().map_or(&[][..], |mixture| &mixture.species);
        for variant in one_of_each(&scenario) {
            let mut detector = detector(variant, scenario.config(Config::default()).expect("a valid table"))?;
            let columns = Spheres::columns(&x, &y, &z, &r).map_err(|e| e.to_string())?;
            for layout in [columns, Spheres::from(&rows)] {
                let view = layout.with_species(species).map_err(|e| e.to_string())?;
                let found = detector.pairs(view).map_err(|e| e.to_string())?;
                difference(&scenario, found, &scenario.oracle(), variant.tolerance())?;
            }
        }
        Ok(())
    });
}

#[test]
fn own_and_caller_threads_agree() {
    let scenario = TestInput::from(lazygrid_io::scenes::Scene::FiveSizes.spheres(3000, 3));
    let expected = scenario.oracle();
    for &algorithm in Algorithm::CPU {
        for threads in THREADS {
            let config = Config::default().algorithm(algorithm).threads(threads);
            let mut detector = Detector::new(config).expect("threads");
            assert_eq!(detector.pairs(scenario.query()).expect("pairs"), expected, "{algorithm}, {threads}");
            let found = in_pool(1, || detector.count(scenario.query()));
            assert_eq!(found, Ok(expected.len() as u64), "{algorithm}, {threads}, called from another pool");
        }
    }
}

#[test]
fn detect_is_a_detector_with_default_settings() {
    let scenario = TestInput::from(lazygrid_io::scenes::Scene::Equal.spheres(2000, 4));
    assert_eq!(lazygrid::detect(&scenario.spheres), Ok(scenario.oracle()));
}

#[test]
fn report_names_algorithm_and_reason() {
    for n in [0, 100, 5000] {
        let spheres = lazygrid_io::scenes::Scene::FiveSizes.spheres(n, 4);
        for variant in variants::all() {
            let mut detector = Detector::new(variant.settings()).expect("a detector");
            assert_eq!(detector.report().algorithm, variant.algorithm);
            let pairs = detector.pairs(&spheres).expect("pairs").len() as u64;
            let report = detector.report();
            assert_eq!((report.spheres, report.pairs), (n as u64, pairs), "{variant}");
            let known = if variant.backend() == Backend::Gpu { Algorithm::GPU } else { Algorithm::CPU };
            assert!(known.contains(&report.algorithm), "{variant}: {report:?}");
            assert!(
                [Algorithm::Auto, report.algorithm].contains(&variant.algorithm),
                "{variant}: {report:?}"
            );
            assert_eq!(report.backend, variant.backend());
            assert!(report.reason.contains(report.algorithm.name()), "{variant}: {}", report.reason);
            assert!(!report.phases.is_empty(), "{variant}");
            let mut names: Vec<&str> = report.phases.iter().map(|phase| phase.name).collect();
            names.sort_unstable();
            assert!(names.is_sorted_by(|a, b| a < b), "{variant}: {names:?}");
        }
    }
}
