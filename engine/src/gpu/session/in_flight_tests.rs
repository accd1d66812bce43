//! Calls whose retries and reports could use the state of a later call or setting.

use lazygrid_host::RebuildReason;
use lazygrid_kernels::{Algorithm, Sphere, Spheres};

use super::*;
use crate::gpu::device::device_or_skip;
use crate::gpu::test_support::with_binding_limit;

/// At most 16,384 pairs and 32,768 entries.
const SMALL_BINDING: u64 = 1 << 17;

fn begin(session: &mut GpuSession, spheres: &[Sphere]) -> Ticket {
    session.begin(Spheres::from(spheres)).expect("begun")
}

fn count(session: &mut GpuSession, spheres: &[Sphere]) -> u64 {
    let ticket = begin(session, spheres);
    session.finish_count(ticket).expect("counted")
}

fn made(gpu: &GpuDevice, config: GpuConfig, skin: Option<f32>) -> GpuSession {
    let mut session = GpuSession::new(gpu.clone(), config).expect("made");
    session.set_skin(skin).expect("valid");
    session
}

fn row(spheres: usize) -> Vec<Sphere> {
    (0..spheres).map(|k| Sphere::new([k as f32, 0.0, 0.0], 0.5)).collect()
}

/// Tiny spheres in a cell of large ones, which several submissions search.
fn crowd() -> Vec<Sphere> {
    let tiny = |k: u32| Sphere::new([k as f32 / 4096.0, 0.0, 0.0], 0.75 / 4096.0);
    let large = |k: u32| Sphere::new([4.0 + k as f32, 0.0, 0.0], 0.5);
    (0..1500).map(tiny).chain((0..20).map(large)).collect()
}

#[test]
fn call_with_too_many_entries_has_a_single_level_despite_a_later_call() {
    let Some(gpu) = device_or_skip() else { return };
    let config = GpuConfig::default()
        .algorithm(Algorithm::LazyGrid)
        .cell_ratio(GpuConfig::MAX_CELL_RATIO)
        .pair_capacity(1 << 14);
    let mut session = made(&with_binding_limit(&gpu, SMALL_BINDING), config, None);
    let spheres: Vec<_> = (0..2000).map(|k| Sphere::new([0.0; 3], 0.5_f32.powi(k % 20))).collect();
    let first = begin(&mut session, &spheres);
    session.set_algorithm(Algorithm::Naive).expect("it has kernels");
    let second = begin(&mut session, &spheres[..2]);
    assert_eq!(session.finish_count(first), Ok(2000 * 1999 / 2));
    assert_eq!(session.algorithm(), Algorithm::ArrayGrid);
    assert_eq!(session.finish_count(second), Ok(1));
}

#[test]
fn refused_call_names_the_limit_of_the_device_despite_a_later_call() {
    let Some(gpu) = device_or_skip() else { return };
    let config = GpuConfig::default()
        .algorithm(Algorithm::ArrayGrid)
        .cell_ratio(GpuConfig::MAX_CELL_RATIO)
        .pair_capacity(1 << 14);
    let mut session = made(&with_binding_limit(&gpu, SMALL_BINDING), config, None);
    // Each sphere is in eight cells of any size, because a corner of cells is at the median.
    let spheres = vec![Sphere::new([0.0; 3], 0.5); 4200];
    let first = begin(&mut session, &spheres);
    session.set_algorithm(Algorithm::Naive).expect("it has kernels");
    let second = begin(&mut session, &spheres[..2]);
    let refused = session.finish_count(first).expect_err("too many entries");
    assert!(matches!(refused, Error::LimitExceeded { limit: 32_768, .. }), "{refused}");
    assert_eq!(session.finish_count(second), Ok(1));
}

#[test]
fn report_describes_the_finished_call_not_a_later_one() {
    let Some(gpu) = device_or_skip() else { return };
    let mut session = made(&gpu, GpuConfig::default().algorithm(Algorithm::CellList), None);
    let spheres = row(1000);
    let first = begin(&mut session, &spheres);
    session.set_algorithm(Algorithm::Naive).expect("it has kernels");
    let second = begin(&mut session, &spheres[..10]);
    let assert_last = |session: &GpuSession, algorithm, spheres, pairs| {
        let cost = session.cost().expect("a search");
        assert_eq!((session.algorithm(), cost.algorithm, cost.spheres), (algorithm, algorithm, spheres));
        assert_eq!(session.outcome().found(), pairs);
    };
    assert_eq!(session.finish_count(first), Ok(999));
    assert_last(&session, Algorithm::CellList, 1000, 999);
    assert_eq!(session.finish_count(second), Ok(9));
    session.set_algorithm(Algorithm::ArrayGrid).expect("it has kernels");
    let third = begin(&mut session, &spheres);
    assert_last(&session, Algorithm::Naive, 10, 9);
    assert_eq!(session.finish_count(third), Ok(999));
}

#[test]
fn outcome_of_a_call_in_windows_has_all_pairs() {
    let Some(gpu) = device_or_skip() else { return };
    let config = GpuConfig::default().pair_capacity(1000);
    let mut session = made(&with_binding_limit(&gpu, SMALL_BINDING), config, None);
    let ticket = begin(&mut session, &[Sphere::new([0.0; 3], 0.5); 300]);
    let pairs = session.finish(ticket, u64::MAX).expect("found").len();
    assert!(session.submissions().searches > 2, "{:?}", session.submissions());
    assert_eq!((pairs, session.outcome().found()), (300 * 299 / 2, 300 * 299 / 2));
}

#[test]
fn call_without_a_list_continues_without_a_later_skin() {
    let Some(gpu) = device_or_skip() else { return };
    let config = GpuConfig::default().algorithm(Algorithm::ArrayGrid).timestamps(true);
    let mut session = made(&gpu, config.max_tests_per_dispatch(1 << 17), None);
    let ticket = begin(&mut session, &crowd());
    session.set_skin(Some(0.01)).expect("valid");
    assert_eq!(session.finish_count(ticket), Ok(1499 + 19));
    assert!(session.outcome().deferred_begin > 0, "one part: {:?}", session.outcome());
    assert_eq!((session.candidate_list_stats(), session.submissions().searches), (None, 1));
    assert_eq!(session.cost().map(|cost| cost.algorithm), Some(Algorithm::ArrayGrid));
}

#[test]
fn list_of_a_call_is_reported_despite_a_later_skin() {
    let Some(gpu) = device_or_skip() else { return };
    for later in [None, Some(5.0)] {
        let mut session = made(&gpu, GpuConfig::default().algorithm(Algorithm::CellList), Some(0.5));
        let mut spheres = row(1000);
        (0..3).for_each(|_| assert_eq!(count(&mut session, &spheres), 999));
        spheres[0].center.y = 0.125;
        let ticket = begin(&mut session, &spheres);
        session.set_skin(later).expect("valid");
        assert_eq!(session.finish_count(ticket), Ok(998));
        let stats = session.candidate_list_stats().expect("a list");
        assert_eq!((stats.age, stats.rebuilt, stats.displacement_fraction), (3, None, 0.5), "{later:?}");
        assert_eq!(session.cost(), None, "{later:?}");
    }
}

#[test]
fn list_has_the_age_of_its_call_in_any_order_of_ends() {
    let Some(gpu) = device_or_skip() else { return };
    let mut session = made(&gpu, GpuConfig::default().algorithm(Algorithm::CellList), Some(0.5));
    let stats = |session: &GpuSession| {
        let stats = session.candidate_list_stats().expect("a list");
        (stats.age, stats.rebuilt)
    };
    let mut spheres = row(1000);
    for age in 0..3 {
        assert_eq!(count(&mut session, &spheres), 999);
        assert_eq!(stats(&session).0, age);
    }
    spheres[0].center.y = 1.0;
    let [first, second] = [(); 2].map(|()| begin(&mut session, &spheres));
    assert_eq!(session.finish_count(second), Ok(998));
    assert_eq!(stats(&session), (1, None));
    assert_eq!(session.finish_count(first), Ok(998));
    assert_eq!(stats(&session), (0, Some(RebuildReason::Displacement)));
    assert_eq!(count(&mut session, &spheres), 998);
    assert_eq!(stats(&session), (2, None));
}

#[test]
fn list_that_does_not_fit_does_not_pause_a_later_skin() {
    let Some(gpu) = device_or_skip() else { return };
    let config = GpuConfig::default().algorithm(Algorithm::CellList).pair_capacity(1 << 10);
    let mut session = made(&with_binding_limit(&gpu, SMALL_BINDING), config, Some(1000.0));
    let spheres = row(600);
    let ticket = begin(&mut session, &spheres);
    session.set_skin(Some(0.01)).expect("valid");
    assert_eq!(session.finish_count(ticket), Ok(599));
    assert_eq!(count(&mut session, &spheres), 599);
    assert!(session.candidate_list_stats().is_some(), "the new skin is paused");
}

#[test]
fn call_with_a_small_need_lowers_no_capacity() {
    let Some(gpu) = device_or_skip() else { return };
    let nested = |n, sizes| (0..n).map(|k| Sphere::new([0.0; 3], 0.5_f32.powi(k % sizes))).collect();
    let entries: [Vec<Sphere>; 2] = [nested(2500, 4), nested(3000, 15)];
    let candidates: [Vec<Sphere>; 2] = [nested(100, 1), nested(400, 1)];
    let config = GpuConfig::default().algorithm(Algorithm::EagerGrid);
    for (mut session, [few, many]) in [
        (made(&gpu, config.clone(), None), entries),
        (made(&gpu, config.algorithm(Algorithm::CellList).pair_capacity(1 << 10), Some(0.5)), candidates),
    ] {
        let pairs = |spheres: &[Sphere]| Ok((spheres.len() * (spheres.len() - 1) / 2) as u64);
        let [first, second] = [&few, &many].map(|spheres| begin(&mut session, spheres));
        assert_eq!(session.finish_count(second), pairs(&many));
        assert_eq!(session.submissions().searches, 2, "no overflow");
        assert_eq!(session.finish_count(first), pairs(&few));
        assert_eq!(session.submissions().searches, 2, "no overflow");
        assert_eq!(Ok(count(&mut session, &many)), pairs(&many));
        assert_eq!(session.submissions().searches, 1);
    }
}
