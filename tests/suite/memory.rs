//! Memory that detectors use, measured by the allocator. Most tests use one thread, as the number of
//! workspaces depends on scheduling.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
use std::sync::{Mutex, MutexGuard, PoisonError};

use glam::Vec3;
use lazygrid::{
    Algorithm, Backend, Config, Detector, Interaction, Interactions, Order, Skin, Sphere, Spheres,
};
use lazygrid_io::scenes::Scene;
use lazygrid_tests::{DetectorVariant, SuiteVariant, in_pool, variants};

struct Counting;

static LIVE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);
static TOTAL: AtomicUsize = AtomicUsize::new(0);
static LARGEST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is forwarded unchanged to the system allocator; the counters touch no memory of the caller.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let size = layout.size();
        let live = LIVE.fetch_add(size, SeqCst) + size;
        PEAK.fetch_max(live, SeqCst);
        TOTAL.fetch_add(size, SeqCst);
        LARGEST.fetch_max(size, SeqCst);
        // SAFETY: the caller upholds the contract of `GlobalAlloc`, which is that of the system allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size(), SeqCst);
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Locks out other measuring tests, as all threads share the counters.
struct Measurement {
    live: usize,
    _alone: MutexGuard<'static, ()>,
}

impl Measurement {
    fn alone() -> Self {
        static TEST_LOCK: Mutex<()> = Mutex::new(());
        let alone = TEST_LOCK.lock().unwrap_or_else(PoisonError::into_inner);
        // The memory of thread pools and SIMD detection belongs to no detector.
        in_pool(1, || lazygrid::detect(&[] as &[Sphere]).is_ok());
        Self { live: 0, _alone: alone }
    }

    fn start(&mut self) {
        self.live = LIVE.load(SeqCst);
        PEAK.store(self.live, SeqCst);
        TOTAL.store(0, SeqCst);
        LARGEST.store(0, SeqCst);
    }

    fn peak(&self) -> usize {
        PEAK.load(SeqCst).saturating_sub(self.live)
    }

    fn used(&self) -> usize {
        LIVE.load(SeqCst).saturating_sub(self.live)
    }

    fn total_and_largest(&self) -> (usize, usize) {
        (TOTAL.load(SeqCst), LARGEST.load(SeqCst))
    }
}

fn on_cpu(variants: Vec<DetectorVariant>) -> impl Iterator<Item = DetectorVariant> {
    variants.into_iter().filter(|variant| variant.backend() == Backend::Cpu)
}

/// Bytes for reports, plans and padding, which the estimate excludes.
const FIXED_BYTES: usize = 16 << 10;
/// Number of measurements; threads that the test harness starts meanwhile add to some, but not to all.
const MEASUREMENTS: usize = 3;

fn repeated(mut peak_and_bound: impl FnMut() -> (usize, usize)) -> (usize, usize) {
    (1..MEASUREMENTS).fold(
        peak_and_bound(),
        |(peak, bound), _| {
            if peak <= bound { (peak, bound) } else { peak_and_bound() }
        },
    )
}

#[test]
fn second_call_allocates_nothing_proportional_to_the_input() {
    const N: usize = 80_000;
    let mut measurement = Measurement::alone();
    for scene in [Scene::Equal, Scene::FiveSizes, Scene::Burst] {
        let spheres = scene.spheres(N, 31);
        for variant in variants::each_algorithm().into_iter().filter(|s| s.algorithm != Algorithm::Naive) {
            // Host allocations for the GPU depend only on the number of spheres.
            let spheres = match (variant.backend(), scene) {
                (Backend::Gpu, Scene::Equal) => &spheres[..N / 4],
                (Backend::Gpu, _) => continue,
                _ => &spheres[..],
            };
            let mut detector = Detector::new(variant.settings()).expect("a detector");
            let mut ask = || {
                detector.neighbors(spheres).expect("neighbors");
                detector.count(spheres).expect("a count");
                detector.pairs(spheres).expect("pairs").len()
            };
            variant.run(&mut ask);
            // Calls on the GPU alternate between two input buffers.
            variant.run(&mut ask);
            measurement.start();
            let pairs = variant.run(&mut ask);
            let (total, largest) = measurement.total_and_largest();
            let n = spheres.len();
            assert!(largest < n, "{variant}, {scene}: one allocation of {largest} bytes");
            let most = 16 * n + 2 * pairs;
            assert!(total < most, "{variant}, {scene}: {total} bytes in total, more than {most}");
        }
    }
}

#[test]
fn memory_for_is_an_upper_bound() {
    let mut measurement = Measurement::alone();
    for n in [0, 1, 100, 5000, 50_000] {
        for (scene, spheres) in scenes(n, 32) {
            let n = if ["point", "crowd", "far and fine"].contains(&scene.as_str()) { n / 10 } else { n };
            let spheres = &spheres[..n];
            for variant in on_cpu(variants::each_algorithm()) {
                if variant.algorithm == Algorithm::Naive && n > 10_000 {
                    continue;
                }
                let (peak, bound) = repeated(|| {
                    measurement.start();
                    let mut detector = Detector::new(variant.settings()).expect("a detector");
                    variant.run(|| detector.count(spheres)).expect("a count");
                    let peak = measurement.peak();
                    (peak, variant.run(|| detector.memory_for(n as u64)) as usize + FIXED_BYTES)
                });
                assert!(peak <= bound, "{variant}, {scene}, {n}: {peak} bytes exceed the bound of {bound}");
            }
        }
    }
}

#[test]
fn memory_for_is_an_upper_bound_with_species() {
    let mut measurement = Measurement::alone();
    for species in [1, 64, 512, 513, 4096] {
        let table = distances(species);
        for n in [0, 1, 10, 100, 1000, 5000] {
            let spheres = Scene::Equal.spheres(n, 37);
            let calls = [1, 2].map(|divisor| (0..n as u32).map(|k| k % (species / divisor).max(1)).collect());
            for variant in on_cpu(variants::each_algorithm()) {
                let (peak, bound) = repeated(|| {
                    measurement.start();
                    let config = variant.settings().interactions(table.clone());
                    let mut detector = Detector::new(config).expect("a detector");
                    calls.iter().for_each(|ids: &Vec<u32>| {
                        let query = Spheres::from(&spheres).with_species(ids).expect("as many");
                        variant.run(|| detector.count(query)).expect("a count");
                    });
                    let peak = measurement.peak();
                    (peak, variant.run(|| detector.memory_for(n as u64)) as usize + FIXED_BYTES)
                });
                assert!(peak <= bound, "{variant}, {species}, {n}: {peak} bytes exceed the bound of {bound}");
            }
        }
    }
}

fn distances(species: u32) -> Interactions {
    let mut table = Interactions::new(species, Interaction::Never).expect("few species");
    for a in 0..species {
        let within = Interaction::Within(1.0 + 0.25 * f64::from(a % 5));
        table.set(a, (a * 7 + 1) % species, within).expect("a distance in range");
    }
    table
}

/// Each thread may compare a cell with all spheres, in this or an earlier call.
#[test]
fn memory_for_is_an_upper_bound_for_several_threads() {
    let mut measurement = Measurement::alone();
    let crowded =
        scenes(30_000, 36).into_iter().filter(|(name, _)| ["crowd", "far and fine"].contains(&&**name));
    for (scene, spheres) in crowded {
        for algorithm in [Algorithm::ArrayGrid, Algorithm::HashGrid, Algorithm::RecursiveGrid] {
            let config = Config::default().backend(Backend::Cpu).algorithm(algorithm).threads(16);
            let mut detector = Detector::new(config.skin(Skin::Off)).expect("a detector");
            detector.count(&spheres[..2]).expect("a count");
            measurement.start();
            let bound = detector.memory_for(spheres.len() as u64) as usize + FIXED_BYTES;
            for call in 0..8 {
                detector.count(&spheres).expect("a count");
                // A growing buffer briefly needs the old one too, so only the remaining memory is compared.
                let used = measurement.used();
                assert!(
                    used <= bound,
                    "{algorithm}, {scene}, call {call}: {used} bytes exceed the bound of {bound}"
                );
            }
        }
    }
}

/// Returns the benchmark scenes, a crowd in about one cell of the paper's grids, and a distant huge sphere.
fn scenes(n: usize, seed: u64) -> Vec<(String, Vec<Sphere>)> {
    let crowd = Scene::Equal.spheres(n, seed).into_iter().map(|sphere| {
        let extent = (n as f32 * 20.0).cbrt().max(1.0);
        Sphere::new(sphere.center * (5.0 / extent) + 100.0, 1.0)
    });
    let mut scenes: Vec<_> =
        Scene::ALL.iter().map(|scene| (scene.to_string(), scene.spheres(n, seed))).collect();
    scenes.push(("crowd".to_owned(), crowd.collect()));
    let fine = Scene::Equal.spheres(n, seed).into_iter().enumerate().map(|(k, sphere)| {
        let center = sphere.center * Vec3::new(0.0, 1e-5, 1e-5);
        Sphere::new(center.with_x(1e30), if k == 0 { 1e22 } else { 1e-6 })
    });
    scenes.push(("far and fine".to_owned(), fine.collect()));
    scenes
}

/// The bound includes the growth of buffers, which inputs of constant size do not need.
#[test]
fn memory_for_exceeds_the_peak_by_at_most_two_thirds() {
    let mut measurement = Measurement::alone();
    for variant in on_cpu(variants::each_algorithm()) {
        let n = if variant.algorithm == Algorithm::Naive { 5000 } else { 20_000 };
        let (mut most, mut equal, mut bound) = (0, 0, 0);
        for (scene, spheres) in scenes(n, 34) {
            measurement.start();
            let mut detector = Detector::new(variant.settings().skin(Skin::Off)).expect("a detector");
            for _ in 0..3 {
                variant.run(|| detector.count(&spheres)).expect("a count");
            }
            let peak = measurement.peak();
            bound = variant.run(|| detector.memory_for(n as u64)) as usize;
            most = most.max(peak);
            equal = if scene == "equal" { peak } else { equal };
        }
        assert!(bound * 3 <= most * 5, "{variant}: a bound of {bound} bytes for {most} used bytes");
        let is_of_one_level = variant.algorithm != Algorithm::RecursiveGrid;
        assert!(
            !is_of_one_level || bound <= equal * 2,
            "{variant}: a bound of {bound} bytes for {equal} used bytes"
        );
    }
}

#[test]
fn memory_for_is_an_upper_bound_for_a_growing_input() {
    let mut measurement = Measurement::alone();
    let spheres = Scene::FiveSizes.spheres(60_000, 33);
    for variant in on_cpu(variants::each_algorithm()).filter(|s| s.algorithm != Algorithm::Naive) {
        measurement.start();
        let mut detector = Detector::new(variant.settings()).expect("a detector");
        let used = variant.run(|| {
            for n in (40_000..=60_000).step_by(2000) {
                detector.count(&spheres[..n]).expect("a count");
            }
            measurement.used()
        });
        let bound = detector.memory_for(60_000) as usize + FIXED_BYTES;
        assert!(used <= bound, "{variant}: {used} bytes exceed the bound of {bound}");
    }
}

/// Equal spheres have nearly the estimated number of entries in cells of up to two diameters, and a growing
/// buffer is an eighth larger than it needs to be.
#[test]
fn memory_for_is_an_upper_bound_for_growing_grids_of_small_cells() {
    let mut measurement = Measurement::alone();
    let spheres = Scene::Equal.spheres(24_000, 35);
    let grids = [Algorithm::ArrayGrid, Algorithm::HashGrid, Algorithm::RecursiveGrid];
    for variant in on_cpu(variants::each_algorithm()).filter(|variant| grids.contains(&variant.algorithm)) {
        for ratio in [1.0, 1.5, 2.0] {
            measurement.start();
            let mut detector =
                Detector::new(variant.settings().cell_ratio(ratio).threads(1)).expect("a detector");
            for n in (18_000..=24_000).step_by(600) {
                detector.count(&spheres[..n]).expect("a count");
                let (used, bound) =
                    (measurement.used(), detector.memory_for(n as u64) as usize + FIXED_BYTES);
                assert!(used <= bound, "{variant}, {ratio}, {n}: {used} bytes exceed the bound of {bound}");
            }
        }
    }
}

#[test]
fn memory_for_includes_candidates() {
    const N: usize = 20_000;
    let mut measurement = Measurement::alone();
    let cell_list = |s: &DetectorVariant| s.algorithm == Algorithm::CellList;
    for variant in on_cpu(variants::each_algorithm()).filter(cell_list) {
        let mut most = 0;
        for (skin, extent) in [(0.5, 24.0), (0.5, 20.0), (0.5, 12.0), (0.003, 1e-3)] {
            let spheres = cube(N, extent);
            measurement.start();
            let config = variant.settings().skin(Skin::Fixed(skin));
            let mut detector = Detector::new(config).expect("a detector");
            for _ in 0..3 {
                variant.run(|| detector.count(&spheres)).expect("a count");
            }
            let peak = measurement.peak();
            let bound = variant.run(|| detector.memory_for(N as u64)) as usize + FIXED_BYTES;
            assert!(peak <= bound, "{variant}, {extent}: {peak} bytes exceed the bound of {bound}");
            most = most.max(if detector.report().candidates.is_some() { peak } else { 0 });
        }
        let detector = Detector::new(variant.settings().skin(Skin::Fixed(0.5))).expect("a detector");
        let bound = variant.run(|| detector.memory_for(N as u64)) as usize;
        assert!(bound <= 2 * most, "{variant}: a bound of {bound} bytes for {most} used bytes");
    }
}

fn cube(n: usize, extent: f32) -> Vec<Sphere> {
    let side = (n as f32).cbrt().ceil() as usize;
    let at = |k: usize| [k % side, k / side % side, k / side / side].map(|c| c as f32 * extent / side as f32);
    (0..n).map(|k| Sphere::new(at(k), 0.5)).collect()
}

/// A stream needs a few chunks for each thread.
#[test]
fn a_stream_needs_no_memory_for_its_pairs() {
    let mut measurement = Measurement::alone();
    let spheres = vec![Sphere::new([0.0; 3], 1.0); 20_000];
    for variant in on_cpu(variants::all()) {
        measurement.start();
        let mut detector = Detector::new(variant.settings().order(Order::Unordered)).expect("a detector");
        let mut chunks = 0;
        let delivered = variant.run(|| {
            detector.stream(&spheres, 4096, |_| {
                chunks += 1;
                if chunks == 800 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })
        });
        assert!(delivered.expect("a stream") >= 799 * 4096 / 2, "{variant}");
        let (peak, bound) = (measurement.peak(), detector.memory_for(20_000) as usize + (16 << 20));
        assert!(peak < bound, "{variant}: {peak} bytes exceed the bound of {bound}");
    }
}

#[test]
fn a_refused_list_stays_within_its_limit() {
    let mut measurement = Measurement::alone();
    let spheres = vec![Sphere::new([0.0; 3], 1.0); 8000];
    let limit = 1 << 20;
    for variant in on_cpu(variants::all()) {
        measurement.start();
        let mut detector = Detector::new(variant.settings().max_pairs(limit)).expect("a detector");
        assert!(variant.run(|| detector.pairs(&spheres).is_err()), "{variant}");
        let bound = detector.memory_for(8000) as usize + 8 * limit as usize + (16 << 20);
        let peak = measurement.peak();
        assert!(peak < bound, "{variant}: {peak} bytes exceed the bound of {bound}");
    }
}

#[test]
fn a_canonical_stream_stays_within_its_limit() {
    let mut measurement = Measurement::alone();
    let spheres = vec![Sphere::new([0.0; 3], 1.0); 2000];
    let (found, limit) = (2000 * 1999 / 2, 1 << 15);
    for variant in on_cpu(variants::all()) {
        measurement.start();
        let mut detector = Detector::new(variant.settings().max_pairs(limit)).expect("a detector");
        let (mut last, mut in_order) = (None, true);
        let delivered = variant.run(|| {
            detector.stream(&spheres, 4096, |pairs| {
                in_order &= last < pairs.first().copied() && pairs.is_sorted();
                last = pairs.last().copied();
                ControlFlow::Continue(())
            })
        });
        assert_eq!(delivered, Ok(found), "{variant}");
        assert!(in_order, "{variant}: not in canonical order");
        // Includes the found chunks, and the pairs before and after sorting.
        let bound = detector.memory_for(2000) as usize + 40 * limit as usize + (2 << 20);
        let peak = measurement.peak();
        assert!(peak < bound, "{variant}: {peak} bytes exceed the bound of {bound}");
    }
}
