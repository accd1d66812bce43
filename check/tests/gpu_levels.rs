//! EagerGrid and LazyGrid where several levels share the work, against all pairs in f64.

mod common;

use std::collections::{HashMap, HashSet};

use bytemuck::Zeroable;
use common::scenes::{Found, detect, judge, scenes, settings, touching};
use common::{Random, device, download, run, upload};
use lazygrid::gpu::{GpuDetector, GpuDevice, GpuSession, GpuSettings, Outcome, Phase, Resource, Slot};
use lazygrid::{Algorithm, Sphere, Spheres};
use lazygrid_kernels::kernel::Variant;
use lazygrid_kernels::layout::{Call, Grid};

/// The pairs, sorted, and what else a session with these settings found. It shares its compiled kernels.
fn detect_in_session(own: &GpuDevice, settings: GpuSettings, spheres: &[Sphere]) -> Found {
    let mut session = GpuSession::new(own.clone(), settings).expect("made");
    let ticket = session.begin(Spheres::from(spheres)).expect("begun");
    let mut pairs = session.finish(ticket, u64::MAX).expect("found").to_vec();
    pairs.sort_unstable();
    Found { outcome: *session.outcome(), pairs }
}

#[test]
fn every_scene_agrees_for_any_tau() {
    let Some(own) = device() else { return };
    for (tau, raster_ratio) in [(0, 2.0), (1, 1.5), (8, 16.0), (512, 2.0), (u32::MAX, 2.0)] {
        let settings = GpuSettings { tau, raster_ratio, ..settings(Algorithm::LazyGrid, true) };
        for (name, spheres) in scenes() {
            let found = detect_in_session(&own, settings.clone(), &spheres);
            let scene = format!("{name}, tau {tau}, ratio {raster_ratio}");
            judge(&scene, &spheres, &found.pairs, touching(&spheres));
        }
    }
}

/// The entries that the kernels of such a call write: whether at the first level, and of which sphere.
fn entries_of(own: &GpuDevice, settings: &GpuSettings, spheres: &[Sphere]) -> Vec<(bool, u32)> {
    let detector = GpuDetector::new(&own.device, settings.clone()).expect("made");
    let plan = detector.plan_for(spheres.len() as u32).expect("fits");
    let call = Call {
        spheres: plan.spheres,
        entry_capacity: plan.entries,
        key_bits: plan.key_bits,
        raster_ratio: settings.raster_ratio,
        refinement: plan.refinement as u32,
        tau: settings.tau,
        density_slots: plan.density_slots,
        ..Call::zeroed()
    };
    let (call, input) = (upload(own, &[call]), upload(own, spheres));
    let sizes = plan.buffers.iter().filter(|(slot, _)| *slot != Slot::Pairs);
    let buffers: HashMap<_, _> =
        sizes.map(|&(slot, bytes)| (slot, upload(own, &vec![0_u8; bytes as usize]))).collect();
    for stage in plan.stages.iter().filter(|stage| matches!(stage.phase, Phase::Survey | Phase::Entries)) {
        let buffer = |name: &str| match plan.resource(stage, name) {
            Resource::Own(slot) => &buffers[&slot],
            Resource::Spheres => &input,
            _ => &call,
        };
        let bindings = stage.kernel.bindings(Variant::default());
        let bound: Vec<_> = bindings.map(|binding| (binding.name, buffer(binding.name))).collect();
        run(own, stage.kernel, Variant::default(), stage.groups, &bound);
    }
    let count = download::<Outcome>(own, &buffers[&Slot::Outcome], 1)[0].entries() as usize;
    let grid = download::<Grid>(own, &buffers[&Slot::Grid], 1)[0];
    let keys = download::<u32>(own, &buffers[&Slot::Keys(false)], count);
    let objects = download::<u32>(own, &buffers[&Slot::Objects(false)], count);
    let first_keys = 1 << grid.levels[0].bits.iter().sum::<u32>();
    keys.iter()
        .zip(objects)
        .map(|(key, object)| (key >> grid.passive < first_keys, object & 0x1fff_ffff))
        .collect()
}

/// A crowd beside a few spheres, with some of both on the border between their cells: as τ grows, the crowd's cells go
/// from refined to settled, one after another.
#[test]
fn settled_and_refined_cells_share_spheres() {
    let Some(own) = device() else { return };
    // Of the largest sphere, which lies apart, cells are 4.1 wide and have a corner at the median. No other is of their
    // depth, so that a cell has entries of others only where it is settled.
    let mut spheres = vec![Sphere::new([40.0; 3], 1.0)];
    let mut random = Random(40);
    for k in 0..300 {
        let x = if k % 10 == 0 { random.unit() * 4.0 - 4.0 } else { random.unit() * 0.8 };
        spheres.push(Sphere::new([x, random.unit() * 0.8, random.unit() * 0.8], 0.1));
    }
    // On the border, and at one point.
    spheres.extend((0..40).map(|k| Sphere::new([0.0, k as f32 * 0.02, 0.4], 0.15)));
    let mut sharing = Vec::new();
    for tau in (0..=350).step_by(10) {
        let settings = GpuSettings { tau, ..settings(Algorithm::LazyGrid, true) };
        let found = detect_in_session(&own, settings.clone(), &spheres);
        judge(&format!("tau {tau}"), &spheres, &found.pairs, touching(&spheres));
        if tau % 20 == 0 {
            let entries = entries_of(&own, &settings, &spheres);
            assert_eq!(entries.len() as u64, found.outcome.entries(), "tau {tau}");
            let [settled, refined] = [true, false].map(|at_first| -> HashSet<u32> {
                entries.iter().filter(|entry| entry.0 == at_first).map(|entry| entry.1).collect()
            });
            sharing.push(settled.intersection(&refined).count());
        }
    }
    assert!(
        sharing.iter().filter(|&&count| count > 20).count() > 1,
        "spheres in cells of both kinds: {sharing:?}"
    );
}

/// At one point, so that every level has its spheres: more than eight entries each, in all of eight cells.
#[test]
fn entries_beyond_the_plan_are_reported_and_a_session_makes_room() {
    let Some(own) = device() else { return };
    let spheres: Vec<_> = (0..3000).map(|k| Sphere::new([0.0; 3], 0.5_f32.powi(k % 15))).collect();
    let pairs = 3000 * 2999 / 2;
    for algorithm in [Algorithm::EagerGrid, Algorithm::LazyGrid] {
        let mut detector = GpuDetector::new(&own.device, settings(algorithm, true)).expect("made");
        let found = detect(&own, &mut detector, &spheres);
        let needed = found.outcome.entries();
        assert!(needed > 8 * 3000 && found.outcome.overflow & Outcome::ENTRIES != 0, "{algorithm}: {needed}");
        assert!(detector.set_entry_capacity(needed) && !detector.set_entry_capacity(1 << 40));
        let found = detect(&own, &mut detector, &spheres);
        assert_eq!((found.outcome.found(), found.outcome.overflow), (pairs, Outcome::PAIRS), "{algorithm}");
        let found = detect_in_session(&own, settings(algorithm, true), &spheres);
        assert_eq!(found.pairs.len() as u64, pairs);
    }
}
