//! `GpuDetector` on a caller's device against all pairs in f64, over scenes that break grids.

mod common;

use bytemuck::Zeroable;
use common::{Random, device, download, submit, upload};
use lazygrid::gpu::{
    Count, GpuDetector, GpuDevice, GpuError, GpuSession, GpuSettings, GpuSpheres, Outcome, wgpu,
};
use lazygrid::{Algorithm, Interaction, Interactions, Pair, Sphere, Spheres};

const ALGORITHMS: [Algorithm; 4] = Algorithm::GPU;

fn settings(algorithm: Algorithm, subgroups: bool) -> GpuSettings {
    GpuSettings { algorithm, subgroups, ..GpuSettings::default() }
}

struct Found {
    outcome: Outcome,
    pairs: Vec<Pair>,
}

fn detect_with(own: &GpuDevice, detector: &mut GpuDetector, input: &GpuSpheres<'_>) -> Found {
    submit(own, |encoder| detector.encode(encoder, input)).expect("recorded");
    let outcome = download::<Outcome>(own, detector.outcome().expect("recorded"), 1)[0];
    let written = outcome.found().min(detector.plan().expect("planned").pairs.into()) as usize;
    let mut pairs: Vec<Pair> = download(own, detector.pairs().expect("recorded"), written);
    pairs.sort_unstable();
    Found { outcome, pairs }
}

fn detect(own: &GpuDevice, detector: &mut GpuDetector, spheres: &[Sphere]) -> Found {
    let buffer = upload(own, spheres);
    let count = Count::Host(spheres.len() as u32);
    detect_with(
        own,
        detector,
        &GpuSpheres { spheres: &buffer, count, species: None, window: GpuSpheres::ALL },
    )
}

/// How far a pair is from tangency, in units of the squared reach; `(distance², reach²)` in f64.
fn squares(a: &Sphere, b: &Sphere, reach: f64) -> (f64, f64) {
    let square = |axis: usize| (f64::from(a.center[axis]) - f64::from(b.center[axis])).powi(2);
    (square(0) + square(1) + square(2), reach * reach)
}

/// Holds the sorted `pairs` against all pairs: once each, none missing and none too many, but for those within
/// four ulp of tangency. `reach` says how far apart two spheres may be, if they may pair at all.
fn judge(scene: &str, spheres: &[Sphere], pairs: &[Pair], reach: impl Fn(usize, usize) -> Option<f64>) {
    assert!(pairs.windows(2).all(|two| two[0] < two[1]), "{scene}: a pair twice");
    let mut given = pairs.iter().copied().peekable();
    for i in 0..spheres.len() {
        for j in i + 1..spheres.len() {
            let pair = Pair { i: i as u32, j: j as u32 };
            let found = given.next_if_eq(&pair).is_some();
            let (wanted, tangent) = reach(i, j).map_or((false, false), |reach| {
                let (distance, limit) = squares(&spheres[i], &spheres[j], reach);
                let tolerance = 4.0 * f64::from(f32::EPSILON) * limit;
                (distance <= limit, (distance - limit).abs() <= tolerance && limit > 0.0)
            });
            assert!(
                found == wanted || tangent,
                "{scene}: {pair:?} {} {}",
                spheres[i].radius,
                spheres[j].radius
            );
        }
    }
    assert_eq!(given.next(), None, "{scene}: not a pair i < j below n");
}

fn touching(spheres: &[Sphere]) -> impl Fn(usize, usize) -> Option<f64> {
    |i, j| Some(f64::from(spheres[i].radius) + f64::from(spheres[j].radius))
}

fn cloud(seed: u64, n: usize, extent: f32, radius: impl Fn(&mut Random) -> f32) -> Vec<Sphere> {
    let mut random = Random(seed);
    (0..n)
        .map(|_| {
            let center = [0; 3].map(|_| random.unit() * extent);
            Sphere::new(center, radius(&mut random))
        })
        .collect()
}

fn moved(spheres: Vec<Sphere>, by: f32) -> Vec<Sphere> {
    spheres.into_iter().map(|s| Sphere::new(s.center + by, s.radius)).collect()
}

fn scenes() -> Vec<(&'static str, Vec<Sphere>)> {
    let lattice = |edge: f32, radius: f32| -> Vec<Sphere> {
        let at = |i: i32| [(i % 10) as f32 * edge, (i / 10 % 10) as f32 * edge, (i / 100) as f32 * edge];
        (0..1000).map(|i| Sphere::new(at(i), radius)).collect()
    };
    let line: Vec<_> = (0..2000).map(|i| Sphere::new([i as f32 * 0.9, 0.0, 0.0], 0.5)).collect();
    let mut one_huge = cloud(7, 1500, 10.0, |_| 0.05);
    one_huge.push(Sphere::new([5.0; 3], 4.0));
    let mut outlier = cloud(8, 1500, 10.0, |_| 0.2);
    outlier.extend([1e9, -3e38, 3e38].map(|x| Sphere::new([x; 3], 0.2)));
    let powers = cloud(9, 1000, 50.0, |random| 2_f32.powi((random.word() % 13) as i32 - 9));
    let mut crowds = cloud(10, 700, 0.5, |_| 0.02);
    crowds.extend(moved(cloud(11, 600, 0.5, |_| 0.02), 7.0));
    crowds.extend(cloud(12, 300, 100.0, |_| 0.02));
    let tiny = |scale: f32| {
        cloud(13, 300, 1.0, |_| 0.1).into_iter().map(move |s| Sphere::new(s.center * scale, s.radius * scale))
    };
    vec![
        ("empty", vec![]),
        ("one", vec![Sphere::new([1.0; 3], 1.0)]),
        ("two apart", vec![Sphere::new([0.0; 3], 1.0), Sphere::new([2.1, 0.0, 0.0], 1.0)]),
        ("two touching", vec![Sphere::new([0.0; 3], 1.0), Sphere::new([2.0, 0.0, 0.0], 1.0)]),
        ("equal radii", cloud(1, 3000, 30.0, |_| 0.5)),
        ("five sizes", cloud(2, 3000, 30.0, |random| [0.05, 0.1, 0.2, 0.4, 0.8][random.word() as usize % 5])),
        ("sparse", cloud(3, 3000, 1e4, |_| 0.5)),
        ("points", cloud(4, 2000, 1.0, |_| 0.0)),
        ("all at one point", vec![Sphere::new([3.0, -1.0, 7.0], 0.25); 1500]),
        ("points at one point", vec![Sphere::new([3.0, -1.0, 7.0], 0.0); 600]),
        ("lattice in contact", lattice(1.0, 0.5)),
        ("lattice of binary edge", lattice(0.25, 0.125)),
        ("line", line),
        ("one huge among tiny", one_huge),
        ("outliers to the largest float", outlier),
        ("powers of two", powers),
        ("crowds", crowds),
        ("far from the origin", moved(cloud(5, 2000, 20.0, |_| 0.5), 1e6)),
        ("very far from the origin", moved(cloud(6, 500, 20.0, |_| 0.5), 1e9)),
        ("near the largest float", tiny(3e38).collect()),
        ("squares overflow", tiny(1e25).collect()),
        ("squares underflow", tiny(1e-25).collect()),
        ("subnormal", tiny(1e-39).collect()),
        ("huge radii", vec![Sphere::new([3e38, 0.0, 0.0], 3e38), Sphere::new([-3e38, 0.0, 0.0], 3.4e38)]),
        ("one at the largest float", vec![Sphere::new([f32::MAX; 3], 0.0)]),
        (
            "corners of space",
            [f32::MAX, -f32::MAX, f32::MAX, 0.0].map(|x| Sphere::new([x, -x, x], 1.0)).to_vec(),
        ),
        ("negative zero", vec![Sphere::new([-0.0; 3], -0.0), Sphere::new([0.0; 3], 0.0)]),
    ]
}

#[test]
fn every_scene_agrees_with_all_pairs() {
    let Some(own) = device() else { return };
    for algorithm in ALGORITHMS {
        for subgroups in [false, true] {
            let mut detector = GpuDetector::new(&own.device, settings(algorithm, subgroups)).expect("made");
            for (name, spheres) in scenes() {
                let scene = format!("{name}, {algorithm}, subgroups {subgroups}");
                let found = detect(&own, &mut detector, &spheres);
                assert_eq!(found.outcome.overflow & !Outcome::PAIRS, 0, "{scene}");
                assert_eq!(found.outcome.quarantined, 0, "{scene}");
                if found.outcome.overflow == 0 {
                    judge(&scene, &spheres, &found.pairs, touching(&spheres));
                } else {
                    let n = spheres.len() as u64;
                    assert_eq!(found.outcome.found(), n * (n - 1) / 2, "{scene}");
                }
            }
        }
    }
}

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

/// A crowd beside a few spheres, with some of both on the border between their cells: as τ grows, the crowd's cells go
/// from refined to settled, one after another.
#[test]
fn settled_and_refined_cells_share_spheres() {
    let Some(own) = device() else { return };
    // Of the largest sphere, which lies apart, cells are 4.1 wide and have a corner at the median.
    let mut spheres = vec![Sphere::new([40.0; 3], 1.0)];
    let mut random = Random(40);
    for k in 0..300 {
        let x = if k % 10 == 0 { random.unit() * 4.0 - 4.0 } else { random.unit() * 0.8 };
        spheres.push(Sphere::new([x, random.unit() * 0.8, random.unit() * 0.8], 0.1));
    }
    // On the border, and at one point.
    spheres.extend((0..40).map(|k| Sphere::new([0.0, k as f32 * 0.02, 0.4], 0.15)));
    let mut entries = Vec::new();
    for tau in (0..=350).step_by(10) {
        let settings = GpuSettings { tau, ..settings(Algorithm::LazyGrid, true) };
        let found = detect_in_session(&own, settings, &spheres);
        judge(&format!("tau {tau}"), &spheres, &found.pairs, touching(&spheres));
        entries.push(found.outcome.entries());
    }
    entries.dedup();
    assert!(entries.len() > 4, "cells are refined one by one: {entries:?}");
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

#[test]
fn overflow_stops_writing_and_keeps_counting() {
    let Some(own) = device() else { return };
    let spheres = vec![Sphere::new([1.0, 2.0, 3.0], 0.5); 20_000];
    for algorithm in ALGORITHMS {
        for subgroups in [false, true] {
            let settings = GpuSettings { pair_capacity: 1000, ..settings(algorithm, subgroups) };
            let mut detector = GpuDetector::new(&own.device, settings).expect("made");
            let found = detect(&own, &mut detector, &spheres);
            assert_eq!(found.outcome.found(), 199_990_000, "{algorithm}, subgroups {subgroups}");
            assert_eq!(found.outcome.overflow, Outcome::PAIRS);
            assert_eq!(found.pairs.len(), 1000);
            assert!(found.pairs.windows(2).all(|two| two[0] < two[1]), "distinct");
            assert!(found.pairs.iter().all(|pair| pair.i < pair.j && pair.j < 20_000));
            let groups = [found.outcome.dispatch_x, found.outcome.dispatch_y, found.outcome.dispatch_z];
            assert_eq!(groups, [4, 1, 1], "a thread per written pair");
        }
    }
}

#[test]
fn bad_spheres_are_quarantined_and_counted() {
    let Some(own) = device() else { return };
    let mut spheres = cloud(20, 2000, 10.0, |_| 0.4);
    let good = spheres.clone();
    let bad = [
        [f32::NAN, 0.0, 0.0, 1.0],
        [0.0, f32::INFINITY, 0.0, 1.0],
        [0.0, 0.0, f32::NEG_INFINITY, 1.0],
        [5.0, 5.0, 5.0, f32::NAN],
        [5.0, 5.0, 5.0, f32::INFINITY],
        [5.0, 5.0, 5.0, -1.0],
        [5.0, 5.0, 5.0, -1e-40],
    ];
    spheres.splice(0..0, bad.map(Sphere::from));
    for algorithm in ALGORITHMS {
        let mut detector = GpuDetector::new(&own.device, settings(algorithm, true)).expect("made");
        let found = detect(&own, &mut detector, &spheres);
        assert_eq!(found.outcome.quarantined, bad.len() as u32, "{algorithm}");
        let shifted: Vec<_> = found
            .pairs
            .iter()
            .map(|p| Pair { i: p.i - bad.len() as u32, j: p.j - bad.len() as u32 })
            .collect();
        judge("quarantine", &good, &shifted, touching(&good));
        let all_bad = detect(&own, &mut detector, &bad.map(Sphere::from));
        assert_eq!((all_bad.outcome.found(), all_bad.outcome.quarantined), (0, bad.len() as u32));
    }
}

#[test]
fn the_number_of_spheres_may_come_from_a_buffer() {
    let Some(own) = device() else { return };
    let spheres = cloud(21, 3000, 12.0, |_| 0.4);
    let buffer = upload(&own, &spheres);
    for algorithm in ALGORITHMS {
        let mut detector = GpuDetector::new(&own.device, settings(algorithm, true)).expect("made");
        for n in [0_u32, 1, 257, 3000] {
            let count = upload(&own, &[n]);
            let count = Count::Buffer { buffer: &count, at_most: 3000 };
            let input = GpuSpheres { spheres: &buffer, count, species: None, window: GpuSpheres::ALL };
            let found = detect_with(&own, &mut detector, &input);
            let part = &spheres[..n as usize];
            judge("count from a buffer", part, &found.pairs, touching(part));
            assert_eq!((found.outcome.spheres, found.outcome.overflow), (n, 0));
        }
        let count = upload(&own, &[4000_u32]);
        let count = Count::Buffer { buffer: &count, at_most: 3000 };
        let found = detect_with(
            &own,
            &mut detector,
            &GpuSpheres { spheres: &buffer, count, species: None, window: GpuSpheres::ALL },
        );
        assert_eq!((found.outcome.spheres, found.outcome.overflow), (4000, Outcome::SPHERES));
    }
}

#[test]
fn interactions_decide_what_is_a_pair() {
    let Some(own) = device() else { return };
    let spheres = cloud(22, 2500, 10.0, |random| 0.05 + 0.2 * random.unit());
    let mut random = Random(23);
    let species: Vec<u32> = (0..spheres.len()).map(|_| random.word() % 4).collect();
    let mut table = Interactions::new(4, Interaction::Never).expect("small");
    table.set(0, 1, Interaction::Within(0.7)).expect("in range");
    table.set(2, 2, Interaction::Touch).expect("in range");
    table.set(2, 1, Interaction::Within(0.01)).expect("in range");
    let buffers = (upload(&own, &spheres), upload(&own, &species));
    let input = GpuSpheres {
        spheres: &buffers.0,
        count: Count::Host(2500),
        species: Some(&buffers.1),
        window: GpuSpheres::ALL,
    };
    for algorithm in ALGORITHMS {
        for subgroups in [false, true] {
            let settings =
                GpuSettings { interactions: Some(table.clone()), ..settings(algorithm, subgroups) };
            let mut detector = GpuDetector::new(&own.device, settings).expect("made");
            let found = detect_with(&own, &mut detector, &input);
            assert!(found.pairs.len() > 100, "{}", found.pairs.len());
            judge("interactions", &spheres, &found.pairs, |i, j| match table.get(species[i], species[j]) {
                Interaction::Never => None,
                Interaction::Touch => Some(f64::from(spheres[i].radius) + f64::from(spheres[j].radius)),
                Interaction::Within(distance) => Some(distance.into()),
            });
        }
    }
}

#[test]
fn calls_of_changing_size_reuse_what_is_there() {
    let Some(own) = device() else { return };
    let mut detector = GpuDetector::new(&own.device, settings(Algorithm::Auto, true)).expect("made");
    detector.reserve(6000).expect("fits");
    let pairs = detector.pairs().expect("reserved").clone();
    for n in [10, 6000, 300, 5999, 1] {
        let spheres = cloud(n as u64, n, 15.0, |_| 0.4);
        let found = detect(&own, &mut detector, &spheres);
        judge("changing size", &spheres, &found.pairs, touching(&spheres));
        assert_eq!(detector.pairs(), Some(&pairs), "nothing is allocated anew");
    }
}

#[test]
fn what_does_not_fit_is_refused_with_the_remedy() {
    let Some(own) = device() else { return };
    let mut detector = GpuDetector::new(&own.device, settings(Algorithm::ArrayGrid, true)).expect("made");
    let buffer = upload(&own, &[Sphere::zeroed(); 10]);
    let mut encoder = own.device.create_command_encoder(&Default::default());
    let too_short =
        GpuSpheres { spheres: &buffer, count: Count::Host(11), species: None, window: GpuSpheres::ALL };
    let error = detector.encode(&mut encoder, &too_short).expect_err("11 do not fit into 10");
    assert_eq!(error, GpuError::Buffer { what: "spheres", size: 160, needed: 176, usage: "" });
    let with_species = GpuSpheres { count: Count::Host(2), species: Some(&buffer), ..too_short.clone() };
    assert_eq!(detector.encode(&mut encoder, &with_species), Err(GpuError::Species));
    let limit = own.device.limits().max_storage_buffer_binding_size;
    let beyond = u32::try_from(limit / 16 + 1).unwrap_or(u32::MAX);
    assert!(matches!(detector.reserve(beyond), Err(GpuError::LimitExceeded { .. })));
    for ratio in [0.5, 17.0, f32::NAN] {
        assert!(matches!(detector.set_raster_ratio(ratio), Err(GpuError::Setting { .. })));
    }
    let error = GpuDetector::new(&own.device, settings(Algorithm::CellList, true)).expect_err("CPU only");
    assert_eq!(error, GpuError::NotOnGpu(Algorithm::CellList));
}

#[test]
fn windows_part_the_result() {
    let Some(own) = device() else { return };
    let mut spheres = cloud(24, 2000, 12.0, |_| 0.4);
    spheres.extend(vec![Sphere::new([1.0; 3], 0.3); 700]);
    let n = spheres.len() as u32;
    let buffer = upload(&own, &spheres);
    for algorithm in ALGORITHMS {
        let mut detector = GpuDetector::new(&own.device, settings(algorithm, true)).expect("made");
        let mut all = Vec::new();
        for window in [0..1, 1..900, 900..2500, 2500..n] {
            let count = Count::Host(n);
            let input = GpuSpheres { spheres: &buffer, count, species: None, window: window.clone() };
            let found = detect_with(&own, &mut detector, &input);
            assert!(found.pairs.iter().all(|pair| window.contains(&pair.i)));
            all.extend(found.pairs);
        }
        judge("windows", &spheres, &all, touching(&spheres));
    }
}

#[test]
fn species_outside_the_table_are_quarantined() {
    let Some(own) = device() else { return };
    let spheres = vec![Sphere::new([1.0; 3], 0.5); 400];
    let species: Vec<u32> = (0..400).map(|k| k % 4).collect();
    let table = Interactions::new(2, Interaction::Touch).expect("small");
    let buffers = (upload(&own, &spheres), upload(&own, &species));
    let (spheres, count, species) = (&buffers.0, Count::Host(400), Some(&buffers.1));
    for algorithm in ALGORITHMS {
        let settings = GpuSettings { interactions: Some(table.clone()), ..settings(algorithm, true) };
        let mut detector = GpuDetector::new(&own.device, settings).expect("made");
        let input = GpuSpheres { spheres, count, species, window: GpuSpheres::ALL };
        let found = detect_with(&own, &mut detector, &input);
        assert_eq!((found.outcome.quarantined, found.outcome.found()), (200, 200 * 199 / 2), "{algorithm}");
    }
}

#[test]
fn a_host_application_with_default_limits_and_no_features() {
    if device().is_none() {
        return;
    }
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&Default::default())).expect("one is there");
    let (device, queue) =
        pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default())).expect("defaults");
    device.on_uncaptured_error(std::sync::Arc::new(|error: wgpu::Error| panic!("leaked: {error}")));
    let lent = GpuDevice::lent(&device, &queue);
    let spheres = cloud(30, 2500, 12.0, |_| 0.4);
    for algorithm in ALGORITHMS {
        let settings = GpuSettings { timed: true, ..settings(algorithm, true) };
        let mut detector = GpuDetector::new(&device, settings).expect("made");
        assert!(detector.ticks().is_none(), "timestamps were not requested");
        let found = detect(&lent, &mut detector, &spheres);
        judge("default limits", &spheres, &found.pairs, touching(&spheres));
    }
    let table = Interactions::new(2, Interaction::Touch).expect("small");
    let settings = GpuSettings { interactions: Some(table), ..settings(Algorithm::ArrayGrid, true) };
    let mut detector = GpuDetector::new(&device, settings).expect("made");
    let error = detector.reserve(1000).expect_err("ten storage buffers where the default is eight");
    assert!(matches!(error, GpuError::LimitExceeded { needed: 10, limit: 8, .. }), "{error}");
}
