use crate::common::scenes::{Found, detect, scenes, settings, touching, verify};
use crate::common::{Random, device, session_pairs};
use lazygrid::gpu::{GpuConfig, GpuDetector, GpuDevice, GpuSession, Outcome};
use lazygrid::{Algorithm, Sphere};

/// Sessions share compiled kernels.
fn detect_in_session(gpu: &GpuDevice, settings: GpuConfig, spheres: &[Sphere]) -> Found {
    let mut session = GpuSession::new(gpu.clone(), settings).expect("made");
    let pairs = session_pairs(&mut session, spheres);
    Found { outcome: *session.outcome(), pairs }
}

#[test]
fn every_scene_agrees_for_any_tau() {
    let Some(gpu) = device() else { return };
    for (tau, cell_ratio) in [(0, 2.0), (1, 1.5), (8, 16.0), (512, 2.0), (u32::MAX, 2.0)] {
        let settings = settings(Algorithm::LazyGrid, true).tau(tau).cell_ratio(cell_ratio);
        for (name, spheres) in scenes() {
            let found = detect_in_session(&gpu, settings.clone(), &spheres);
            let scene = format!("{name}, tau {tau}, ratio {cell_ratio}");
            verify(&scene, &touching(&spheres), &found.pairs);
        }
    }
}

#[test]
fn mixed_refinement_loses_no_pair() {
    let Some(gpu) = device() else { return };
    let mut spheres = vec![Sphere::new([40.0; 3], 1.0)];
    let mut random = Random(40);
    for k in 0..300 {
        let x = if k % 10 == 0 { random.unit() * 4.0 - 4.0 } else { random.unit() * 0.8 };
        spheres.push(Sphere::new([x, random.unit() * 0.8, random.unit() * 0.8], 0.1));
    }
    spheres.extend((0..40).map(|k| Sphere::new([0.0, k as f32 * 0.02, 0.4], 0.15)));
    for tau in (0..=350).step_by(10) {
        let found = detect_in_session(&gpu, settings(Algorithm::LazyGrid, true).tau(tau), &spheres);
        verify(&format!("tau {tau}"), &touching(&spheres), &found.pairs);
    }
}

#[test]
fn entry_overflow_is_reported_and_retried_by_a_session() {
    let Some(gpu) = device() else { return };
    let spheres: Vec<_> = (0..3000).map(|k| Sphere::new([0.0; 3], 0.5_f32.powi(k % 15))).collect();
    let pairs = 3000 * 2999 / 2;
    for algorithm in [Algorithm::EagerGrid, Algorithm::LazyGrid] {
        let config = settings(algorithm, true).max_tests_per_dispatch(u64::MAX);
        let mut detector = GpuDetector::new(&gpu.device, config).expect("made");
        let found = detect(&gpu, &mut detector, &spheres);
        let needed = found.outcome.entries_needed();
        assert!(
            needed > 8 * 3000 && found.outcome.overflow & Outcome::OVERFLOW_ENTRIES != 0,
            "{algorithm}: {needed}"
        );
        assert!(detector.set_entry_capacity(needed) && !detector.set_entry_capacity(1 << 40));
        let found = detect(&gpu, &mut detector, &spheres);
        assert_eq!(
            (found.outcome.found(), found.outcome.overflow),
            (pairs, Outcome::OVERFLOW_PAIRS),
            "{algorithm}"
        );
        let found = detect_in_session(&gpu, settings(algorithm, true), &spheres);
        assert_eq!(found.pairs.len() as u64, pairs);
    }
}

/// At the largest coordinates, neighboring floats are a radius apart, and each has its own cell.
#[test]
fn levels_meet_at_the_largest_coordinates() {
    let Some(gpu) = device() else { return };
    let unit = f32::MAX - f32::MAX.next_down();
    let mut spheres: Vec<_> = (0..10).map(|k| Sphere::new([k as f32 * 8.0 * unit; 3], unit)).collect();
    // Small spheres leave the cells of large ones.
    spheres.extend(vec![Sphere::new([0.0; 3], unit / 4.0); 700]);
    for (far, radius) in [(f32::MAX, unit), (f32::MAX, unit / 4.0), (f32::MAX.next_down(), unit / 4.0)] {
        spheres.extend([-1.0, 1.0].map(|sign| Sphere::new([sign * far, 0.0, -sign * f32::MAX], radius)));
    }
    for radix_sort_from in [0, u32::MAX] {
        let config = settings(Algorithm::CellList, true).radix_sort_from(radix_sort_from);
        let mut detector = GpuDetector::new(&gpu.device, config).expect("made");
        verify("largest coordinates", &touching(&spheres), &detect(&gpu, &mut detector, &spheres).pairs);
    }
}
